"""What a frame says of its own errors, each contact by itself; and the errors against a true surface."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import GroundTruth
from gellight.reconstruction.error_bounds import (
    TERMS,
    ErrorRecord,
    quadratic,
    quadratic_form,
    signs,
)
from gellight.reconstruction.errors import surface_errors
from tests.helpers.tactile import tactile

SHAPE = (60, 90)
Y, X = np.indices(SHAPE)
DISCS = ((20, 30, 12.0, 1.0), (65, 30, 6.0, 0.2))
"""centre x, y, radius in px, and depth in mm of two contacts"""


def weights(*first: float) -> tuple[float, ...]:
    return (*first, *[0.0] * (TERMS - len(first)))


def record(**changes: object) -> ErrorRecord:
    known = {
        "presses": 9, "steepest": 1.0, "least": (0.0, 0.0, -1.0), "most": (1.0, 1.0, 1.0),
        "normal_weights": weights(np.log(2 + 0.5)), "shape_weights": weights(np.log(0.01 + 0.003)),
    }  # fmt: skip
    return ErrorRecord.model_validate(known | changes)


def maps() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes, depth and contact of two flat discs."""
    depth = np.zeros(SHAPE, np.float32)
    for x, y, radius, deep in DISCS:
        depth[np.hypot(X - x, Y - y) < radius] = deep
    return np.zeros((*SHAPE, 2), np.float32), depth, depth > 0


def test_each_contact_is_measured_by_its_own_radius_and_depth() -> None:
    found = signs(*maps())
    for x, y, radius, _ in DISCS:
        assert found[y, x, 1] == 1.0
        assert found[y, x, 2] == pytest.approx(1.0, abs=1.5 / radius)
        beside = round(x + 1.5 * radius)
        assert found[y, beside, 1] == 0.0
        assert found[y, beside, 2] == pytest.approx(-0.5, abs=1.5 / radius)


def test_inside_a_contact_presses_tell_and_outside_nobody_knows() -> None:
    slopes, depth, touched = maps()
    bounds = record().bounds(slopes, depth, touched)
    assert bounds.normal_deg[30, 20] == pytest.approx(2.0)
    assert bounds.shape_mm[30, 20] == pytest.approx(0.01)
    assert np.isinf(bounds.normal_deg[59, 89])
    untouched = record().bounds(slopes, 0 * depth, np.zeros_like(touched))
    assert np.isinf(untouched.shape_mm).all()


def test_the_form_is_the_products_by_their_weights() -> None:
    rng = np.random.default_rng(3)
    found, chosen = rng.normal(size=(40, 3)), tuple(rng.normal(size=TERMS))
    assert quadratic_form(found, chosen) == pytest.approx(quadratic(found) @ chosen)


def test_what_is_steeper_than_any_press_is_not_known() -> None:
    slopes, depth, touched = maps()
    slopes[30, 20] = (0.9, 0.9)
    bounds = record().bounds(slopes, depth, touched)
    assert np.isinf([bounds.normal_deg[30, 20], bounds.shape_mm[30, 20]]).all()
    assert np.isfinite(bounds.normal_deg[30, 21])


def test_steeper_is_worse_where_presses_said_so_and_beyond_their_range_no_better() -> None:
    slopes, depth, touched = maps()
    slopes[..., 0] = np.linspace(0, 0.99, SHAPE[1])
    told = record(normal_weights=weights(0.0, 2.0), most=(0.5, 1.0, 1.0))
    row = told.bounds(slopes, depth, np.ones_like(touched)).normal_deg[30]
    assert (np.diff(row) >= 0).all()
    assert row[-1] == pytest.approx(np.exp(2 * 0.5) - 0.5, rel=1e-5)


def test_the_form_has_every_product_once() -> None:
    a, b, c = 2.0, 3.0, 5.0
    assert sorted(quadratic(np.array([a, b, c]))) == sorted([1, a, b, c, 4, 9, 25, a * b, a * c, b * c])


def test_a_bundle_keeps_its_errors_and_a_damaged_file_is_named(synthetic: Bundle) -> None:
    kept = replace(synthetic, files={**synthetic.files, **record().files()})
    assert ErrorRecord.in_bundle(kept) == record()
    assert ErrorRecord.in_bundle(synthetic) is None
    damaged = replace(synthetic, files={**synthetic.files, "errors.json": b'{"presses": 0}'})
    with pytest.raises(BundleError, match=r"errors\.json.*calibrate again"):
        ErrorRecord.in_bundle(damaged)


# ---- against a true surface ----

MAP_SHAPE = (6, 8)


def test_errors_are_means_over_the_map_and_over_the_true_contact() -> None:
    contact = np.zeros(MAP_SHAPE, np.bool_)
    contact[2:4, 2:6] = True
    true = GroundTruth(
        depth_mm=np.zeros(MAP_SHAPE, np.float32), gradient_map=np.zeros((*MAP_SHAPE, 2), np.float32), contact=contact
    )
    depth = np.where(contact, -0.5, 0.1).astype(np.float32)
    slopes = np.zeros((*MAP_SHAPE, 2), np.float32)
    slopes[contact, 0] = np.tan(np.radians(12))
    error = surface_errors(tactile(depth, slopes), true)
    share = contact.mean()
    assert error.contact_depth_mm == pytest.approx(0.5)
    assert error.depth_mm == pytest.approx(0.5 * share + 0.1 * (1 - share))
    assert error.contact_normal_deg == pytest.approx(12, rel=1e-5)
    assert error.normal_deg == pytest.approx(12 * share, rel=1e-5)
    untouched = surface_errors(tactile(depth, slopes), replace(true, contact=np.zeros(MAP_SHAPE, np.bool_)))
    assert (untouched.contact_normal_deg, untouched.contact_depth_mm) == (error.normal_deg, error.depth_mm)
