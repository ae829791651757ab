"""The command itself: its version, its help in groups, what options of several verbs check, and how it ends."""

import importlib.metadata
import json
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer
from pydantic import BaseModel
from typer.main import get_command

import gellight
from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli import showing
from gellight.cli.lazy import open_group
from gellight.cli.main import app
from gellight.cli.one_sensor import warn_of_foreign_bundle
from gellight.cli.options import between
from gellight.cli.showing import progress, show
from tests.helpers import children
from tests.helpers.command_line import invoke, refused, verbs
from tests.helpers.waiting import eventually

VERBS = list(verbs(get_command(app)))
HEAVY = {"numpy", "cv2", "scipy", "onnxruntime", "aiohttp", "sim_reference", "zenoh", "mcap"}


def test_the_version_is_that_of_the_package_and_a_flag_takes_no_value() -> None:
    assert gellight.__version__ == importlib.metadata.version("gellight")
    result = invoke("--version")
    assert (result.exit_code, result.output) == (0, f"gellight {gellight.__version__}\n")
    flags = [option for verb in VERBS for option in verb.params if getattr(option, "is_flag", False)]
    assert len(flags) > 40
    assert "<bool>" not in "".join(invoke(*words.split()).output for words in ("--help", "calibrate --help"))
    assert {option.display_type_rich(None) for option in flags} == {None}


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("export a.mcap --out b --as obj", "'obj' is not one of 'npz', 'png', 'ply', 'video', 'hdf5', 'lerobot'."),
        ("export a.mcap --out b --every 0", "'0' is not allowed: give a number at least 1"),
        ("run --frames x", "'x' is not allowed: give a whole number"),
    ],
)
def test_a_value_is_refused_in_our_words(words: str, why: str) -> None:
    shown = " ".join(invoke(*words.split()).output.replace("│", " ").split())
    assert f"Invalid value for '{words.split()[-2]}': {why}" in shown


NO_PYDANTIC = HEAVY | {"pydantic"}
NEEDS = {
    "--help": NO_PYDANTIC | {f"gellight.cli.{name}" for name in ("demo", "ring", "calibrate")},
    "--version": NO_PYDANTIC,
    **dict.fromkeys(
        ("find --help", "install-udev --help", "config show", "config --help", "firmware --help"), HEAVY
    ),
    **{
        f"{verb} --help": HEAVY - {"numpy"}
        for verb in (
            "ring", "run", "demo", "record", "export", "scan", "reconstruct", "surface",
            "calibrate", "simulate press", "optimize design",
        )
    },
}  # fmt: skip
"""what a command does not import"""
IMPORTS = """import json, os, sys
from gellight.cli.main import run
for words in sys.argv[1:]:
    if os.fork() == 0:
        sys.argv = ["gellight", *words.split()]
        out, sys.stdout = sys.stdout, open(os.devnull, "w")
        try:
            run()
        except SystemExit as end:
            assert not end.code
        print(json.dumps([words, list(sys.modules)]), file=out, flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
"""


def test_a_verb_imports_only_what_it_needs(tmp_path: Path) -> None:
    done = children.run([sys.executable, "-c", IMPORTS, *NEEDS], cwd=tmp_path, check=True)
    imported = dict(map(json.loads, done.stdout.splitlines()))
    assert set(imported) == set(NEEDS)
    assert {words: found for words, own in NEEDS.items() if (found := own.intersection(imported[words]))} == {}


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


def test_a_value_between_the_bounds_is_taken_and_one_beyond_them_refused() -> None:
    check = between(0, 2, "s")
    option: Any = SimpleNamespace(name="dwell_s")
    assert [check(option, value) for value in (0, 1.5, 2)] == [0, 1.5, 2]
    for value in (-0.1, 2.1, float("inf"), float("nan")):
        with pytest.raises(InputError, match=rf"--dwell-s {value:g} is not possible: give 0 to 2 s"):
            check(option, value)


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


@pytest.mark.parametrize("typed", ["nan", "inf", "-inf", "1e300", "1000000001", "-1000000001"])
def test_no_verb_takes_a_number_that_nothing_can_have(typed: str) -> None:
    options = [option for verb in VERBS for option in verb.params]
    numbers = [one for one in options if re.search(r"\b(int|float)\b", str(one.type_descriptor.annotation))]
    assert len(numbers) > 70
    for option in numbers:
        with pytest.raises(InputError, match=re.escape(f"{option.opts[-1]} {typed} is not possible: give a number")):
            option.process_value(None, [typed] if option.multiple or option.nargs != 1 else typed)


@pytest.mark.parametrize("verb", [("export", "a.mcap", "--out", "b"), ("calibrate",), ("doctor",)])
def test_an_empty_text_is_refused_but_for_what_may_be_empty(verb: tuple[str, ...]) -> None:
    option = {"export": ["--calibration", ""], "calibrate": ["--like", ""], "doctor": [""]}[verb[0]]
    assert "'' is empty: give it a value, or leave it out" in refused(invoke(*verb, *option))


def test_a_verb_that_is_not_here_is_named_with_its_remedy() -> None:
    known = typer.Typer(cls=open_group({}, {"weigh": "comes with gellight_weigh", "scan": "is never missed"}))
    known.callback()(lambda: None)
    with pytest.raises(InputError, match=r"the verb `weigh` comes with gellight_weigh"):
        get_command(known).main(["weigh", "--help"], standalone_mode=False)
    assert {"optimize", "scan"} <= set(get_command(known).commands), "by the entry points of those that are here"


@pytest.mark.parametrize(
    ("typed", "now"),
    [
        ("replay press.mcap", "`gellight run FILE`"),
        ("sim", "--url sim://"),
        ("selfcheck", "`python -m tests.benchmarks.selfcheck`"),
        ("calibrate starter", "`fit --like`"),
        ("calibrate synthetic", "`python -m tests.helpers.simulated_bundle`"),
        ("ring group 0-2", "`gellight ring set COLOUR --leds 0-3,8`"),
        ("ring off", "`gellight ring set off`"),
        ("ring sequence", "`gellight run --set lighting.sequence=rgb`"),
        ("config path", "`gellight config show`"),
        ("demo --mode photometric", "give --set reconstruction.mode=VALUE"),
        ("run --host=0.0.0.0", "give --set dashboard.host=VALUE"),
        ("run --port 8421", "give --set dashboard.port=VALUE"),
        ("record --enabled false", "is the setting watch.enabled or tracking.enabled or stream.enabled"),
        ("calibrate force forces.csv --gel-thickness-mm 5", "the setting geometry.gel_thickness_mm: write it into"),
        ("demo --set stream.lan", "--set 'stream.lan' sets nothing: write SECTION.KEY=VALUE"),
        ("demo --set lan=true", "--set 'lan=true' sets nothing"),
        ("demo --set stream.lan=maybe", "the command line: stream.lan = 'maybe' is not allowed"),
        ("run press.mcap --sensor sim://", "start it for each, their pages list all"),
        ("run --sensor sim:// --sensor v4l2:///dev/video9", "start it for each, their pages list all"),
    ],
)
def test_what_was_typed_before_or_cannot_be_is_answered_with_what_is_typed(typed: str, now: str) -> None:
    assert now in refused(invoke(*typed.split()))


# ---- results of verbs, for people and for programs ----


@dataclass(frozen=True)
class Part:
    depth_mm: float
    error: str | None = None


class Kept(BaseModel):
    name: str


class Figures:
    def as_json(self) -> dict[str, object]:
        return {"parts": (Part(1.5),)}


@pytest.mark.parametrize(
    ("result", "told"),
    [
        ({"a": [Part(0.5, "no")]}, {"a": [{"depth_mm": 0.5, "error": "no"}]}),
        ([Kept(name="it")], [{"name": "it"}]),
        (Figures(), {"parts": [{"depth_mm": 1.5, "error": None}]}),
    ],
)
def test_programs_get_one_line_of_json(result: object, told: object, capsys: pytest.CaptureFixture[str]) -> None:
    show(result, True, "for people")
    shown = capsys.readouterr().out
    assert json.loads(shown) == told
    assert shown.count("\n") == 1


@pytest.mark.parametrize(
    ("result", "text", "shown"),
    [(Part(0.5), None, "depth_mm  0.5\n"), ({"a": 1, "of": 2}, None, "a   1\nof  2\n"), (Part(0.5), "deep", "deep\n")],
)
def test_people_get_text_or_a_table(
    result: object, text: str | None, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    show(result, False, text)
    assert capsys.readouterr().out == shown


def test_what_json_does_not_know_is_an_error_and_not_a_guess() -> None:
    strange: Any = object()
    with pytest.raises(TypeError, match="cannot be shown as JSON"):
        show({"it": strange}, True)


def test_a_log_has_a_line_now_and_then_and_first_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[str] = []

    def told(words: str) -> bool:
        shown.append(capsys.readouterr().err)
        return words in "".join(shown)

    with progress("training") as tell:
        tell(1, 2, 0.25)
    assert capsys.readouterr() == ("", ""), "what ends within ten seconds needs none"
    monkeypatch.setattr(showing, "LOG_S", 0.2)
    with progress("training", "a minute") as tell:
        tell(3, 40, 0.25)
        eventually(lambda: told("3 of 40"))
        tell(None, None, "step 3")
        eventually(lambda: told("step 3"))
    first, second, *_, last = "".join(shown).splitlines()
    assert first == "training: takes a minute"
    assert re.fullmatch(r"training, 3 of 40 \(\d+ s\)", second)
    assert last.startswith("training: step 3, 3 of 40 (")
