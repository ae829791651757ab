"""The faults that `tests.benchmarks.mutants` draws: of code alone, each another program."""

import ast
from pathlib import Path

import pytest

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
        "3: 7 -> (21)",
        "3: 7 -> (2)",
        "8: other -> (not (other))",
        "9: self.told = value + 1.5 > LIMIT and \"é\" in text -> pass",
        "9: value + 1.5 > LIMIT and \"é\" in text -> ((value + 1.5 > LIMIT) or ('é' in text))",
        "9: value + 1.5 > LIMIT -> ((value + 1.5) <= (LIMIT))",
        "9: value + 1.5 -> ((value) - (1.5))",
        "9: 1.5 -> (4.0)",
        "9: 1.5 -> (4.5)",
        "9: 1.5 -> (0.5)",
        "9: \"é\" in text -> (('é') not in (text))",
        "10: zip(told, other, strict=True) -> pass",
        "12: value < 0 -> ((value) >= (0))",
        "12: 0 -> (1)",
        "14: return not told -> return None",
        "14: not told -> (told)",
    ]  # fmt: skip


def test_each_room_has_an_equal_share_of_the_draw_as_far_as_it_has_places(tmp_path: Path) -> None:
    rooms = {"large": [tmp_path / "large.py"], "small": [tmp_path / "small.py"]}
    rooms["large"][0].write_text("\n".join(f"LIMIT_{number} = {number}" for number in range(9, 19)))
    rooms["small"][0].write_text("LIMITS = 7, 8, 9")
    drawn = [mutant.file.stem for mutant in draw(rooms, 6, 1)]
    assert drawn.count("large") == drawn.count("small") == 3
    all_of_them = draw(rooms, 99, 1)
    assert len({(mutant.file, mutant.begin) for mutant in all_of_them}) == len(all_of_them) == 13, "a place once"
