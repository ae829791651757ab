"""The kernel's own fake camera: faults that no USB device can cause, seen by the product's capture."""

import pytest

from tests.vm.machine import Guest


@pytest.fixture(scope="module")
def vivid(guest: Guest) -> Guest:
    modules = (guest.folder / "on-demand.txt").read_text().split()
    assert guest.run("faking:load", modules=modules).startswith("/dev/video")
    return guest


def test_an_honest_camera_shows_no_fault(vivid: Guest) -> None:
    found = vivid.run("faking:stream", fault="", value=0, count=10)
    assert found["mode"].startswith("YUYV 320x180")
    assert found["gain"] == 77, "its automatic was switched off first"
    assert all(found["sound"])
    assert found["counts"]["damaged"] == found["counts"]["duplicated"] == 0


def test_dropped_buffers_are_counted_as_lost(vivid: Guest) -> None:
    found = vivid.run("faking:stream", fault="Percentage of Dropped Buffers", value=40, count=25)
    assert found["counts"]["lost"] >= 3
    assert max(found["steps"]) > 1


def test_a_picture_that_the_driver_marks_as_damaged_is_never_delivered(vivid: Guest) -> None:
    found = vivid.run("faking:complaint", fault="Inject V4L2_BUF_FLAG_ERROR", value=1)
    assert found["error"] == "StalledError"
    assert "only damaged pictures" in found["text"]


def test_time_that_jumps_back_is_not_believed(vivid: Guest) -> None:
    found = vivid.run("faking:stream", fault="Wrap Timestamp", value=1, count=20)
    assert not all(found["sound"])
    assert found["counts"]["wrong_stamps"] > 0


def test_a_device_that_disconnects_is_told_and_comes_back(vivid: Guest) -> None:
    found = vivid.run("faking:complaint", fault="Disconnect", value=1)
    print(f"disconnected: told after {found['seconds']:.3f} s")
    assert found["error"] == "UnpluggedError"
    again = vivid.run("faking:stream", fault="", value=0, count=5)
    assert all(again["sound"])
