"""The self-check fails when it should."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import GroundTruth, TactileFrame
from gellight.lab.simulator.simulated_camera import SimulatedCamera, open_simulated
from sim_reference.geometry import AS_BUILT, SensorGeometry
from tests.helpers.selfcheck import DEPTHS_MM, ERRORS, KINDS, SMALLEST, SelfCheck, bounds_of


@pytest.fixture(scope="module")
def camera() -> SimulatedCamera:
    return open_simulated("sim://?object=BALL&depth=1.0&fps=1000")


@pytest.fixture(scope="module")
def frame(camera: SimulatedCamera) -> TactileFrame:
    return Reconstructor(load_bundle("synthetic")).reconstruct(camera.read())


@pytest.fixture(scope="module")
def judge(camera: SimulatedCamera) -> SelfCheck:
    return SelfCheck(camera, (0.0588, 0.0588))


def test_a_good_frame_passes(judge: SelfCheck, frame: TactileFrame) -> None:
    result = judge.compare(frame)
    assert result.bounds == SMALLEST == dict(zip(KINDS, (0.020, 0.28, 0.005, 2.0), strict=True))
    assert (result.passed, result.verdict) == (True, "passed")
    assert result.true_indentation_mm == pytest.approx(0.997, abs=0.01)


def test_a_wrong_scale_of_the_depth_fails(judge: SelfCheck, frame: TactileFrame) -> None:
    result = judge.compare(replace(frame, depth_mm=1.05 * frame.depth_mm))
    assert not result.passed
    assert result.depth_error_mm > result.bounds["depth_error_mm"]
    assert result.integral_error_mm > judge.compare(frame).integral_error_mm


def test_swapped_slopes_fail_by_normals_and_by_picture(judge: SelfCheck, frame: TactileFrame) -> None:
    result = judge.compare(replace(frame, gradient_map=np.ascontiguousarray(frame.gradient_map[..., ::-1])))
    assert result.normal_error_deg > SMALLEST["normal_error_deg"]
    assert result.picture_error_grey > 1.5 * judge.compare(frame).picture_error_grey
    assert not result.passed


def test_an_integral_that_is_not_one_fails(judge: SelfCheck, frame: TactileFrame) -> None:
    tilted = frame.depth_mm + np.linspace(0, 0.1, 640, dtype=np.float32)
    assert judge.compare(replace(frame, depth_mm=tilted)).integral_error_mm > SMALLEST["integral_error_mm"]


def test_another_light_than_the_real_one_shows_in_the_picture(judge: SelfCheck, frame: TactileFrame) -> None:
    light = frame.camera_frame.light
    dark = light.copy()
    dark[0] = 0
    dimmed = replace(frame, camera_frame=replace(frame.camera_frame, light=dark))
    assert judge.compare(dimmed).picture_error_grey > SMALLEST["picture_error_grey"]


def test_a_deep_press_of_a_steep_object_is_judged_by_what_was_measured_that_deep(
    camera: SimulatedCamera, judge: SelfCheck
) -> None:
    camera.stage.press("WAVE", 1.5, 0.0, 0.0)
    steep = Reconstructor(load_bundle("synthetic")).reconstruct(camera.read())
    result = judge.compare(steep)
    assert result.verdict == "passed"
    assert result.bounds["depth_error_mm"] == pytest.approx(1.3 * ERRORS["WAVE"][1][0])
    worse = judge.compare(replace(steep, depth_mm=steep.depth_mm + 2 * result.bounds["depth_error_mm"]))
    assert worse.verdict == "failed", "a constant is not taken off before it is judged"
    assert worse.shape_error_mm == pytest.approx(result.shape_error_mm, rel=1e-3)
    camera.stage.press("BALL", 1.0, 0.0, 0.0)


def truth(object_name: str, depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> GroundTruth:
    flat = np.zeros((4, 4), np.float32)
    return GroundTruth(
        depth_mm=flat,
        gradient_map=np.zeros((4, 4, 2), np.float32),
        contact=flat == (0 if object_name else 1),
        object_name=object_name,
        press_depth_mm=depth_mm,
        place_mm=(x_mm, y_mm),
    )


def test_bounds_grow_with_depth_and_are_never_below_what_was_measured() -> None:
    for name, rows in ERRORS.items():
        shallow, deep = (bounds_of(truth(name, depth), AS_BUILT)[0] for depth in DEPTHS_MM)
        assert bounds_of(truth(name, 0.9), AS_BUILT)[0] == deep
        for number, kind in enumerate(KINDS):
            assert rows[0][number] < shallow[kind] <= deep[kind] > rows[1][number]
    assert bounds_of(truth("", 0.0), AS_BUILT) == (dict(SMALLEST), "")


@pytest.mark.parametrize(
    ("press", "why"),
    [
        (truth("WAVE", 2.1), "not judged beyond 2 mm"),
        (truth("BALL", 1.0, 14.0, 0.0), "not judged beyond 10 x 6 mm from the middle"),
        (truth("CYLINDER", 0.3), "no bounds were measured for CYLINDER"),
    ],
)
def test_what_was_never_measured_is_not_judged(press: GroundTruth, why: str) -> None:
    bounds, reason = bounds_of(press, AS_BUILT)
    assert bounds == {}
    assert why in reason


def test_a_press_that_is_not_judged_has_neither_passed_nor_failed(judge: SelfCheck, frame: TactileFrame) -> None:
    deep = replace(frame.camera_frame.truth, press_depth_mm=2.5)
    result = judge.compare(replace(frame, camera_frame=replace(frame.camera_frame, truth=deep)))
    assert (result.verdict, result.passed) == ("not judged", False)
    assert result.depth_error_mm > 0, "the figures are shown all the same"


def test_another_sensor_than_the_measured_one_is_not_judged() -> None:
    assert "default sensor only" in bounds_of(truth("BALL", 1.0), SensorGeometry(mounting_height_mm=9.0))[1]


def test_a_frame_without_truth_cannot_be_compared(judge: SelfCheck, frame: TactileFrame) -> None:
    blind = replace(frame, camera_frame=replace(frame.camera_frame, truth=None))
    with pytest.raises(InputError, match="carries no truth"):
        judge.compare(blind)
