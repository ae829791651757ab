"""The mask keeps what the noise of the camera allows to see."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.bundle.bundle import load_bundle
from gellight.reconstruction.gelnet import GradientNetwork
from tests.helpers.light_touches import NOISE_GREY, LightTouches, ball, flat_punch

PLACE_MM = (2.3, -1.4)
PICTURES = 10


@pytest.fixture(scope="module")
def touches() -> LightTouches:
    return LightTouches()


def share_marked(touches: LightTouches, grey: NDArray[np.float32]) -> float:
    """Of some pictures with noise, those in which the mask marks a cell."""
    bundle, random = load_bundle("synthetic"), np.random.default_rng(3)
    network = GradientNetwork(bundle.network, bundle.image_shape, noise_grey=NOISE_GREY)
    taken = [touches.picture(grey, random).image for _ in range(PICTURES)]
    return float(np.mean([network.touched_cells(image - bundle.reference).any() for image in taken]))


@pytest.mark.parametrize(
    ("height_mm", "depth_um", "gel_um"),
    [
        pytest.param(ball(4), 9, 6.6, id="ball of 4 mm"),
        pytest.param(ball(12), 7, 6.1, id="ball of 12 mm"),
        pytest.param(flat_punch(2), 5, 5.0, id="flat punch of 2 mm"),
    ],
)
def test_a_touch_of_some_micrometres_is_kept(
    touches: LightTouches, height_mm: NDArray[np.float64], depth_um: float, gel_um: float
) -> None:
    surface = touches.press(height_mm, depth_um, PLACE_MM)
    assert surface.depth_mm.max() * 1e3 == pytest.approx(gel_um, abs=0.1)
    assert share_marked(touches, touches.grey(surface)) >= 0.9


def test_untouched_gel_is_not_marked(touches: LightTouches) -> None:
    assert share_marked(touches, touches.untouched) == 0
