"""`gellight simulate demo`: then the demo by finite elements finds its presses."""

import json
from pathlib import Path

import pytest

from gellight.lab.simulator import stage
from gellight.lab.simulator.scene import Press
from gellight.opening import open_camera
from sim_reference.deformation import NotConverged
from sim_reference.fem.gel import FemGel
from sim_reference.objects import OBJECT_NAMES
from tests.helpers.command_line import invoke

pytestmark = pytest.mark.nightly
COMMAND = ["simulate", "demo", "--resolution-mm", "2", "--workers", "1", "--json"]


@pytest.fixture(autouse=True)
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache of the test's own, and a demo that does little."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(stage, "PROGRAMME", (Press("BALL", 0.5, 3.0, 0.0),))
    monkeypatch.setattr(stage, "OBJECT_NAMES", ("BALL", "SCROWN"))


def failing(*given, **options):  # type: ignore[no-untyped-def]
    raise NotConverged("100 steps were not enough")


def test_the_demo_finds_what_was_pressed_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    result = invoke(*COMMAND)
    assert result.exit_code == 0, result.output
    made = json.loads(result.stdout)
    assert made["presses"] == 7, "five depths of the programme's ball, and both objects as the page offers them"
    assert made["not_found"] == []
    assert len(list(Path(made["folder"]).glob("*.npz"))) == 7
    monkeypatch.setattr(FemGel, "press", failing)
    with open_camera("sim://?board=0&gel=fem&resolution=2&object=SCROWN&depth=0.8") as camera:
        truth = camera.read().truth
    assert truth.depth_mm.max() > 0.7
    assert invoke(*COMMAND).exit_code == 0, "what is kept is not computed again"


def test_what_is_not_found_is_said_and_does_not_end_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FemGel, "press", failing)
    result = invoke(*COMMAND)
    assert result.exit_code == 1
    made = json.loads(result.stdout)
    assert made["presses"] == 0
    assert len(made["not_found"]) == 7
    assert made["not_found"][0] == "BALL 0.1 mm: 100 steps were not enough"
    monkeypatch.undo()
    assert len(stage.presses_of_the_demo()) == len(OBJECT_NAMES) + 27


def test_a_mesh_that_does_not_fit_is_refused() -> None:
    result = invoke("simulate", "demo", "--resolution-mm", "0.1", "--workers", "100")
    assert "in each of 100 --workers needs about" in str(result.exception)
