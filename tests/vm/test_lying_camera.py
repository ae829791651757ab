"""A camera that lies: what each fault of the virtual sensor looks like to the product's capture on the real driver."""

import re

import numpy as np
import pytest

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


@pytest.mark.parametrize(
    ("faults", "letters", "told_as"),
    [
        (Faults(error=0.3), "MJPG", ("lost", "damaged")),
        (Faults(torn=0.3), "MJPG", ("corrupt",)),
        (Faults(torn=0.3), "YUYV", ("lost", "damaged", "corrupt")),
        (Faults(duplicate=0.5), "MJPG", ("identical",)),
    ],
)
def test_what_the_camera_does_to_pictures_is_counted(
    guest: Guest, one: VirtualSensor, faults: Faults, letters: str, told_as: tuple[str, ...]
) -> None:
    one.inject(faults)
    counts = guest.run("looking:read_frames", serial=ONE, options=f"format={letters}", count=25)
    assert sum(counts[name] for name in told_as) > 0


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
