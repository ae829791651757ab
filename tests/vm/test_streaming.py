"""Pictures of the virtual sensor through the kernel's own driver, taken with the product's own capture."""

import itertools

import numpy as np
import pytest

from tests.virtual_usb.device import VirtualSensor
from tests.vm.machine.bench import ONE, Bench
from tests.vm.machine.qemu import Guest


def test_the_camera_offers_two_formats_in_two_sizes(guest: Guest, one: VirtualSensor) -> None:
    assert guest.run("looking:formats", serial=ONE) == [
        f"{letters} {size} at 30, 15, 7.5 fps" for letters in ("MJPG", "YUYV") for size in ("160x120", "80x60")
    ]


@pytest.mark.parametrize("letters", ["MJPG", "YUYV"])
def test_pictures_come_whole_in_order_and_show_what_the_device_saw(
    guest: Guest, one: VirtualSensor, letters: str
) -> None:
    found = guest.run("looking:stream", serial=ONE, options=f"format={letters}", count=20)
    assert found["mode"] == f"{letters} 160x120 at 30 fps"
    assert all(later > earlier for earlier, later in itertools.pairwise(found["sequence"]))
    assert all(later > earlier for earlier, later in itertools.pairwise(found["stamps"]))
    assert all(found["sound"])
    assert found["status"]["damaged"] == found["status"]["corrupt"] == 0
    assert len(found["sound"]) == 20
    shown = one.video._camera.read().image[::4, ::4].astype(float)  # the press is held: every picture is the same
    error = np.abs(np.array(found["picture"], float) - shown)
    assert error.mean() < 4, "grey levels, mostly noise of both pictures and halved colours"


def test_the_smaller_size_at_the_lower_rate(guest: Guest, one: VirtualSensor) -> None:
    found = guest.run("looking:stream", serial=ONE, options="format=MJPG&width=80&height=60&fps=15", count=8)
    assert (found["mode"], found["shape"]) == ("MJPG 80x60 at 15 fps", [60, 80, 3])
    assert min(np.diff(found["numbers"])) >= 2, "every other picture of the camera at most"


def test_controls_reach_the_device_hold_and_act(guest: Guest, one: VirtualSensor) -> None:
    wanted = {"exposure_us": 4000.0, "gain": 4.0, "white_balance_k": 4600.0}
    found = guest.run("looking:set_controls", serial=ONE, values=wanted)
    assert found["held"] == found["read"] == wanted
    assert all(found["locked"].values())
    assert one.video.controls.snapshot() == {
        "auto_exposure": 1, "dynamic_frame_rate": 0, "exposure_us": 40, "gain": 4, "power_line": 0,
        "white_balance_k": 4600, "auto_white_balance": 0,
    }  # fmt: skip
    assert found["ranges"]["gain"] == [0, 112, 1]
    assert found["brighter"] == pytest.approx(0.5 * 1.25, rel=0.05)


def test_a_slow_program_gets_far_newer_pictures_than_from_opencv(
    guest: Guest, bench: Bench, one: VirtualSensor, record_property: pytest.FixtureRequest
) -> None:
    offset_s = guest.run("plugging:clock_offset", server=bench.clock.port)
    found = guest.run("looking:ages", serial=ONE, offset_s=offset_s)
    print("age of a picture, s:", found)
    assert found["ours median"] > 0.02, "the exposure itself takes so long: else the clocks are compared wrongly"
    assert found["ours median"] <= found["OpenCV median"] / 4


def test_a_camera_that_somebody_else_uses_is_told_with_his_name(guest: Guest, bench: Bench, one: VirtualSensor) -> None:
    watching = guest.start("looking:watch", serial=ONE)
    watching.event("streaming")
    message = guest.aside.run("looking:complaint", serial=ONE, options="")
    bench.unplug("one", aside=True)
    watching.result()
    assert message.startswith("BusyError")
    assert "python" in message


def test_a_camera_that_one_may_not_use_is_told_with_the_remedy(guest: Guest, one: VirtualSensor) -> None:
    message = guest.run("looking:complaint", serial=ONE, options="", user=65534)
    assert message.startswith("DeniedError")
    assert "gellight install-udev" in message
