"""Which share of the slopes beside contacts counts: by how deep presses held out are felt with all of them."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from gellight.lab.training.indentation import Indentation
from gellight.lab.training.skirts import find_skirts, skirt_words


@pytest.mark.parametrize(
    ("felt", "skirt", "share"),
    [
        ([1.76] * 5, 1.0, 0.24),
        ([1.149] * 5, 0.5, 1.0),
        ([1.151] * 5, 0.5, 0.70),
        ([0.851] * 5, 0.5, 1.0),
        ([0.84] * 5, 0.5, 1.32),
        ([0.6] * 5, 0.5, 1.5),
        ([3.0] * 5, 1.0, 0.05),
        ([1.76] * 3, 1.0, 1.0),
        ([1.76] * 4, 1.0, 0.24),
    ],
)
def test_skirts_count_so_much_that_presses_are_felt_as_deep_as_they_are(
    felt: Sequence[float], skirt: float, share: float
) -> None:
    """Presses felt `felt` times as deep as they are, of which `skirt` comes from beside the contact."""

    def errors_at(counted: float) -> list[Any]:
        shares = [one - (1 - counted) * skirt for one in felt]
        return [SimpleNamespace(indentation=Indentation(felt_mm=one, expected_mm=1.0)) for one in shares]

    found = find_skirts(errors_at)
    assert found.share == share
    assert found.errors[0].indentation.felt_mm == pytest.approx(felt[0] - (1 - share) * skirt)
    told = skirt_words({"held_out": found.record()})
    assert [f"{felt[0]:.2f} times as deep" in words for words in told] == ([] if share == 1 else [True])


def test_where_nobody_knows_the_gel_all_slopes_count() -> None:
    errors = [SimpleNamespace(indentation=None)] * 9
    assert find_skirts(lambda counted: errors).share == 1.0  # type: ignore[arg-type, return-value]
    assert skirt_words({"held_out": None}) == []
