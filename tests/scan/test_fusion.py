"""Presses as one map: height, tilt and bend of each are no matter, and what was not reached is not filled in."""

import numpy as np
import pytest

from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import Fused, fuse
from gellight_scan.tracking.rigid import inverse, pose_of

PIXEL_MM = 0.12
SHAPE = (120, 160)
X, Y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * PIXEL_MM for n in SHAPE[::-1]))
BEND = 1e-4
"""mm by mm2, of every press"""
CUBIC = 1e-5
"""mm by mm3, of every press: 9 um at its side"""
PLACES = {0: (-7.0, 0.0, 0.0), 1: (0.0, 2.0, 0.05), 2: (8.0, -1.0, -0.04)}


def plate(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A flat plate with a raised ring, whose walls are smooth."""
    return 0.1 / (1 + np.exp((np.abs(np.hypot(x - 2, y) - 4) - 1.5) / 0.15))


def view(number: int) -> ContactView:
    """A press: deeper or less deep, tilted, and bent as all of them."""
    x0, y0, turn = PLACES[number]
    c, s = np.cos(turn), np.sin(turn)
    height = plate(c * X - s * Y + x0, s * X + c * Y + y0)
    lean = 0.002 * (number - 1) * X + 0.001 * number * Y
    bend = BEND * (X**2 + Y**2) + CUBIC * (X**3 + X * Y**2)
    return ContactView((0.3 + 0.05 * number + height + lean + bend).astype(np.float32), (PIXEL_MM,) * 2, "a")


def poses() -> dict[int, np.ndarray]:
    """Where the presses lie, in the axes of the first; their height and tilt are wrong."""
    true = {number: pose_of(np.array([x, y, 0, 0, 0, turn])) for number, (x, y, turn) in PLACES.items()}
    wrong = {number: pose_of(np.array([0, 0, 0.02 * number, 0.001 * number, -0.002, 0])) for number in true}
    return {number: inverse(true[0]) @ true[number] @ wrong[number] for number in true}


def off_mm(fused: Fused) -> np.ndarray:
    """By how much the map is off the plate where it is known, beside a constant."""
    rows, columns = np.nonzero(fused.height_map.reached)
    x, y = (start + PIXEL_MM * at for start, at in zip(fused.origin_mm, (columns, rows), strict=True))
    off = fused.height_map.height_mm[rows, columns] - plate(x + PLACES[0][0], y + PLACES[0][1])
    return np.asarray(off - np.median(off))


@pytest.fixture(scope="module")
def fused() -> Fused:
    return fuse({number: view(number) for number in PLACES}, poses())


def test_the_map_is_the_plate_whatever_height_tilt_and_bend_the_presses_have(fused: Fused) -> None:
    """The ring weighs nothing when the form is found: the plate beside it is flat."""
    assert fused.height_map.reached.mean() > 0.4
    assert np.abs(off_mm(fused)).max() < 0.004
    assert fused.seam_mm < 0.001


def test_a_curved_part_keeps_its_bend() -> None:
    """And with it that of the presses, which nobody can tell from it."""
    kept = fuse({number: view(number) for number in PLACES}, poses(), curved=True)
    columns = np.nonzero(kept.height_map.reached)[1]
    x = PIXEL_MM * (columns - columns.mean())
    assert np.polyfit(x, off_mm(kept), 2)[0] == pytest.approx(BEND, rel=0.25)


def test_what_no_press_reached_is_not_filled_in(fused: Fused) -> None:
    """Also between two presses, and where the view ends."""
    heights = fused.height_map
    assert np.isnan(heights.height_mm[~fused.seen]).all()
    np.testing.assert_array_equal(np.isnan(heights.error_mm), ~heights.reached)
    assert (heights.error_mm[heights.reached] > 0).all()


def test_where_presses_disagree_the_map_says_so() -> None:
    views = {number: view(number) for number in PLACES}
    dented = views[1].depth_mm.copy()
    dented[50:70, 60:90] += 0.02
    plain, spoilt = (
        fuse({**views, 1: ContactView(depth, views[1].pixel_size_mm, "a")}, poses())
        for depth in (views[1].depth_mm, dented)
    )
    assert spoilt.seam_mm > 2 * plain.seam_mm
    assert np.nanmax(spoilt.height_map.error_mm) > 0.005
