"""Marker dots: found where there are some, nowhere else, and filled with the gel around them."""

import cv2
import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frames.dots import find_dots
from gellight.frames.image_files import read_image
from tests.helpers.dotted import DOT_PX, with_dots
from tests.helpers.places import of_real, real, real_picture


def gel(noise: float = 1.0) -> np.ndarray:
    """A smooth, coloured gel with the noise of a camera."""
    rows, columns = np.indices((120, 160))
    smooth = np.stack([100 + 0.5 * columns, 150 - 0.4 * rows, 90 + 0.3 * rows + 0.2 * columns], axis=2)
    return np.asarray(np.rint(smooth + np.random.default_rng(0).normal(0, noise, smooth.shape)), np.uint8)


def test_dots_are_found_and_filled_with_the_gel_around_them() -> None:
    untouched = with_dots(gel())
    dots = find_dots(untouched)
    assert dots is not None
    assert dots.diameter_px == pytest.approx(DOT_PX, abs=1.2)
    assert dots.count >= 63  # 70 are whole
    # In another picture they lie elsewhere.
    moved = with_dots(gel(), shift=(5.0, 3.0))
    error = np.abs(dots.filled(moved).astype(float) - gel(0.0))
    assert np.abs(moved.astype(float) - gel(0.0)).max() > 100
    assert error.max() < 10
    hidden = dots.mask(moved)
    assert 0.04 < hidden.mean() < 0.25
    np.testing.assert_array_equal(dots.filled(moved)[~hidden], moved[~hidden])


def test_a_gel_without_dots_has_none() -> None:
    assert find_dots(gel()) is None
    assert find_dots(load_bundle("synthetic").reference) is None
    dirty = gel()
    for x, y in ((20, 30), (90, 50), (130, 100)):
        cv2.circle(dirty, (x, y), 3, (20, 20, 20), -1)
    assert find_dots(dirty) is None


@pytest.mark.parametrize(
    "name",
    [
        "ninedtact/1_view.png",
        "ninedtact/2_upright_untouched.png",
        "three_lights/untouched.png",
        *map(of_real, ("gelsight_mini_ball/background.png", "digit_ball/background.png")),
    ],
)
def test_real_gels_without_dots_have_none(name: str) -> None:
    assert find_dots(read_image(real_picture(name))) is None


@pytest.mark.real_images("dots")
def test_the_dots_of_a_real_gel_are_found() -> None:
    dots = find_dots(read_image(real("dots") / "bg-0.jpg"))
    assert dots is not None
    assert dots.count > 126  # 140 on the gel, some more in the mirror below it
