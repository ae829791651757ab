"""The self-check fails when it should."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.lab.simulator.simulated_camera import SimulatedCamera, open_simulated
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
    assert result.passed


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
    assert result.passed
    assert result.bounds["depth_error_mm"] == pytest.approx(1.3 * ERRORS["WAVE"][1][0])
    worse = judge.compare(replace(steep, depth_mm=steep.depth_mm + 2 * result.bounds["depth_error_mm"]))
    assert not worse.passed, "a constant is not taken off before it is judged"
    assert worse.shape_error_mm == pytest.approx(result.shape_error_mm, rel=1e-3)
    camera.stage.press("BALL", 1.0, 0.0, 0.0)


def test_bounds_grow_with_depth_and_are_never_below_what_was_measured(frame: TactileFrame) -> None:
    for name, rows in ERRORS.items():
        shallow, deep, between = (
            bounds_of(replace(frame.camera_frame.truth, object_name=name, press_depth_mm=depth))
            for depth in (*DEPTHS_MM, 0.9)
        )
        assert between == deep
        for number, kind in enumerate(KINDS):
            assert rows[0][number] < shallow[kind] <= deep[kind] > rows[1][number]
    assert bounds_of(replace(frame.camera_frame.truth, object_name="")) == SMALLEST


def test_a_frame_without_truth_cannot_be_compared(judge: SelfCheck, frame: TactileFrame) -> None:
    blind = replace(frame, camera_frame=replace(frame.camera_frame, truth=None))
    with pytest.raises(InputError, match="carries no truth"):
        judge.compare(blind)
