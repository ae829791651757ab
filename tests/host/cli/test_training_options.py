"""`--trainer`: one that is not installed is refused before anything is read or pressed."""

import sys
from pathlib import Path

import pytest
from typer.main import get_command

from gellight.cli.main import app
from tests.helpers.command_line import invoke, refused, verbs

BALL = "--ball-radius-mm 4 --pixel-size-mm 0.1"
RECORDED = f"--presses none.csv --reference none.png {BALL}"
ASKED = {
    "calibrate": "--auto --sensor none",
    "fit": f"{RECORDED} --out new",
    "channels": f"--sensor none --sequence rgb {BALL} --out new",
}
"""of files and sensors that are not there: who looks for them first is refused for another reason"""


def test_every_verb_with_a_trainer_is_among_them() -> None:
    assert {verb.name for verb in verbs(get_command(app)) for one in verb.params if "--trainer" in one.opts} == {*ASKED}


@pytest.mark.parametrize("trainer", ["torch", "cuda"])
@pytest.mark.parametrize("verb", ASKED)
def test_a_trainer_that_is_not_installed_is_refused_before_any_work(
    verb: str, trainer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.chdir(tmp_path)
    words = ["calibrate", *([] if verb == "calibrate" else [verb]), *ASKED[verb].split(), "--trainer", trainer]
    assert "PyTorch" in refused(invoke(*words))
    assert list(tmp_path.iterdir()) == []
