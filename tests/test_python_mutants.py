"""The faults that `tests.benchmarks.mutants` draws: of code alone, each another program; which tests judge them."""

import ast
from pathlib import Path

import pytest

from tests.benchmarks.mutants import judges
from tests.helpers.places import CHECKOUT
from tests.helpers.python_mutants import draw, mutants_of

SOURCE = '''"""A module of 3 lines."""

LIMIT: int = 7


def judge(value: float, other: "float | None" = None) -> bool:
    """Return 1 of 2 answers."""
    if other:
        self.told = value + 1.5 > LIMIT and "é" in text
    zip(told, other, strict=True)
    logger.warning("%s is more than %d", value, 9)
    if value < 0:
        raise ValueError(f"{value} is below {0}")
    return not told
'''


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "module.py"
    path.write_text(SOURCE)
    return path


def test_every_mutant_is_another_program_and_none_is_in_text_for_people(file: Path) -> None:
    mutants = mutants_of(file)
    programs = {ast.dump(ast.parse(mutant.planted())) for mutant in mutants}
    assert len(programs) == len(mutants)
    assert ast.dump(ast.parse(SOURCE)) not in programs
    assert [str(mutant).removeprefix(f"{file}:") for mutant in mutants] == [
        "3: 7 -> (8)",
        "8: other -> (not (other))",
        "9: self.told = value + 1.5 > LIMIT and \"é\" in text -> pass",
        "9: value + 1.5 > LIMIT and \"é\" in text -> ((value + 1.5 > LIMIT) or ('é' in text))",
        "9: value + 1.5 > LIMIT -> ((value + 1.5) <= (LIMIT))",
        "9: value + 1.5 -> ((value) - (1.5))",
        "9: 1.5 -> (4.0)",
        "9: \"é\" in text -> (('é') not in (text))",
        "10: zip(told, other, strict=True) -> pass",
        "12: value < 0 -> ((value) >= (0))",
        "12: 0 -> (1)",
        "14: return not told -> return None",
        "14: not told -> (told)",
    ]  # fmt: skip


def test_a_seed_draws_the_same_mutants_again(file: Path) -> None:
    assert draw([file], 5, 1) == draw([file], 5, 1) != draw([file], 5, 2)


def test_a_file_is_judged_by_the_tests_that_import_it_its_own_first() -> None:
    tests = judges(CHECKOUT / "host/gellight/base/mailbox.py")
    assert tests[0] == "tests/host/base/test_mailbox.py"
    assert "tests/host/daemon/test_calibration_service.py" in tests
    assert judges(CHECKOUT / "host/gellight/cli/ring.py")[0] == "tests/host/cli/test_ring.py", "by the command line"
    typed = judges(CHECKOUT / "host/gellight/cli/selfcheck.py")
    assert typed[0] == "tests/host/cli/test_demo.py", "a verb by what types it"
    assert judges(CHECKOUT / "host/gellight/cli/calibrate/lens.py") == ["tests/host/cli/test_calibrate_lens.py"]
    of_its_users = judges(CHECKOUT / "host/gellight/recording/ros_messages.py")
    assert "tests/host/recording/test_recording_file.py" in of_its_users
    through_a_helper = judges(CHECKOUT / "host/gellight/lab/simulator/simulated_controls.py")
    assert "tests/host/daemon/test_installing_failures.py" in through_a_helper
    assert not any(test.startswith("tests/vm/") for test in tests + through_a_helper)
