"""The self-check fails when it should."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.lab.simulator.simulated_camera import SimulatedCamera, open_simulated
from tests.helpers.selfcheck import KINDS, SMALLEST, SelfCheck


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
