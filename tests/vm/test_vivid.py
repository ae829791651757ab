"""The kernel's own fake camera: faults that no USB device can cause, seen by the product's capture."""

from collections.abc import Iterator

import numpy as np
import pytest

from tests.vm.machine.qemu import Guest


@pytest.fixture(scope="module")
def vivid(guest: Guest) -> Iterator[Guest]:
    modules = (guest.folder / "on-demand.txt").read_text().split()
    assert guest.run("faking:load", modules=modules).startswith("/dev/video")
    yield guest
    guest.run("faking:unload")


NO_FAULTS = {"Timestamp Source": 1}
"""stamps at the start of the exposure; by default vivid stamps the end of a picture and hands it over before that"""


def test_an_honest_camera_shows_no_fault(vivid: Guest) -> None:
    found = vivid.run("faking:stream", before=NO_FAULTS, during={}, count=10)
    assert found["mode"].startswith("YUYV 320x180")
    assert found["gain"] == 77, "its automatic was switched off first"
    assert all(found["sound"])
    assert found["counts"]["damaged"] == found["counts"]["duplicated"] == 0


def test_every_raw_format_shows_the_same_colours(vivid: Guest) -> None:
    yuyv, rgb, grey = (np.array(vivid.run("faking:bars", letters=letters)) for letters in ("YUYV", "RGB3", "GREY"))
    print("colour bars, RGB3 and grey:", rgb.round().tolist(), grey[:, 0].round().tolist())
    assert np.ptp(rgb, axis=0).min() > 150, "bars of many colours"
    assert np.abs(yuyv - rgb).max() < 6
    assert (grey == grey[:, :1]).all()
    assert np.corrcoef(rgb @ (0.299, 0.587, 0.114), grey[:, 0])[0, 1] > 0.98, "the brightness of the same bars"


def test_dropped_buffers_are_counted_as_lost(vivid: Guest) -> None:
    found = vivid.run("faking:stream", before=NO_FAULTS, during={"Percentage of Dropped Buffers": 40}, count=25)
    assert found["counts"]["lost"] >= 3
    assert max(found["steps"]) > 1


def test_a_picture_that_the_driver_marks_as_damaged_is_counted_and_not_delivered(vivid: Guest) -> None:
    found = vivid.run("faking:stream", before=NO_FAULTS, during={"Inject V4L2_BUF_FLAG_ERROR": 1}, count=10)
    assert found["counts"]["damaged"] == 1
    assert found["counts"]["delivered"] == 11


def test_time_stamps_of_the_future_are_not_believed(vivid: Guest) -> None:
    found = vivid.run("faking:stream", before={"Timestamp Source": 0}, during={}, count=10)
    assert any(found["ahead"]), "not all where the machine is so busy that pictures are taken late"
    assert not any(sound and ahead for sound, ahead in zip(found["sound"], found["ahead"], strict=True))
    assert found["counts"]["wrong_stamps"] >= sum(found["ahead"])


def test_time_stamps_of_another_clock_are_not_believed(vivid: Guest) -> None:
    found = vivid.run("faking:stream", before={**NO_FAULTS, "Wrap Timestamp": 1}, during={}, count=10)
    assert not any(found["sound"])
