"""`gellight calibrate` without a verb: what it refuses before it does anything, and what its screen says."""

import io
import json
from dataclasses import fields
from pathlib import Path
from queue import SimpleQueue

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.cli.calibrate.routine_options import Target, Tools
from gellight.cli.calibrate.screen import _read_lines, obey, screen
from gellight.frames.picture import PictureSteps, chosen_steps, steps_in
from gellight.frames.view import View
from gellight.lab.calibration.choices import ToolSizes
from gellight.lab.calibration.display import Display, Progress
from gellight.lab.calibration.records import BallPresses, Coverage, ShownCircle
from tests.helpers.begun_calibration import begun_in, identity
from tests.helpers.children import gellight
from tests.helpers.command_line import invoke
from tests.helpers.dotted import sloping_gel, with_dots
from tests.helpers.scripted_camera import ScriptedCamera


def refused(*arguments: str) -> str:
    """The reason why the verb does not begin, in this process."""
    result = invoke("calibrate", *arguments)
    assert isinstance(result.exception, InputError | CameraError), result.output
    return str(result.exception)


def test_an_interrupted_calibration_is_not_thrown_away_unasked_and_none_cannot_go_on(tmp_path: Path) -> None:
    begun_in(tmp_path / "x.state")
    assert "give --resume to go on, or --restart" in refused("--auto", "--out", str(tmp_path / "x"))
    assert (tmp_path / "x.state/state.json").is_file()
    done = gellight("calibrate", "--auto", "--resume", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "gellight: there is no interrupted calibration in calibration.state: leave --resume out, or give its --out"
    )


def test_tools_are_those_a_calibration_was_begun_with_or_those_of_a_preset(tmp_path: Path) -> None:
    assert Tools(cylinder_diameter_mm=6.0).chosen(None) == ToolSizes(cylinder_diameter_mm=6.0)
    assert set(ToolSizes.model_fields) == {field.name for field in fields(Tools)} - {"preset"}
    begin = identity(ball_mm=2.5, cylinder_mm=6.0)
    out = tmp_path / "x"
    begun_in(tmp_path / "x.state", begin)
    assert Target(out=out, restart=True).begun() is None
    assert Target(out=out, resume=True).begun() == begin
    given = ToolSizes(ball_radius_mm=3.0, cylinder_diameter_mm=6.0)
    assert Tools(ball_radius_mm=3.0).chosen(begin) == given
    assert Tools(preset="gelsight-mini").chosen(None) == ToolSizes(ball_radius_mm=2.35)
    assert Tools(preset="gelsight-mini", ball_radius_mm=3.0).chosen(None) == ToolSizes(ball_radius_mm=3.0)
    assert Tools(preset="digit", pixel_size_mm=0.06).chosen(None) == ToolSizes(pixel_size_mm=0.06)
    assert Tools(preset="9dtact").chosen(identity(ball_mm=2.5)).ball_radius_mm == 2.5
    assert "did you mean digit?" in refused("--auto", "--preset", "digits")


def gel() -> np.ndarray:
    return sloping_gel((120, 160))


@pytest.mark.parametrize(("with_view", "dots"), [(True, False), (False, True), (True, True)])
def test_the_routine_sees_the_view_without_the_dots_and_keeps_both_for_the_bundle(
    tmp_path: Path, with_view: bool, dots: bool
) -> None:
    view = View.of_box((16, 16, 128, 96), (120, 160))
    (tmp_path / "view.json").write_text(view.model_dump_json())
    target = Target(dots=dots, view=tmp_path / "view.json" if with_view else None)
    camera = target.camera(ScriptedCamera(with_dots(gel()) if dots else gel()))
    plain = gel()[16:112, 16:144] if with_view else gel()
    assert camera.image_shape == plain.shape[:2]
    off_grey = np.abs(camera.read().image.astype(int) - plain).max()
    assert off_grey <= (5 if dots else 1), "a dot is 80 levels darker"
    kept = PictureSteps.model_validate_json(camera.bundle_files["picture.json"])
    assert (kept.view, kept.dots is not None) == (view if with_view else None, dots)


def test_an_interrupted_calibration_goes_on_with_its_own_view_and_dots(tmp_path: Path) -> None:
    """Dots that are looked for anew, in another picture, would be a little different ones."""
    view = View.of_box((16, 16, 128, 96), (120, 160))
    steps = chosen_steps(ScriptedCamera(with_dots(gel())), view, dots=True)
    begun = identity().model_copy(update={"picture": steps})
    camera = Target(resume=True).camera(ScriptedCamera(gel()), begun)
    assert steps_in(camera.bundle_files) == steps
    (tmp_path / "view.json").write_text(View.of_box((0, 0, 128, 96), (120, 160)).model_dump_json())
    with pytest.raises(InputError, match=r"takes another view than .*leave --view out"):
        Target(resume=True, view=tmp_path / "view.json").camera(ScriptedCamera(gel()), begun)
    undotted = identity().model_copy(update={"picture": PictureSteps.with_view(view)})
    with pytest.raises(InputError, match="fills no marker dots: leave --dots out"):
        Target(resume=True, dots=True).camera(ScriptedCamera(gel()), undotted)


def test_restarting_throws_away_no_folder_of_another_program(tmp_path: Path) -> None:
    place = tmp_path / "x.state"
    place.mkdir()
    (place / "state.json").write_text(json.dumps({"tabs": [], "finished": False}))
    (place / "diary.txt").write_text("mine")
    for how in ("--restart", "--resume"):
        assert "is not the state of a calibration" in refused("--auto", how, "--out", str(tmp_path / "x"))
    assert sorted(path.name for path in place.iterdir()) == ["diary.txt", "state.json"]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (["--ball-radius-mm", "-1"], "ball_radius_mm = -1.0"),
        (["--pixel-size-mm", "50"], "at least 0.001 and at most 1"),
        (["--recipe", "slow"], "recipe 'slow': give one of fast, thorough, fine, paper"),
    ],
)
def test_wrong_options_are_told_before_anything_is_opened(tmp_path: Path, wrong: list[str], told: str) -> None:
    assert told in refused("--auto", "--out", str(tmp_path / "x"), *wrong)
    assert list(tmp_path.iterdir()) == []


class Recorder:
    """Stands for a routine: keeps what it is asked, and refuses to accept."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, float]]] = []

    def act(self, action: str, **arguments: float) -> None:
        if action == "accept":
            raise InputError("accept is not possible now")
        self.asked.append((action, arguments))


def test_typed_keys_become_actions_and_refusals_are_shown() -> None:
    routine = Recorder()
    assert [obey(routine, line) for line in ("n", "", "d", "c 10 20.5 7", "q")] == [""] * 5  # type: ignore[arg-type]
    circle = {"center_x_px": 10.0, "center_y_px": 20.5, "contact_radius_px": 7.0}
    names = [action for action, _ in routine.asked]
    assert names == ["next", "next", "drop", "correct", "abort"]
    assert routine.asked[3][1] == circle
    assert obey(routine, "a") == "accept is not possible now"  # type: ignore[arg-type]
    assert obey(routine, "c 10 20") != ""  # type: ignore[arg-type]
    assert obey(routine, "c ten") != ""  # type: ignore[arg-type]


def test_a_keyboard_that_is_closed_stops_the_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    typed: SimpleQueue[str] = SimpleQueue()
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    _read_lines(typed)
    assert [typed.get(), typed.get()] == ["n\n", "q"]
    assert typed.empty()


def test_the_screen_shows_the_step_the_circle_the_map_and_the_advice() -> None:
    from rich.console import Console

    shown = Display()
    coverage = Coverage.model_construct(places=[[0, 1], [12, 0]])
    shown.add_figures(BallPresses.model_construct(coverage=coverage))
    circle = ShownCircle(center_x_px=10.0, center_y_px=20.0, contact_radius_px=7.5, state="taken")
    shown.begin_step("presses")
    shown.update(progress=Progress(done=3, wanted=40, unit="presses"), awaiting="lift", press=circle)
    shown.update(instruction="Press the ball.", advice="12 more presses on the left edge", problem="it moved")
    console = Console(record=True, width=100)
    console.print(screen(shown.shown, "", keys=True))
    text = console.export_text()
    for words in ("● prepare", "◐ presses", "3 of 40 presses", "10.0, 20.0, 7.5 px (taken)", "· 1", "9 ·", "lift"):
        assert words in text
    assert "12 more presses on the left edge" in text
    assert "it moved" in text
