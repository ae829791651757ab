"""One guest for all checks, and sensors to plug into it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.virtual_usb.device import VirtualSensor, open_virtual
from tests.vm.machine.bench import FINE, LIT, ONE, TWO, Bench, sized
from tests.vm.machine.packages import Missing
from tests.vm.machine.qemu import Guest, booted


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.vm)


@pytest.fixture(scope="session")
def guest(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guest]:
    try:
        with booted(tmp_path_factory.mktemp("guest")) as guest:
            yield guest
    except Missing as finding:
        pytest.skip(str(finding))


@pytest.fixture(scope="session")
def whole_bench(guest: Guest) -> Iterator[Bench]:
    def steady(serial: str) -> VirtualSensor:
        url = "sim://?board=0&programme=0&object=BALL&depth=1.0"
        return open_virtual(url, serial_number=serial, geometry=sized(160, 120))

    lit = open_virtual(
        "sim://?programme=0&object=BALL&depth=1.0&x=2.0&y=1.0", serial_number=LIT, geometry=sized(80, 60)
    )
    fine = open_virtual("sim://?programme=0", serial_number=FINE, geometry=sized(320, 240))
    sensors = {"one": steady(ONE), "two": steady(TWO), "lit": lit, "fine": fine}
    with Bench(guest, sensors) as bench:
        yield bench


@pytest.fixture
def bench(whole_bench: Bench) -> Iterator[Bench]:
    """The workbench, with every cable pulled after the test."""
    yield whole_bench
    whole_bench.clear()


@pytest.fixture
def one(bench: Bench) -> VirtualSensor:
    """A sensor in port 0 of the guest."""
    bench.plug("one", 0)
    return bench.sensors["one"]
