"""The command itself: its version, and how it ends."""

import importlib.metadata

import pytest
from typer.testing import CliRunner

from gellight.cli import main
from gellight.errors import InputError


def test_the_version_is_that_of_the_installed_package() -> None:
    result = CliRunner().invoke(main.app, ["--version"])
    assert (result.exit_code, result.output) == (0, f"gellight {importlib.metadata.version('gellight')}\n")


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
