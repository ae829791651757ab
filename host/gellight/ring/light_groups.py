"""Light groups: which LEDs of the ring shine together during one exposure of photometric stereo.

A set of groups is an array (n, leds, 3) uint8: RGB of every LED for each of n exposures. A colour camera tells the
three colours apart, so that one exposure can hold three lights at once.
"""

import numpy as np
from numpy.typing import NDArray

Groups = NDArray[np.uint8]


def single_leds(colours: NDArray[np.uint8]) -> Groups:
    """Return one group for each LED of a ring that is lit in (n, 3) `colours`: (n, n, 3)."""
    return np.asarray(np.eye(len(colours), dtype=np.uint8)[:, :, None] * colours, np.uint8)


def colour_triples(colours: NDArray[np.uint8]) -> Groups:
    """Return groups of one red, one green and one blue LED, as many as the most frequent colour has LEDs: (k, n, 3).

    On the paper's ring (RRRRGGGGBBBB) the three LEDs of a group are 120 degrees apart, and each is used once. Where the
    colours are not equally many, LEDs of the rarer ones are used again. Raises ValueError unless every LED has exactly
    one colour and each colour is there.
    """
    hue, lit = np.argmax(colours, axis=1), colours > 0
    members = [np.flatnonzero(hue == channel) for channel in range(3)]
    if (lit.sum(axis=1) != 1).any() or not all(len(leds) for leds in members):
        raise ValueError("the ring needs LEDs of one pure colour each, and at least one of red, green and blue")
    groups = np.zeros((max(map(len, members)), len(colours), 3), np.uint8)
    for index, group in enumerate(groups):
        leds = [own[index * len(own) // len(groups)] for own in members]
        group[leds] = colours[leds]
    return groups
