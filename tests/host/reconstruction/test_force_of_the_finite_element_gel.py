"""The force of a gel that is no ideal layer: weighed with one ball, other objects are right within 10 %."""

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.reconstruction.force import Layer, indenting
from tests.benchmarks.force import FINGER, on_a_finger
from tests.helpers.fem_presses import NAMES, SPACING_MM, depth_mm, force_n, picture

WEIGHED = "ball4_1.0"
LAYER = Layer(5.0, 0.49)


def integral(depth: np.ndarray, pixel_mm: tuple[float, float] = (SPACING_MM, SPACING_MM)) -> float:
    return indenting(depth, pixel_mm, LAYER).integral_mm2


@pytest.mark.parametrize("name", NAMES)
def test_one_ball_weighs_every_object_within_a_tenth(name: str) -> None:
    modulus = force_n(WEIGHED) / integral(depth_mm(WEIGHED))
    assert modulus == pytest.approx(0.2, rel=0.04), "of the gel, 0.2 MPa"
    assert modulus * integral(depth_mm(name)) == pytest.approx(force_n(name), rel=0.1)


def test_a_constant_of_the_volume_would_not() -> None:
    """The constant that fits best leaves some object a fifth off."""
    volume = {name: float(np.maximum(depth_mm(name), 0).sum()) * SPACING_MM**2 for name in NAMES}
    ratio = np.array([force_n(name) / volume[name] for name in NAMES])
    best = np.sqrt(ratio.min() * ratio.max())
    assert np.abs(ratio / best - 1).max() > 0.2


def test_so_it_is_when_the_depth_is_felt_in_pictures() -> None:
    bundle = load_bundle("synthetic")
    reconstructor = Reconstructor(bundle)
    felt = {
        name: integral(reconstructor.reconstruct(picture(name)).depth_mm, bundle.pixel_size_mm)
        for name in (WEIGHED, "ball2.5_0.9", "cyl_1.0", "prism_0.9", "pins_0.4")
    }
    modulus = force_n(WEIGHED) / felt[WEIGHED]
    weighed = {name: modulus * value / force_n(name) for name, value in felt.items()}
    assert weighed == pytest.approx(dict.fromkeys(felt, 1.0), rel=0.1)


def test_a_small_view_and_an_unknown_zero_change_the_force_of_no_object() -> None:
    """Where skirts are cut off and the zero is a plane, the force was 0.9 to 4.7 times the right one."""
    pixels, random = (SPACING_MM, SPACING_MM), np.random.default_rng(0)
    for name in FINGER:
        whole = indenting(depth_mm(name), pixels, LAYER)
        seen = indenting(on_a_finger(name, random), pixels, LAYER)
        assert seen.integral_mm2 == pytest.approx(whole.integral_mm2, rel=0.04), name
        assert not seen.at_border


@pytest.mark.parametrize(("name", "cut_off"), [("ball7_0.8", False), ("cyl_1.0", True), ("tstep_0.5", True)])
def test_only_a_load_that_goes_on_beyond_the_view_is_beyond_it(name: str, cut_off: bool) -> None:
    """In 8 mm of view every skirt is cut off, but under the ball of 7 mm no load is."""
    depth = depth_mm(name)
    cut = (len(depth) - round(8 / SPACING_MM)) // 2
    seen = depth[cut:-cut, cut:-cut]
    assert max(seen[0].max(), seen[:, 0].max()) > 0.02
    found = indenting(seen, (SPACING_MM, SPACING_MM), LAYER)
    assert found.at_border == cut_off
