"""The command itself: its version, and how it ends."""

import importlib.metadata
import sys
from pathlib import Path

import pytest
import typer
from rich.text import Text

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli import main
from gellight.cli.lazy import LazyVerb
from gellight.cli.one_sensor import warn_of_foreign_bundle
from tests.helpers.children import run
from tests.helpers.command_line import invoke, verbs


def test_the_version_is_that_of_the_installed_package() -> None:
    result = invoke("--version")
    assert (result.exit_code, result.output) == (0, f"gellight {importlib.metadata.version('gellight')}\n")


ALL = list(verbs(typer.main.get_command(main.app)))
LAZY = [verb for group in ALL for verb in getattr(group, "commands", {}).values() if isinstance(verb, LazyVerb)]


@pytest.mark.parametrize("verb", LAZY, ids=lambda verb: verb.home)
def test_a_group_shows_of_a_verb_the_first_paragraph_of_its_help(verb: LazyVerb) -> None:
    assert " ".join(verb.load().help.split("\n\n")[0].split()) == verb.help


HEAVY = {"numpy", "cv2", "scipy", "onnxruntime", "aiohttp", "sim_reference", "zenoh", "mcap"}


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
    texts = [each.help for verb in ALL for each in (verb, *verb.params)]
    assert len(texts) > 100
    assert [text for text in texts if text and Text.from_markup(text).plain != text] == []


def test_an_error_of_ours_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> None:
        raise InputError("the gel is 5 mm: give 4 mm")

    monkeypatch.setattr(main, "app", refuse)
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
