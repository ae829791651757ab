"""What GelNet has learnt, as arrays: the same whichever trainer trained it, and all that its file needs."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
CHANNELS = ("dR", "dG", "dB")
PLACE = ("x_px", "y_px")
LAYERS = 5
STEEPEST_RAD = 1.5
"""No slope beyond 86 degrees: the largest angle that training may ask for."""
HEADROOM = 1.05
"""Room above the steepest training slope, so that the tanh is not saturated there."""
LEAST_SPREAD = 1e-6
"""An input that varies less than this is not divided by its spread."""


class Layer(NamedTuple):
    """One fully connected layer."""

    weight: Floats
    """(units, inputs)"""
    bias: Floats
    """(units,)"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """A network: its layers, and the range of its inputs and output."""

    layers: tuple[Layer, ...]
    centre: Floats
    """(C + 2,) subtracted from the inputs"""
    scale: Floats
    """(C + 2,) the inputs are then divided by it"""
    steepest_rad: float
    """the last tanh times this is the angle of the slope"""

    @property
    def width(self) -> int:
        """Units in each hidden layer."""
        return len(self.layers[0].bias)


def channel_names(count: int) -> tuple[str, ...]:
    """Return the names of `count` channels: the colours, or the lights by number where they are not three."""
    return CHANNELS if count == len(CHANNELS) else tuple(f"d{number}" for number in range(1, count + 1))


def layer_sizes(width: int, inputs: int) -> list[tuple[int, int]]:
    """Return (inputs, units) of each layer; ValueError for a width below 1."""
    if width < 1:
        raise ValueError(f"width {width}: a layer needs at least 1 unit")
    return list(pairwise([inputs, *[width] * (LAYERS - 1), 2]))
