"""The look-up table and the polynomial: right where they can be, bounded where they cannot; what polynomials are."""

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.training.baselines import fit_lookup_table, fit_polynomial
from gellight.lab.training.polynomial import powers_up_to, ridge, terms_of
from gellight.lab.training.table import PressTable

LIGHTS = np.array([[80.0, 0.0], [-40.0, 70.0], [-40.0, -70.0]])
SHAPE = (60, 80)


def table(*, falling: float = 0.0, gain: float = 1.0) -> PressTable:
    """Pixels of a sensor whose colours follow the normal, weaker to the right by `falling`."""
    random = np.random.default_rng(0)
    slope = random.uniform(-1, 1, (30_000, 2))
    place = random.integers(0, [SHAPE[1], SHAPE[0]], (30_000, 2))
    sine = slope / np.sqrt(1 + (slope**2).sum(axis=1, keepdims=True))
    colour = gain * (1 - falling * place[:, :1] / SHAPE[1]) * (sine @ LIGHTS.T)
    rows = np.concatenate([colour, place, slope], axis=1).astype(np.float32)
    return PressTable(rows=rows, image=np.zeros(30_000, np.int32), image_size=(SHAPE[1], SHAPE[0]))


def picture(slope: tuple[float, float], *, falling: float = 0.0) -> np.ndarray:
    sine = np.array(slope) / np.sqrt(1 + np.sum(np.square(slope)))
    fall = 1 - falling * np.indices(SHAPE)[1][..., None] / SHAPE[1]
    return (fall * (LIGHTS @ sine)).astype(np.float32)


def test_the_table_knows_the_mean_slope_of_a_colour_and_its_nearest_where_it_saw_none() -> None:
    lookup = fit_lookup_table(table())
    found = lookup.gradient_map(picture((0.4, -0.3)))
    np.testing.assert_allclose(found, np.broadcast_to([0.4, -0.3], found.shape), atol=0.08)
    far = lookup.gradient_map(np.full((*SHAPE, 3), 5000.0, np.float32))
    assert np.isfinite(far).all()
    assert np.abs(far).max() <= 1


def test_the_polynomial_knows_the_place_too() -> None:
    made = table(falling=0.4)
    wanted = np.broadcast_to([0.4, -0.3], (*SHAPE, 2))
    seen = picture((0.4, -0.3), falling=0.4)
    by_polynomial = np.abs(fit_polynomial(made).gradient_map(seen) - wanted).mean()
    by_table = np.abs(fit_lookup_table(made).gradient_map(seen) - wanted).mean()
    assert by_polynomial < 0.01
    assert by_table > 3 * by_polynomial


def test_no_colour_change_is_flat_and_a_mad_one_is_bounded() -> None:
    polynomial = fit_polynomial(table(falling=0.4))
    assert np.abs(polynomial.gradient_map(np.zeros((*SHAPE, 3), np.float32))).max() == 0
    mad = polynomial.gradient_map(np.full((*SHAPE, 3), -5000.0, np.float32))
    assert np.hypot(mad[..., 0], mad[..., 1]).max() < 4.1


def test_ratio_features_do_not_see_lights_that_dim() -> None:
    reference = np.full((*SHAPE, 3), 150.0, np.float32)
    polynomial = fit_polynomial(table(), reference=reference)
    bright, dim = picture((0.4, -0.3)), 0.7 * picture((0.4, -0.3))
    dimmed = fit_polynomial(table(gain=0.7), reference=0.7 * reference)
    np.testing.assert_allclose(dimmed.gradient_map(dim), polynomial.gradient_map(bright), atol=0.05)


def test_a_light_that_never_changes_is_named() -> None:
    made = table()
    made.rows[:, 0] = 0
    with pytest.raises(InputError, match="never change in one channel"):
        fit_polynomial(made)


def test_the_terms_are_all_products_up_to_the_degree() -> None:
    x, y = np.random.default_rng(0).normal(size=(2, 20))
    powers = powers_up_to(3, 2)
    assert sorted(powers) == sorted((i, j) for i in range(4) for j in range(4 - i))
    np.testing.assert_allclose(terms_of([x, y], powers), np.stack([x**i * y**j for i, j in powers], axis=1))


def test_terms_may_be_asked_for_in_any_order_and_without_their_parts() -> None:
    x, y = np.random.default_rng(1).normal(size=(2, 5))
    np.testing.assert_allclose(terms_of([x, y], [(2, 1), (0, 1)]), np.stack([x * x * y, y], axis=1))


def test_without_a_ridge_the_weights_are_found_again_and_with_one_they_shrink() -> None:
    random = np.random.default_rng(2)
    terms = terms_of(list(random.uniform(-1, 1, (3, 400))), powers_up_to(2, 3))
    weights = random.normal(size=(terms.shape[1], 2))
    np.testing.assert_allclose(ridge(terms, terms @ weights, 0.0), weights, atol=1e-9)
    assert np.linalg.norm(ridge(terms, terms @ weights, 0.1)) < np.linalg.norm(weights)


@pytest.mark.parametrize("share", [1e-3, 0.5])
def test_the_ridge_is_a_share_of_the_mean_square_whatever_the_number_of_rows(share: float) -> None:
    random = np.random.default_rng(3)
    terms, values = random.normal(size=(30, 4)), random.normal(size=(30, 1))
    found = ridge(terms, values, share)
    twice = ridge(np.concatenate([terms, terms]), np.concatenate([values, values]), share)
    np.testing.assert_allclose(found, twice, rtol=1e-12)
    slope = terms.T @ (terms @ found - values) / len(terms) + share * found
    np.testing.assert_allclose(slope, 0, atol=1e-12)  # where the derivative vanishes it is least
