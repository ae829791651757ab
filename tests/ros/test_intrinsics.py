"""The lens of a bundle as a pinhole camera of OpenCV."""

from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from gellight.reconstruction.lens.model import Lens
from gellight_ros import intrinsics

LENS = Lens(
    image_shape=(480, 640), centre_px=(322.5, 236.25), k1=-0.08, k2=0.01, px_per_mm=(17.0, 0.0, 17.0),
    origin_mm=(0.4, -0.3),
)  # fmt: skip


@pytest.mark.parametrize("distance_mm", [25.0, 40.0])
def test_opencv_projects_with_it_as_the_lens_does(monkeypatch: pytest.MonkeyPatch, distance_mm: float) -> None:
    monkeypatch.setattr(intrinsics.LensRecord, "in_bundle", Mock())
    monkeypatch.setattr(intrinsics, "lens_of", lambda record: LENS)
    bundle: Any = SimpleNamespace(files={"lens.json": b""})
    camera = intrinsics.intrinsics(bundle, distance_mm)
    gel_mm = np.random.default_rng(3).uniform([-18, -13], [18, 13], (50, 2))
    points = np.column_stack([gel_mm + LENS.origin_mm, np.full(50, distance_mm)])
    coefficients = np.array([*camera.distortion, 0, 0, 0])
    projected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, coefficients)
    assert projected[:, 0] == pytest.approx(LENS.to_picture(gel_mm), abs=1e-6)


def test_without_a_lens_the_pixel_size_tells_the_focal_length() -> None:
    bundle: Any = SimpleNamespace(files={}, pixel_size_mm=(0.05, 0.04), image_shape=(480, 640))
    camera = intrinsics.intrinsics(bundle, 40.0)
    assert camera.matrix.tolist() == [[800, 0, 319.5], [0, 1000, 239.5], [0, 0, 1]]
    assert camera.distortion == (0, 0)
