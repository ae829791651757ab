"""Two presses of one surface: where one lies on the other is found without a guess, unless nothing tells."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from gellight.lab.scanning.contact_view import ContactView
from gellight.lab.scanning.pairs import joined
from gellight.tracking.rigid import inverse, pose_of, twist_of
from tests.helpers.reliefs import Plate

PIXEL_MM = (0.1176, 0.1176)
SHAPE = (240, 320)
X, Y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * PIXEL_MM[0] for n in SHAPE[::-1]))
PLATE = Plate(0.06, 21)
ONE = np.eye(4)


def beside(x: float, y: float, turn_deg: float = 0.0, tilt_deg: float = 0.0) -> np.ndarray:
    return pose_of(np.array([-x, -y, 0, np.radians(tilt_deg), 0, np.radians(turn_deg)]))


def seen(pose: np.ndarray, deep_mm: float = 0.1, surface=PLATE.seen) -> ContactView:
    """The part itself as the gel: all that is higher than its middle less `deep_mm`; the rest of the gel is level."""
    height = surface(pose, X, Y)
    return ContactView(np.maximum(height + deep_mm, 0).astype(np.float32), PIXEL_MM, "exact")


@pytest.mark.parametrize(("x", "y", "turn_deg", "tilt_deg"), [(-20, 3, 6, 0.1), (5, -16, -11, -0.2)])
def test_a_press_beside_is_found_without_a_guess(x: float, y: float, turn_deg: float, tilt_deg: float) -> None:
    pose = beside(x, y, turn_deg, tilt_deg)
    joint = joined((0, seen(ONE)), (1, seen(pose)))
    assert joint is not None
    off = np.abs(twist_of(inverse(pose) @ joint.pose, joint.centre_mm))
    assert off[:2].max() < 0.01
    assert off[2] < 0.005
    assert np.degrees(off[5]) < 0.05
    assert (off < 3 * np.sqrt(np.diag(joint.covariance))).all()


def test_a_guess_that_is_near_leads_to_the_same_place() -> None:
    pose = beside(12, 4, 3)
    guess = beside(12.15, 3.9, 3.4)
    joint = joined((0, seen(ONE)), (1, seen(pose)), guess)
    assert joint is not None
    assert np.abs(twist_of(inverse(pose) @ joint.pose, joint.centre_mm))[:2].max() < 0.01


def test_what_does_not_overlap_is_not_joined() -> None:
    assert joined((0, seen(ONE)), (1, seen(beside(30, 25)))) is None


def test_another_surface_is_not_joined() -> None:
    for seed in (31, 32):
        assert joined((0, seen(ONE)), (1, seen(ONE, surface=Plate(0.06, seed).seen))) is None


def test_a_regular_pattern_fits_in_many_places_and_is_refused() -> None:
    def waves(pose: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.06 * (np.sin(2 * np.pi * (x - pose[0, 3]) / 2) + np.sin(2 * np.pi * (y - pose[1, 3]) / 2))

    assert joined((0, seen(ONE, surface=waves)), (1, seen(beside(15, 3), surface=waves))) is None


def test_a_smooth_plate_tells_no_place() -> None:
    """What is left of it are errors of 2 um, which are other ones in each press."""

    def plate(seed: int) -> ContactView:
        noise = gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), 4)
        return ContactView((0.2 + 0.002 * noise / noise.std()).astype(np.float32), PIXEL_MM, "exact")

    assert joined((0, plate(1)), (1, plate(2))) is None
    assert joined((0, plate(1)), (1, plate(2)), ONE) is None
    nothing = ContactView(np.zeros(SHAPE, np.float32), PIXEL_MM, "exact")
    assert joined((0, nothing), (1, seen(ONE))) is None
