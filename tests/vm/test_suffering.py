"""A few of the faults that `python -m tests.vm.machine.suffering` draws for as long as it is let."""

import pytest

from tests.vm.machine.bench import Bench
from tests.vm.machine.qemu import Guest
from tests.vm.machine.suffering import SIZE, Suffering
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
