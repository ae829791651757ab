"""A prism of known angle verifies beside the ball: by the virtual hand, by a user, and what is refused."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.lab.calibration.records import PrismErrors, ShownEdge
from gellight.lab.calibration.routine import Routine
from gellight.lab.simulator.stage import Stage
from gellight.lab.simulator.virtual_hand import PRISM_DEPTHS_MM, VirtualHand, prism_of
from tests.helpers.calibration_routine import LIT, camera, finished, wait_for, whole


def before_the_prism(calibrated: tuple[Path, dict[str, Any]], folder: Path, angle_deg: float = 15.0) -> Path:
    """The state as it was when the balls had judged."""
    shutil.copytree(calibrated[0] / "state", folder / "state")
    place = folder / "state/state.json"
    state = json.loads(place.read_text())
    state["identity"]["prism_angle_deg"] = angle_deg
    place.write_text(json.dumps({**state, "finished": False, "prisms": []}))
    return folder / "state"


def test_the_virtual_hand_verifies_with_a_prism_too(calibrated: tuple[Path, dict[str, Any]]) -> None:
    folder, snapshot = calibrated
    prism = snapshot["figures"]["verify"]["prism"]
    assert (prism["presses"], prism["angle_deg"]) == (2, 15)
    assert prism["felt_deg"] == pytest.approx(15, abs=0.7)
    assert prism["normal_deg"] < 2
    assert prism["depth_mm"] < 0.04
    assert snapshot["verdict"]["passed"]
    assert "2 presses of the prism of 15 degrees: it feels like" in snapshot["verdict"]["text"]
    assert ShownEdge.model_validate(snapshot["press"]).state == "checked"
    bundle = load_bundle(folder / "bundle")
    assert bundle.metrics["verification"]["prism"] == prism
    report = bundle.files["report.html"].decode()
    assert "Verification by a prism" in report
    assert "on the faces of a prism of 15°" in report


def test_each_press_of_the_prism_is_kept_and_its_errors_are_true(calibrated: tuple[Path, dict[str, Any]]) -> None:
    state = json.loads((calibrated[0] / "state/state.json").read_text())
    assert [press["file"] for press in state["prisms"]] == ["prisms/press-001.png", "prisms/press-002.png"]
    for press in state["prisms"]:
        assert (calibrated[0] / "state" / press["file"]).is_file()
        errors = PrismErrors.model_validate(press["figures"])
        assert errors.true_contact_normal_deg == pytest.approx(errors.normal_deg, abs=1.5)


class Mistaken(VirtualHand):
    """A hand that presses the prism of 15 degrees whatever was named."""

    def prism(self, number: int, angle_deg: float, pixel_size_mm: float, image_shape: tuple[int, int]) -> None:
        super().prism(number, 15.0, pixel_size_mm, image_shape)


def test_a_prism_of_another_angle_does_not_pass(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    state = before_the_prism(calibrated, tmp_path, angle_deg=30.0)
    with camera(LIT) as sensor:
        assert sensor.stage is not None
        named = whole(tmp_path, prism_angle_deg=30.0)
        snapshot = finished(Routine(sensor, named, state, hand=Mistaken(sensor.stage)))
    assert snapshot["step"] == "finished", snapshot["problem"]
    assert not snapshot["verdict"]["passed"]
    assert "check the angle of the prism" in snapshot["verdict"]["text"]
    assert snapshot["figures"]["verify"]["prism"]["felt_deg"] == pytest.approx(15, abs=3)
    assert not (tmp_path / "bundle").exists()
    assert json.loads((state / "state.json").read_text())["prisms"] == []


def test_a_user_who_presses_no_prism_is_told_and_can_go_on_without(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    state = before_the_prism(calibrated, tmp_path)
    with camera(LIT) as sensor:
        routine = Routine(sensor, whole(tmp_path), state)
        routine.act("start")
        asked = wait_for(routine, lambda s: s["step"] == "verify" and s["awaiting"] == "press")
        assert "Press the prism, whose faces are at 15 degrees to the gel" in asked["instruction"]
        assert asked["progress"] == {"done": 0, "wanted": 2, "unit": "presses of the prism"}
        sensor.stage.press("BALL", 1.0, 2.0, 1.0)
        told = wait_for(routine, lambda s: s["problem"] != "")
        assert "prism" in told["problem"]
        sensor.stage.release()
        wait_for(routine, lambda s: s["awaiting"] == "press")
        sensor.stage.press("PRISM15", 0.7, 1.0, -0.5)
        taken = wait_for(routine, lambda s: s["progress"]["done"] == 1 or s["press"] is not None)
        assert taken["press"]["face_px"] > 5
        sensor.stage.release()
        wait_for(routine, lambda s: s["awaiting"] == "press" and "next" in s["actions"])
        routine.act("next")
        routine.join(60)
        snapshot = routine.snapshot()
    assert snapshot["step"] == "finished", snapshot["problem"]
    assert snapshot["figures"]["verify"]["prism"]["presses"] == 1


def test_without_any_press_of_the_prism_the_balls_alone_judge(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    state = before_the_prism(calibrated, tmp_path)
    with camera(LIT) as sensor:
        routine = Routine(sensor, whole(tmp_path), state)
        routine.act("start")
        wait_for(routine, lambda s: s["step"] == "verify" and s["awaiting"] == "press")
        routine.act("next")
        routine.join(60)
    snapshot = routine.snapshot()
    assert snapshot["verdict"]["passed"], snapshot["problem"]
    assert "prism" not in snapshot["figures"]["verify"]
    assert "prism" not in snapshot["verdict"]["text"]


def test_what_no_prism_can_be_is_refused_before_anything_is_done(tmp_path: Path) -> None:
    for angle in (0.5, 80.0, float("nan")):
        with pytest.raises(InputError, match="the angle of the prism is"):
            whole(tmp_path, prism_angle_deg=angle)
    with pytest.raises(InputError, match="prism_presses = 0: at least 1"):
        whole(tmp_path, prism_presses=0)
    with camera(LIT) as sensor:
        assert isinstance(sensor.stage, Stage)
        assert {prism_of(angle) for angle in PRISM_DEPTHS_MM} <= set(sensor.stage.probes)
        with pytest.raises(InputError, match="the virtual hand has no prism of 20 degrees: choose one of 15, 30, 45"):
            Routine(sensor, whole(tmp_path, prism_angle_deg=20.0), tmp_path / "state", hand=VirtualHand(sensor.stage))
    assert not (tmp_path / "state").exists()


def test_a_calibration_goes_on_with_the_prism_it_was_begun_with(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    state = before_the_prism(calibrated, tmp_path)
    with camera(LIT) as sensor, pytest.raises(InputError, match=r"begun with prism_angle_deg 15\.0, not None"):
        Routine(sensor, whole(tmp_path, prism_angle_deg=None), state)
