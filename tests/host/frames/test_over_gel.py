"""Maps of the picture over the gel at rest, against planes, whose pictures follow by hand."""

import numpy as np
import pytest

from gellight.frames.over_gel import over_gel

HEIGHT_MM = 53.1
PIXEL_MM = 0.2
SHAPE = (120, 160)
INSIDE = (slice(12, -12), slice(12, -12))
"""beyond, the picture may not show the gel"""
OPENCV_PX = 1 / 32
"""as finely OpenCV tells where between pixels it looks"""


def plane(lean: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth of a leaning plane over the gel, d = 1 + lean x, and in the picture: d (1 + lean p / H) = 1 + lean p."""
    x = np.broadcast_to((np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * PIXEL_MM, SHAPE)
    return (1 + lean * x).astype(np.float32), ((1 + lean * x) / (1 + lean * x / HEIGHT_MM)).astype(np.float32)


@pytest.mark.parametrize("lean", [0.0, 0.05, -0.4])
def test_a_plane_lies_over_the_gel_as_it_is(lean: float) -> None:
    over, seen = plane(lean)
    off_mm = OPENCV_PX * abs(lean) * PIXEL_MM + 1e-6
    np.testing.assert_allclose(over_gel(seen, HEIGHT_MM)[INSIDE], over[INSIDE], atol=off_mm)


def test_other_maps_go_where_the_depth_goes() -> None:
    over, seen = plane(0.2)
    both = over_gel(np.dstack([seen, 3 * seen]), HEIGHT_MM)
    np.testing.assert_allclose(both[..., 1], 3 * both[..., 0], rtol=1e-6)
    np.testing.assert_allclose(both[..., 0][INSIDE], over[INSIDE], atol=OPENCV_PX * 0.2 * PIXEL_MM)


def test_a_camera_far_away_moves_nothing() -> None:
    _, seen = plane(0.2)
    assert over_gel(seen, 0.0) is seen


@pytest.mark.parametrize("middle", [(130, 30), (30, 95)])
def test_a_touch_alone_is_moved_and_lies_where_it_touches(middle: tuple[int, int]) -> None:
    """A bump seen where it belongs, p = x / (1 - d / H); beside it the map stays as it is, to the last bit."""
    y, x = np.indices(SHAPE, dtype=np.float64)
    ways = np.stack([x - (SHAPE[1] - 1) / 2, y - (SHAPE[0] - 1) / 2])
    at = np.array(middle, float)[:, None, None] - np.array([(SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2])[:, None, None]

    def bump(ways: np.ndarray) -> np.ndarray:
        return np.asarray(1.5 * np.exp(-((ways - at) ** 2).sum(axis=0) / 50))

    seen = np.zeros(SHAPE)
    for _ in range(50):  # the depth d in the pixel p is that of the gel at p (1 - d / H)
        seen = bump(ways * (1 - seen / HEIGHT_MM))
    over = over_gel(seen.astype(np.float32), HEIGHT_MM)
    np.testing.assert_allclose(over, bump(ways), atol=0.015)  # between pixels a bump of 5 is linear here
    flat = seen < 1e-4
    assert (over[flat] == seen[flat].astype(np.float32)).mean() > 0.9
    assert np.abs(seen - bump(ways)).max() > 0.03
