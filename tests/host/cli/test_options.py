"""What the options of several verbs check."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from gellight.base.errors import InputError
from gellight.cli.options import between
from tests.helpers.command_line import invoke, refused


def test_a_value_between_the_bounds_is_taken_as_it_is() -> None:
    check = between(0, 2, "s")
    assert [check(SimpleNamespace(name="seconds"), value) for value in (0, 1.5, 2)] == [0, 1.5, 2]


@pytest.mark.parametrize("value", [-0.1, 2.1, float("inf"), float("nan")])
def test_a_value_beyond_them_is_refused_with_what_is_possible(value: float) -> None:
    with pytest.raises(InputError, match=rf"--dwell-s {value:g} is not possible: give 0 to 2 s"):
        between(0, 2, "s")(SimpleNamespace(name="dwell_s"), value)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("scan", ""), "FOLDER ''"),
        (("surface", "map.npz", "--out", "a.png", "--out", ""), "--out ''"),
        (("simulate", "press", "--object", "BALL", "--depth-mm", "1", "--out="), "--out ''"),
    ],
)
def test_a_path_without_a_name_is_refused_and_this_folder_is_left_alone(
    arguments: tuple[str, ...], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert f"{named} names no file" in refused(invoke(*arguments))
    assert not list(tmp_path.iterdir())
