"""The tests are tested: firmware with one fault each, and a short check that has to notice it.

Mutants of the board are built and run in the emulator under `examine`; mutants of the portable core run the tests of
the core against a library built from the changed sources.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware.tools.build import build
from tests.firmware.helpers.core_tests import CoreTests
from tests.firmware.helpers.examination import CHECKS, examine
from tests.firmware.helpers.mutations import ENABLES, IMAGE, LOGIC, Mutation, planted
from tests.firmware.helpers.virtual_board import compile_library

DAILY = 12
"""one in that many faults of the core is planted by day, all at night; those of the image need their compiler"""


@pytest.mark.parametrize("check", CHECKS)
def test_the_committed_image_passes_the_examination(image: bytes, check: str) -> None:
    assert examine(image, check) == []


@pytest.mark.nightly
@pytest.mark.parametrize("mutation", IMAGE + ENABLES, ids=lambda m: m.name)
def test_a_fault_of_the_image_is_caught(mutation: Mutation, copied_firmware: Path) -> None:
    with planted(mutation, copied_firmware) as checkout:
        faulty = build(checkout)
    assert examine(faulty, mutation.check) != []


@pytest.fixture(scope="module")
def core_tests() -> Iterator[CoreTests]:
    with CoreTests() as tests:
        yield tests


def test_the_core_without_a_fault_passes(core_tests: CoreTests, copied_firmware: Path, tmp_path: Path) -> None:
    """So that what catches a mutant is its fault, and nothing in the way its tests are run."""
    done = core_tests.run(compile_library(tmp_path / "core.so", "undefined", checkout=copied_firmware))
    assert done.status == 0, done.printed[-2000:]


@pytest.mark.parametrize(
    "mutation",
    [pytest.param(m, marks=[pytest.mark.nightly] if number % DAILY else []) for number, m in enumerate(LOGIC)],
    ids=lambda m: m.name,
)
def test_a_fault_of_the_core_is_caught(
    mutation: Mutation, core_tests: CoreTests, copied_firmware: Path, tmp_path: Path
) -> None:
    with planted(mutation, copied_firmware) as checkout:
        library = compile_library(tmp_path / "core.so", "undefined", checkout=checkout)
    done = core_tests.run(library)
    assert done.status == 1, f"survived, or could not be tested: {done.printed[-2000:]}"
    assert "\nERROR " not in done.printed, f"a test did not even begin: {done.printed[-2000:]}"
