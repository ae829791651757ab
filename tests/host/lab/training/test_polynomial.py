"""The terms of a polynomial, and ridge regression: what polynomials are, and where the weights are found again."""

import numpy as np
import pytest

from gellight.lab.training.polynomial import powers_up_to, ridge, terms_of


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
