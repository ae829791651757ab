"""The size of a pixel: the imprint of a flat-ended cylinder, found to a fraction of a pixel."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from gellight.base.errors import InputError
from gellight.lab.calibration.cylinder import edge_profile, find_cylinder
from gellight.lab.calibration.probing import pixel_size
from gellight.lab.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry


def imprint(center: tuple[float, float], radii: tuple[float, float], width_px: float = 1.7) -> np.ndarray:
    """A difference image (120, 160, 3) of an ellipse whose edge has the profile of a flat punch, lit from the right."""
    y, x = np.mgrid[:120, :160].astype(float)
    u, v = (x - center[0]) / radii[0], (y - center[1]) / radii[1]
    away = (np.hypot(u, v) - 1) * np.mean(radii)
    slope = edge_profile(away, width_px)
    turn = np.arctan2(v, u)
    colours = [np.cos(turn - a) for a in (0.2, 2.3, 4.4)]
    noise = np.random.default_rng(0).normal(0, 0.5, (120, 160, 3))
    return (40 * slope[..., None] * np.stack(colours, axis=2) + noise).astype(np.float32)


def test_the_edge_profile_is_the_smoothed_slope_beside_a_flat_punch() -> None:
    for t in (-2.0, 0.0, 0.8, 3.0, 5.9):
        root = np.linspace(0, 4, 200001)  # u = root^2 takes the singularity out of the integral
        wanted = np.trapezoid(2 * np.exp(-((t - root**2) ** 2) / 2), root) / np.sqrt(2 * np.pi)
        assert edge_profile(np.array([t]), 1.0)[0] == pytest.approx(wanted, rel=1e-4)


def test_the_edge_profile_far_out_falls_as_the_inverse_root() -> None:
    near, far = edge_profile(np.array([50.0, 200.0]), 2.0)
    assert near / far == pytest.approx(2.0)


@pytest.mark.parametrize("center", [(79.3, 60.8), (70.0, 55.5)])
def test_width_and_height_of_the_imprint_are_found_to_a_tenth_of_a_pixel(center: tuple[float, float]) -> None:
    found = find_cylinder(imprint(center, (36.2, 34.9)), 0.5)
    assert (found.radius_x_px, found.radius_y_px) == pytest.approx((36.2, 34.9), abs=0.1)
    assert (found.center_x_px, found.center_y_px) == pytest.approx(center, abs=0.1)


def test_the_simulated_gel_gives_the_size_of_its_pixels_to_a_third_of_a_percent() -> None:
    geometry = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
    scene, random = Scene(geometry, CameraResponse()), np.random.default_rng(1)
    untouched = scene.show(None)[0]
    found = []
    for place in ((0.0, 0.0), (-5.0, 3.3), (4.1, -2.7)):
        grey, _ = scene.show(Press("CYLINDER", 0.3, *place))
        found.append(find_cylinder(digitise(grey, 1.0, random) - untouched, 1.0))
    figures = pixel_size(found, 8.0)
    assert (figures.x_mm, figures.y_mm) == pytest.approx((0.1176, 0.1176), rel=0.0033)
    assert figures.spread_px < 0.2


@pytest.mark.parametrize(("noises", "seen"), [(2.8, False), (3.2, True)])
def test_what_changes_by_less_than_three_times_the_noise_is_no_imprint(noises: float, seen: bool) -> None:
    pressed = imprint((79.3, 60.8), (36.2, 34.9))
    strongest_grey = float(gaussian_filter(np.abs(pressed).max(axis=2), 2.0).max())
    if seen:
        assert find_cylinder(pressed, strongest_grey / noises).radius_x_px == pytest.approx(36.2, abs=0.1)
    else:
        with pytest.raises(InputError, match="nothing is pressed"):
            find_cylinder(pressed, strongest_grey / noises)
