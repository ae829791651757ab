"""A cable that is pulled, a camera that falls silent, and another port."""

from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.faults import Faults
from tests.vm.machine.bench import LIT, ONE, Bench
from tests.vm.machine.qemu import Guest


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


def test_a_serial_port_that_is_gone_is_told(guest: Guest, bench: Bench) -> None:
    bench.plug("lit", 0)
    holding = guest.start("commanding:hold_ring", number=LIT)
    holding.event("open")
    bench.unplug("lit", aside=True)
    assert holding.result()["error"] == "SerialException"


def test_the_same_sensor_is_found_by_the_same_link_at_another_port(guest: Guest, bench: Bench) -> None:
    bench.plug("one", 0)
    bench.unplug("one")
    found = bench.plug("one", 5)
    print(f"links {found['seconds']:.2f} s after the replug")
    assert guest.run("looking:stream", serial=ONE, options="format=MJPG", count=3)["mode"].startswith("MJPG")
    assert guest.run("commanding:identity", number=ONE)["camera parent"] == "1-6"


def test_a_stream_can_be_restarted_many_times(guest: Guest, one: VirtualSensor) -> None:
    for _ in range(6):
        guest.run("looking:stream", serial=ONE, options="format=MJPG", count=2)
    assert one.video.streams == 6
    assert not one.unplugged.is_set()
