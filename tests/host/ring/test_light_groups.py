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


@pytest.mark.parametrize("ring", ["RGB", "RRRGGGBB", "RGBBBB", "RGGRBBRGR"])
def test_unequal_colours_are_used_again_so_that_every_led_shines(ring: str) -> None:
    colours = np.array([[200 * (own == channel) for channel in "RGB"] for own in ring], np.uint8)
    groups = colour_triples(colours)
    assert len(groups) == max(map(ring.count, "RGB"))
    assert (groups.any(axis=0) == (colours > 0)).all()
    for group in groups:
        assert group.sum(axis=0).tolist() == [200, 200, 200]


def test_a_ring_without_blue_has_no_triples() -> None:
    with pytest.raises(ValueError, match="at least one of red, green and blue"):
        colour_triples(RING[:8])


def test_a_ring_of_mixed_colours_has_no_triples() -> None:
    with pytest.raises(ValueError, match="one pure colour"):
        colour_triples(np.full((12, 3), 9, np.uint8))
