"""A share of the slopes beside a contact counts: how deep its rim lies then, by an integral along the radius."""

import numpy as np
import pytest

from gellight.frames.frames import TactileFrame
from gellight.reconstruction.perspective import Perspective
from gellight.reconstruction.skirt import RAMP, with_true_skirts
from tests.helpers.tactile import tactile

PIXEL_MM, RADIUS_MM, RIM_MM, SPREAD_MM, BALL_MM = 0.1, 3.0, 0.4, 1.5, 6.0
SHAPE = (240, 320)
Y, X = (PIXEL_MM * (at - (side - 1) / 2) for at, side in zip(np.indices(SHAPE), SHAPE, strict=True))
DISTANCE_MM = np.hypot(X, Y)


def skirt_slope(r: np.ndarray) -> np.ndarray:
    """d(depth)/dr beside the contact: it falls from the rim's depth to nothing within some millimetres."""
    return -RIM_MM / SPREAD_MM * np.exp(-(r - RADIUS_MM) / SPREAD_MM)


def pressed() -> TactileFrame:
    """A cap of a paraboloid, and its skirt."""
    steep = np.where(DISTANCE_MM < RADIUS_MM, -DISTANCE_MM / BALL_MM, skirt_slope(DISTANCE_MM))
    slopes = np.stack([steep * X, steep * Y], axis=2) / np.maximum(DISTANCE_MM, 1e-9)[..., None]
    cap = (RADIUS_MM**2 - DISTANCE_MM**2) / (2 * BALL_MM)
    depth = np.where(DISTANCE_MM < RADIUS_MM, RIM_MM + cap, -skirt_slope(DISTANCE_MM) * SPREAD_MM)
    return tactile(depth, slopes, DISTANCE_MM < RADIUS_MM)


@pytest.mark.parametrize("share", [1.0, 0.4, 0.1, 1.3])
def test_the_rim_is_as_deep_as_the_slopes_that_count(share: float) -> None:
    frame = with_true_skirts(pressed(), share, (PIXEL_MM, PIXEL_MM), None)
    r = np.linspace(RADIUS_MM, 14, 4001)
    counted = 1 - (1 - share) * np.minimum((r - RADIUS_MM) / (RAMP * RADIUS_MM), 1)
    rim_mm = -np.trapezoid(counted * skirt_slope(r), r)
    middle = frame.depth_mm[SHAPE[0] // 2, SHAPE[1] // 2]
    assert middle == pytest.approx(rim_mm + RADIUS_MM**2 / (2 * BALL_MM), abs=0.02)
    assert frame.contact.indentation_mm == pytest.approx(middle, abs=2e-3)
    assert frame.contacts[0].depth_mm == pytest.approx(middle, abs=2e-3)
    inside = DISTANCE_MM < RADIUS_MM
    assert np.array_equal(frame.contact.mask, inside)
    assert np.array_equal(frame.gradient_map[inside], pressed().gradient_map[inside]), "the contact is as it was"


def test_it_is_so_from_a_camera_near_the_gel() -> None:
    seen = Perspective.over(SHAPE, (PIXEL_MM, PIXEL_MM), 53.0)
    found = [with_true_skirts(pressed(), share, (PIXEL_MM, PIXEL_MM), seen).contact for share in (1.0, 0.4)]
    assert found[0].indentation_mm - found[1].indentation_mm == pytest.approx(0.6 * 0.325, abs=0.03)
    assert found[0].area_mm2 < np.pi * RADIUS_MM**2, "what is deeper is nearer, and looks larger than it is"


def test_gel_that_nothing_touches_stays_as_it_is() -> None:
    frame = tactile(np.zeros(SHAPE))
    assert with_true_skirts(frame, 0.3, (PIXEL_MM, PIXEL_MM), None) is frame
