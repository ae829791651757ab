"""Light groups light each LED once, and the three of a colour triple stand 120 degrees apart."""

import numpy as np
import pytest

from gellight.ring.light_groups import colour_triples, single_leds

RING = np.repeat(200 * np.eye(3, dtype=np.uint8), 4, axis=0)


@pytest.mark.parametrize("groups", [single_leds(RING), colour_triples(RING)], ids=["single", "triples"])
def test_the_groups_together_are_the_whole_ring(groups: np.ndarray) -> None:
    assert (groups.sum(axis=0) == RING).all()


def test_a_triple_has_three_colours_120_degrees_apart() -> None:
    for group in colour_triples(RING):
        leds = np.flatnonzero(group.any(axis=1))
        assert (np.diff(leds) == 4).all()
        assert (group[leds] == 200 * np.eye(3)).all()


def test_a_ring_of_mixed_colours_has_no_triples() -> None:
    with pytest.raises(ValueError, match="one pure colour"):
        colour_triples(np.full((12, 3), 9, np.uint8))
