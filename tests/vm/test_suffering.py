"""A few of the faults that `python -m tests.vm.machine.suffering` draws for as long as it is let."""

import pytest

from tests.virtual_usb.device import VirtualSensor
from tests.vm.machine.bench import ONE, Bench
from tests.vm.machine.qemu import Guest
from tests.vm.machine.suffering import SIZE, Shears, Suffering
from tests.vm.machine.tiny_bundle import tiny_bundle


@pytest.fixture(scope="module")
def suffering(guest: Guest, whole_bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Suffering:
    bundle = tmp_path_factory.mktemp("suffering") / "bundle"
    tiny_bundle(bundle, SIZE)
    return Suffering(guest, whole_bench, bundle, seed=7)


@pytest.mark.timeout(900)
@pytest.mark.parametrize("kind", ["cable pulled while it streams", "programs frozen", "computer stopped"])
def test_files_leds_message_and_the_next_start_stand_a_fault(suffering: Suffering, kind: str) -> None:
    suffering.one(kind)
    assert suffering.tallies[kind].broken == []


def test_shears_cut_at_the_transfer_they_are_told(guest: Guest, one: VirtualSensor) -> None:
    shears = Shears(one, 20)
    message = guest.run("looking:complaint", serial=ONE, options="format=MJPG")
    assert "unplugged" in message or "No such device" in message
    assert shears.count > 20
    assert one.unplugged.wait(15)
