"""The light ring of the virtual sensor: the real serial driver in the guest, the real firmware in the emulator here."""

from tests.vm.machine.bench import LIT, Bench
from tests.vm.machine.qemu import Guest


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
