"""Tactile frames of one smooth hill, as deep as is asked for."""

from dataclasses import replace

import numpy as np

from gellight.frames.frames import Provenance, TactileFrame
from tests.helpers.tactile import tactile

SHAPE = (48, 64)
HILL = np.exp(-(((np.indices(SHAPE) - [[[24]], [[32]]]) / 10.0) ** 2).sum(axis=0))


def frame(deep_mm: float, noise: float = 0.0, seed: int = 0) -> TactileFrame:
    """Return the frame of the hill, with noise of the depth, mm."""
    depth = deep_mm * HILL + noise * np.random.default_rng(seed).standard_normal(SHAPE)
    felt = tactile(depth, mask=depth > 0.1, sequence=seed)
    made = Provenance(calibration="a", zero="b", pixel_size_mm=(0.06, 0.06), unix_s=0.0, ages_s={})
    return replace(felt, contact=replace(felt.contact, indentation_mm=deep_mm), provenance=made)
