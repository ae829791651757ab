"""What the options of several verbs check."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.main import get_command

from gellight.base.errors import InputError
from gellight.cli.main import app
from gellight.cli.options import between
from tests.helpers.command_line import invoke, refused, verbs


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


@pytest.mark.parametrize("typed", ["nan", "inf", "-inf", "1e300", "99999999999999999999"])
def test_no_verb_takes_a_number_that_nothing_can_have(typed: str) -> None:
    options = [option for verb in verbs(get_command(app)) for option in verb.params]
    numbers = [one for one in options if re.search(r"\b(int|float)\b", str(one.type_descriptor.annotation))]
    assert len(numbers) > 100
    for option in numbers:
        with pytest.raises(InputError, match=re.escape(f"{option.opts[-1]} {typed} is not possible: give a number")):
            option.process_value(None, [typed] if option.multiple or option.nargs != 1 else typed)


@pytest.mark.parametrize("verb", [("export", "a.mcap", "--out", "b"), ("calibrate",), ("doctor",)])
def test_an_empty_text_is_refused_but_for_what_may_be_empty(verb: tuple[str, ...]) -> None:
    option = {"export": ["--calibration", ""], "calibrate": ["--like", ""], "doctor": [""]}[verb[0]]
    assert "'' is empty: give it a value, or leave it out" in refused(invoke(*verb, *option))
