"""Camera and light ring of the virtual sensor by the kernel's own drivers: found, streaming, lying, pulled out."""

import itertools
import re

import numpy as np
import pytest

from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.faults import Faults
from tests.vm.machine.bench import LIT, ONE, TWO, Bench
from tests.vm.machine.qemu import Guest


def names(links: list[str], kind: str) -> list[str]:
    """What stands after /dev/ in the links of a kind."""
    return [link.split(" -> ")[0].removeprefix("/dev/") for link in links if f"/{kind}/" in link]


def test_udev_names_camera_and_serial_port_by_the_serial_number(bench: Bench) -> None:
    found = bench.plug("one", 0)
    prefix = f"usb-GelLight_GelLight_virtual_sensor_{ONE}"
    assert names(found["links"], "by-id") == [
        f"serial/by-id/{prefix}-if00",
        f"v4l/by-id/{prefix}-video-index0",
        f"v4l/by-id/{prefix}-video-index1",
    ]
    print(f"links {found['seconds']:.2f} s after the plug went in")


@pytest.mark.parametrize("letters", ["MJPG", "YUYV"])
def test_two_sensors_stream_at_once(guest: Guest, bench: Bench, letters: str) -> None:
    bench.plug("one", 0)
    bench.plug("two", 3)
    other = guest.aside.start("looking:stream", serial=TWO, options=f"format={letters}", count=10)
    mine = guest.run("looking:stream", serial=ONE, options=f"format={letters}", count=10)
    assert len(mine["stamps"]) == len(other.result()["stamps"]) == 10


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
    assert "install-udev" in message


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
    one.inject(Faults(late_ms=120))  # a busy computer alone makes stamps wander by 20 ms
    finding = guest.run("looking:stamps", serial=ONE)
    lying = jitter_ms(finding["text"])
    print(f"jitter of the stamps (95 %): honest {honest} ms, held back up to 120 ms {lying} ms")
    assert lying > max(30, 1.5 * honest)
    assert (finding["level"], finding["check"]) == ("warning", "stamps")
    assert "stamp_error_us=" in finding["remedy"]


def jitter_ms(text: str) -> float:
    found = re.search(r"jitter of the time stamps ([0-9.]+) ms", text)
    assert found, text
    return float(found[1])


def test_a_cable_pulled_in_mid_stream_is_told_at_once(guest: Guest, bench: Bench) -> None:
    bench.plug("one", 0)
    watching = guest.start("looking:watch", serial=ONE)
    watching.event("streaming")
    bench.unplug("one", aside=True)
    found = watching.result()
    print(f"unplugged: told {found['seconds']:.3f} s after the last picture")
    assert found["error"] == "UnpluggedError"
    assert "plug it in again" in found["text"]


def test_a_camera_that_falls_silent_is_told_from_one_that_is_gone(guest: Guest, one: VirtualSensor) -> None:
    one.inject(Faults(stall_after=10))
    found = guest.run("looking:watch", serial=ONE)
    assert found["error"] == "StalledError"
    assert "is there" in found["text"]


def test_a_stream_can_be_restarted_many_times(guest: Guest, one: VirtualSensor) -> None:
    for _ in range(6):
        guest.run("looking:stream", serial=ONE, options="format=MJPG", count=2)
    assert one.video.streams == 6
    assert not one.unplugged.is_set()


def test_the_firmware_answers_over_the_real_serial_driver(guest: Guest, bench: Bench) -> None:
    bench.plug("lit", 0)
    found = guest.run("commanding:converse", number=LIT)
    print(f"round trip {found['trip_ms']:.0f} ms")
    assert found["unique id"] == LIT, "the controller is the one that the device's serial number says"
    assert found["current_ma"] > 0
    assert found["damaged"] == 0


def test_what_the_ring_shows_is_what_the_camera_sees(guest: Guest, bench: Bench) -> None:
    bench.plug("lit", 0)
    found = guest.run("commanding:light_and_look", number=LIT, limit_s=60)
    assert max(found["dark"]) < 3
    for channel, name in enumerate(("red", "green", "blue")):
        others = [found[name][other] for other in range(3) if other != channel]
        assert found[name][channel] > max(30, 2 * max(others))
    assert max(found["closed"]) < 3, "a program that ends without a word leaves the LEDs dark"
