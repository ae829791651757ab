"""How high the gel stands as a whole, from the light alone.

Slopes leave it open. As long as part of the view is untouched, that part is 0. An object that fills the view leaves no
such part, but the light is near: gel that comes closer to the ring is lit from lower angles, and near LEDs gain on far
ones, by a per cent in 0.1 mm. Twelve lights overdetermine the three unknowns of a pixel, so a wrong height shows as a
misfit, which is smallest at the right one. On the gel at rest the model fits by its making, whatever is wrong with the
positions of the LEDs; such errors scale the height that is found by a few per cent, and do not shift its zero.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.photometric.light_model import Bools, Floats, Signals
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.solver import Points, light_rows, predict, solve_robustly

Indices = NDArray[np.intp]
SAMPLES = 2500
"""pixels that are compared; they give the height to 0.007 mm"""
LEAST_LIGHTS = 8  # chosen: five more than a pixel has unknowns, for a wrong height to show
LEAST_SAMPLES = 200  # chosen: pixels; with fewer the height stays open
STEPS_MM = (0.2, 0.2, 0.1)  # chosen: of Newton's method, one after the other, for the differences
LONGEST_STEP_MM = 0.5  # chosen: a curvature near 0 would throw it farther
OUTLIER_SQUARED = 9.0
"""squared residual in units of the noise beyond which more does not count: the edges of shadows"""
TOLERANCE_MM = 0.05  # chosen: seven times what SAMPLES give the height to
CERTAIN_DEVIATIONS = 5.0  # chosen: normal noise passes once in 1.7 million


@dataclass(frozen=True)
class Level:
    """An offset to all depths, and its standard deviation as the noise of the pictures makes it."""

    offset_mm: float
    deviation_mm: float

    @property
    def correction_mm(self) -> float:
        """The offset if it is certain and not small, else 0: gel at rest is the better judge of small ones."""
        certain = abs(self.offset_mm) > max(TOLERANCE_MM, CERTAIN_DEVIATIONS * self.deviation_mm)
        return self.offset_mm if certain else 0.0


Places = Callable[[Indices, Floats], Points]
"""Where the gel is that pixels see, so deep, mm: with the height it moves along their rays"""


def find_level(signals: Signals, references: Floats, depth_mm: Floats, places: Places, ring: RingGeometry) -> Level:
    """Return the offset to the depths (N,) of all pixels under which the exposures fit one surface best."""
    chosen = samples(signals.valid)
    if len(chosen) < LEAST_SAMPLES:
        return Level(0.0, np.inf)
    misfit = _misfit_at(chosen, signals, references, depth_mm, places, ring)
    offset, curvature = 0.0, 0.0
    for step in STEPS_MM:
        below, here, above = (misfit(offset + sign * step) for sign in (-1, 0, 1))
        curvature = (below - 2 * here + above) / step**2
        if curvature <= 0:
            return Level(0.0, np.inf)
        move = (below - above) / (2 * step * curvature)
        offset += float(np.clip(move, -LONGEST_STEP_MM, LONGEST_STEP_MM))
    return Level(offset, float(np.sqrt(2 / curvature)))


def samples(valid: Bools) -> Indices:
    """Return some `SAMPLES` indices of pixels that at least eight lights reach, evenly over the view."""
    # An odd stride, which does not fall into step with the rows of the picture.
    stride = max(1, valid.shape[1] // SAMPLES) | 1
    chosen = np.arange(0, valid.shape[1], stride)
    return np.asarray(chosen[valid[:, chosen].sum(axis=0) >= LEAST_LIGHTS])


def _misfit_at(
    chosen: Indices, signals: Signals, references: Floats, depth_mm: Floats, places: Places, ring: RingGeometry
) -> Callable[[float], float]:
    """Return the function from an offset in mm to the sum of squared residuals in units of the noise."""
    grey, valid, light = signals.grey[:, chosen], signals.valid[:, chosen], references[:, chosen]
    deviation = signals.deviation.astype(np.float32)

    def misfit(offset: float) -> float:
        rows = light_rows(places(chosen, depth_mm[chosen] + np.float32(offset)), light, ring)
        scaled, used = solve_robustly(grey, rows, valid, deviation)
        wrong = (grey - predict(rows, scaled)) / deviation[:, None]
        return float((np.minimum(wrong**2, OUTLIER_SQUARED) * used).sum(dtype=np.float64))

    return misfit
