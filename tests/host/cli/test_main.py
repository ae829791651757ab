"""The command itself: its version, and how it ends."""

import importlib.metadata
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from rich.text import Text
from typer.testing import CliRunner

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.cli import main
from gellight.cli.run import warn_of_foreign_bundle


def test_the_version_is_that_of_the_installed_package() -> None:
    result = CliRunner().invoke(main.app, ["--version"])
    assert (result.exit_code, result.output) == (0, f"gellight {importlib.metadata.version('gellight')}\n")


def verbs(command: Any) -> Iterator[Any]:
    yield command
    for name in getattr(command, "commands", {}):
        yield from verbs(command.commands[name])


def test_the_help_of_every_option_is_shown_as_it_is_written() -> None:
    """Square brackets would be taken for markup and vanish, and a default that is told in them too."""
    found = list(verbs(typer.main.get_command(main.app)))
    texts = [each.help for verb in found for each in (verb, *verb.params)]
    assert len(texts) > 100
    assert [text for text in texts if text and Text.from_markup(text).plain != text] == []


def test_an_error_of_ours_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse() -> None:
        raise InputError("the gel is 5 mm: give 4 mm")

    monkeypatch.setattr(main, "app", refuse)
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
            "paper's sensor, the settings change its gel_thick",
        ),
        ({"sensor.url": "sim://", "geometry.gel_thickness_mm": 3.0, "sensor.calibration": "mine"}, ""),
        ({"sensor.url": "auto"}, "of the simulated sensor: calibrate yours"),
    ],
)
def test_the_bundle_of_another_sensor_is_told(
    settings: dict[str, object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    warn_of_foreign_bundle(load_settings(settings))
    told = capsys.readouterr().err
    assert words in told
    assert bool(told) == bool(words)
