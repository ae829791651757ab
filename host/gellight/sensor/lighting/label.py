"""From what is known of clocks, camera and light to the label of a frame.

Each row is exposed for its own interval, whose ends are known within the uncertainty of stamp and clock. A row is clean
where one light surely showed from the earliest beginning to the latest end; it is mixed where the light surely changed
in between; else nothing is claimed. A frame is clean where all its rows are clean under the same group, mixed where its
rows together surely saw more than one light, and unknown otherwise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gellight.frames.camera import CameraTiming
from gellight.frames.frames import LightLabel, LightState
from gellight.sensor.lighting.clock import ClockMap
from gellight.sensor.lighting.timeline import OTHER, UNTOLD, KnownLight

Array = NDArray[np.float64]
UNKNOWN_LABEL = LightLabel(state=LightState.UNKNOWN)


class RowExposures(NamedTuple):
    """When the rows of one frame were exposed, board us: (H,) each, bounds of the beginning and of the end."""

    begin_low: Array
    begin_high: Array
    end_low: Array
    end_high: Array


def row_exposures(clock: ClockMap, timing: CameraTiming, time_s: float, rows: int) -> RowExposures:
    """Return the bounds for a frame whose stamp is `time_s`, `time.monotonic`; ValueError where `clock` is not sure."""
    offset_us = clock.offset_us(*timing.span_s(time_s))
    time_s += timing.stamp_delay_s
    begins = (time_s + timing.readout_s * np.arange(rows) / max(rows - 1, 1)) * 1e6
    ends = begins + timing.exposure_s * 1e6
    error_us = timing.stamp_error_s * 1e6
    low_us, high_us = offset_us.low - error_us, offset_us.high + error_us
    return RowExposures(begins + low_us, begins + high_us, ends + low_us, ends + high_us)


def label_of(exposed: RowExposures, light: KnownLight, pulse_period_us: float) -> LightLabel:
    """Sum the rows of a frame up, as told above; light that is no group of a sequence has no label but unknown.

    A row surely saw a light that had a whole cycle of the modulation to show.
    """
    seen: set[int] = set()
    clean = np.zeros(len(exposed.begin_low), bool)
    for from_us, to_us, what in zip(
        *light.between(float(exposed.begin_low[0]), float(exposed.end_high[-1])), strict=True
    ):
        if what == UNTOLD:
            continue
        alone = (exposed.begin_low >= from_us) & (exposed.end_high <= to_us)
        saw = np.minimum(exposed.end_low, to_us) - np.maximum(exposed.begin_high, from_us) >= pulse_period_us
        seen |= {int(what)} if (alone | saw).any() else set()
        clean |= alone
    if len(seen) > 1:
        return LightLabel(state=LightState.MIXED)
    (only,) = seen if clean.all() else {OTHER}
    return UNKNOWN_LABEL if only == OTHER else LightLabel(state=LightState.CLEAN, group=only)


def label_frame(clock: ClockMap, light: KnownLight, timing: CameraTiming, time_s: float, rows: int) -> LightLabel:
    """Label a frame by its stamp alone; unknown unless pings on both sides of it fit together."""
    if not clock.covers(*timing.span_s(time_s)):
        return UNKNOWN_LABEL
    return label_of(row_exposures(clock, timing, time_s, rows), light, timing.pulse_period_s * 1e6)
