"""The command itself: its version, its help in groups, what options of several verbs check, and how it ends."""

import importlib.metadata
import re
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from rich.text import Text
from typer.main import get_command

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli import main
from gellight.cli.lazy import MOST, PANELS, LazyVerb
from gellight.cli.main import app
from gellight.cli.one_sensor import warn_of_foreign_bundle
from gellight.cli.options import between
from tests.helpers.children import gellight, run
from tests.helpers.command_line import invoke, refused, verbs

VERBS = list(verbs(get_command(app)))
LAZY = [verb for group in VERBS for verb in getattr(group, "commands", {}).values() if isinstance(verb, LazyVerb)]
HEAVY = {"numpy", "cv2", "scipy", "onnxruntime", "aiohttp", "sim_reference", "zenoh", "mcap"}


def test_the_version_is_that_of_the_installed_package() -> None:
    result = invoke("--version")
    assert (result.exit_code, result.output) == (0, f"gellight {importlib.metadata.version('gellight')}\n")


@pytest.mark.parametrize("verb", LAZY, ids=lambda verb: verb.home)
def test_a_group_shows_of_a_verb_the_first_paragraph_of_its_help(verb: LazyVerb) -> None:
    assert " ".join(verb.load().help.split("\n\n")[0].split()) == verb.help


@pytest.mark.parametrize(
    ("arguments", "own"),
    [
        ("--help", HEAVY | {"pydantic"} | {f"gellight.cli.{name}" for name in ("demo", "ring", "calibrate")}),
        ("--version", HEAVY | {"pydantic"}),
        ("find --help", HEAVY),
        ("install-udev --help", HEAVY),
        ("config show", HEAVY),
        ("config --help", HEAVY),
        ("firmware --help", HEAVY),
        ("ring --help", HEAVY - {"numpy"}),
        *((f"{verb} --help", HEAVY - {"numpy"}) for verb in ("run", "demo", "record", "replay", "export", "scan")),
        *((f"{verb} --help", HEAVY - {"numpy"}) for verb in ("reconstruct", "surface", "selfcheck", "calibrate")),
        *((f"{verb} --help", HEAVY - {"numpy"}) for verb in ("simulate press", "optimize design")),
    ],
)
def test_a_verb_imports_only_what_it_needs(arguments: str, own: set[str], tmp_path: Path) -> None:
    code = (
        "import sys\nfrom gellight.cli.main import run\n"
        "try:\n    run()\nexcept SystemExit as end:\n    assert not end.code\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = run([sys.executable, "-c", code, *arguments.split()], cwd=tmp_path, check=True)
    imported = done.stderr.split()
    assert "gellight.cli.main" in imported
    assert own.isdisjoint(imported)


def test_the_help_of_every_option_is_shown_as_it_is_written() -> None:
    """Square brackets would be taken for markup and vanish, and a default that is told in them too."""
    texts = [each.help for verb in VERBS for each in (verb, *verb.params)]
    assert len(texts) > 100
    assert [text for text in texts if text and Text.from_markup(text).plain != text] == []


def test_an_error_of_ours_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(main, "app", Mock(side_effect=InputError("the gel is 5 mm: give 4 mm")))
    monkeypatch.setattr("signal.signal", lambda number, handler: None)
    with pytest.raises(SystemExit) as end:
        main.run()
    assert end.value.code == 2
    assert capsys.readouterr().err == "gellight: the gel is 5 mm: give 4 mm\n"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"sensor.url": "sim://"}, ""),
        (
            {"sensor.url": "sim://", "geometry.gel_thickness_mm": 3.0},
            "default sensor, the settings change its gel_thick",
        ),
        ({"sensor.url": "sim://", "geometry.gel_thickness_mm": 3.0, "sensor.calibration": "mine"}, ""),
        *(({"sensor.url": url}, "of the simulated sensor: calibrate yours") for url in ("auto", "/dev/video0")),
    ],
)
def test_the_bundle_of_another_sensor_is_told(
    settings: dict[str, object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = load_bundle("synthetic")
    if "sensor.calibration" in settings:
        bundle = bundle.with_reference(bundle.reference + 0.5, frames=1)
    warn_of_foreign_bundle(bundle, load_settings(settings))
    told = capsys.readouterr().err
    assert words in told
    assert bool(told) == bool(words)


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
    options = [option for verb in VERBS for option in verb.params]
    numbers = [one for one in options if re.search(r"\b(int|float)\b", str(one.type_descriptor.annotation))]
    assert len(numbers) > 100
    for option in numbers:
        with pytest.raises(InputError, match=re.escape(f"{option.opts[-1]} {typed} is not possible: give a number")):
            option.process_value(None, [typed] if option.multiple or option.nargs != 1 else typed)


@pytest.mark.parametrize("verb", [("export", "a.mcap", "--out", "b"), ("calibrate",), ("doctor",)])
def test_an_empty_text_is_refused_but_for_what_may_be_empty(verb: tuple[str, ...]) -> None:
    option = {"export": ["--calibration", ""], "calibrate": ["--like", ""], "doctor": [""]}[verb[0]]
    assert "'' is empty: give it a value, or leave it out" in refused(invoke(*verb, *option))


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.name)
def test_the_first_group_of_every_verb_is_short(verb: Any) -> None:
    options = [one for one in verb.params if one.param_type_name == "option" and one.name != "help"]
    groups = Counter(one.rich_help_panel for one in options)
    assert groups[None] <= MOST, [one.opts for one in options if one.rich_help_panel is None]


def test_every_option_of_the_table_is_there() -> None:
    known = {option.lstrip("-") for verb in VERBS for one in verb.params for option in one.opts}
    named = {entry.rpartition("/")[2] for options in PANELS.values() for entry in options.split()}
    assert named <= known
    verbs_named = {entry.partition("/")[0] for options in PANELS.values() for entry in options.split() if "/" in entry}
    assert verbs_named <= {verb.name for verb in VERBS}


def test_the_help_prints_the_groups() -> None:
    said = gellight("calibrate", "--help", check=True).stdout
    first, _, rest = said.partition(" Files ")
    assert "--ball-radius-mm" in first
    assert "--resume" not in first
    assert "--resume" in rest
