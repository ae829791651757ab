"""The modulus from forces and what was felt: what it is, how honest its error is, and what is refused."""

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.calibration.force.fit import SHAPE_SHARE, chosen_layer, fit_force, left_out_share

FELT = np.array([0.0, 1.0, 2.0, 4.0, 8.0])


def test_a_perfect_record_gives_its_modulus_and_the_error_of_other_shapes() -> None:
    fit = fit_force(0.2 * FELT, FELT, "record")
    assert fit.youngs_modulus_mpa == pytest.approx(0.2)
    assert fit.error_share == pytest.approx(SHAPE_SHARE)
    assert (fit.readings, fit.lightest_n, fit.heaviest_n) == (4, pytest.approx(0.2), pytest.approx(1.6))


@pytest.mark.parametrize("seed", range(4))
def test_the_error_is_what_new_forces_are_off_by(seed: int) -> None:
    random = np.random.default_rng(seed)

    def record(count: int) -> tuple[np.ndarray, np.ndarray]:
        felt = random.uniform(0, 10, count)
        return np.maximum(0.2 * felt * random.normal(1, 0.1, count) + random.normal(0, 0.02, count), 0), felt

    fit = fit_force(*record(60), "record")
    force, felt = record(2000)
    off = (fit.youngs_modulus_mpa * felt - force) / np.hypot(fit.error_floor_n, fit.error_share * force)
    assert 0.75 < np.sqrt(np.mean(off**2)) < 1.25


def test_one_weight_thrice_is_enough() -> None:
    fit = fit_force(np.full(3, 1.0), np.array([4.9, 5.0, 5.1]), "record")
    assert fit.youngs_modulus_mpa == pytest.approx(0.2, rel=0.01)
    assert fit.error_floor_n > 0


@pytest.mark.parametrize(
    ("force", "felt", "reason"),
    [
        ([0.1, 1.0, 2.0], [0.0, 0.0, 0.0], "nothing is felt in 2 of 3 readings, the largest of 2 N"),
        ([0.5, 1.0, 2.0], [2.5, 5.0, 0.0], "nothing is felt in 1 of 3 readings, the largest of 2 N"),
        ([0.0, 1.0, 2.0], [0.0, 5.0, 10.0], "2 readings in contact: give at least 3"),
        ([1.0, 2.0, 3.0, 4.0], [8.0, 6.0, 4.0, 2.0], r"do not rise together \(rank correlation -1.00"),
        ([1.0, 1.1, 1.2, 1.3], [1.0, 9.0, 2.0, 8.0], "one modulus leaves"),
    ],
)
def test_a_record_that_one_modulus_cannot_explain_is_refused(
    force: list[float], felt: list[float], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        fit_force(np.array(force), np.array(felt), "record")


def objects_of(share: float) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Three objects; the second layer tells all by one modulus, the first each by another, `share` apart."""
    force = np.tile([0.5, 1.0, 1.5], 3)
    right = force / 0.2
    given = right * np.repeat([1 - share, 1.0, 1 + share], 3)
    return force, np.stack([given, right], axis=1), list(np.repeat(["ball", "punch", "prism"], 3))


def test_objects_that_are_left_out_choose_the_layer_and_tell_its_error() -> None:
    assert chosen_layer(*objects_of(0.2)) == 1
    assert left_out_share(*objects_of(0.2)) == pytest.approx(0, abs=1e-9)
    force, felt, objects = objects_of(0.2)
    assert left_out_share(force, felt[:, :1], objects) > 0.2


def test_the_layer_that_is_given_stays_where_another_is_hardly_better() -> None:
    force, felt, objects = objects_of(0.2)
    felt[:, 1] = force / 0.2 * np.repeat([0.81, 1.0, 1.19], 3)
    assert chosen_layer(force, felt, objects) == 0


def test_the_error_is_no_smaller_than_on_objects_left_out() -> None:
    assert fit_force(0.2 * FELT, FELT, "record", least_share=0.12).error_share == pytest.approx(0.12)
