"""A camera that lies: what each fault of the virtual sensor looks like to the product's capture on the real driver."""

import re

import numpy as np

from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.faults import Faults
from tests.vm.machine.bench import ONE
from tests.vm.machine.qemu import Guest

PERIOD_S = 1 / 30


def test_pictures_that_the_camera_loses_leave_gaps_in_time(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(drop=0.3))
    found = guest.run("looking:stream", serial=ONE, options="format=MJPG", count=25)
    steps = np.diff(found["numbers"]) - np.diff(found["sequence"])
    assert steps.sum() > 0, "the driver's sequence numbers do not know of them"
    assert np.diff(found["stamps"]).max() > 1.5 * PERIOD_S


def test_pictures_that_the_camera_marks_as_damaged_are_lost_or_damaged(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(error=0.3))
    counts = guest.run("looking:read_frames", serial=ONE, options="format=MJPG", count=25)
    assert counts["lost"] + counts["damaged"] > 0
    assert counts["corrupt"] == 0


def test_torn_jpegs_are_never_shown(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(torn=0.3))
    counts = guest.run("looking:read_frames", serial=ONE, options="format=MJPG", count=25)
    assert counts["corrupt"] > 0


def test_torn_raw_pictures_are_never_shown(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(torn=0.3))
    counts = guest.run("looking:read_frames", serial=ONE, options="format=YUYV", count=25)
    assert counts["lost"] + counts["damaged"] + counts["corrupt"] > 0


def test_a_camera_that_repeats_pictures_is_noticed(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(duplicate=0.5))
    assert guest.run("looking:read_frames", serial=ONE, options="format=MJPG", count=25)["identical"] > 0


def test_a_control_that_does_not_hold_is_an_error_that_names_it(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(stuck="exposure_us"))
    message = guest.run("looking:complaint", serial=ONE, options="exposure_us=4000")
    assert message.startswith("CameraError")
    assert "does not keep its settings: exposure_us was set to 4000 and is 8000" in message


def test_time_stamps_that_wander_are_found_by_the_doctor(guest: Guest, one: VirtualSensor) -> None:
    honest = jitter_ms(guest.run("looking:stamps", serial=ONE)["text"])
    one.inject(Faults(late_ms=40))
    finding = guest.run("looking:stamps", serial=ONE)
    lying = jitter_ms(finding["text"])
    print(f"jitter of the stamps (95 %): honest {honest} ms, held back up to 40 ms {lying} ms")
    assert lying > 10
    assert lying > 1.5 * honest
    assert (finding["level"], finding["check"]) == ("warning", "stamps")
    assert "stamp_error_us=" in finding["remedy"]


def jitter_ms(text: str) -> float:
    found = re.search(r"jitter of the time stamps ([0-9.]+) ms", text)
    assert found, text
    return float(found[1])
