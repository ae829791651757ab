"""Measure a rolling shutter by its own pictures of a changing light: exposure, readout, and what the stamp means.

In a frame during which light A gave way to light B at a time t after the stamp, the row at the height x (0 top, 1
bottom) has the share

    u = (R x + d + E - t) / E           (0 before, 1 after)

of B, with the readout R, the exposure E and the delay d from stamp to start. So

    t = R x + E (1 - u) + d

is linear, and a few dozen mixed frames at any phase tell all three. It is solved for t, which the jitter of the stamps
disturbs; x and u are known well.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.frames.camera import Camera
from gellight.frames.timing import CameraTiming
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import Step
from gellight.sensor.lighting.content import BANDS, Content, ContentCheck
from gellight.sensor.lighting.hold import Hold
from gellight.sensor.lighting.light_watch import LightWatch

FEWEST_BANDS = 60
BETWEEN = (0.08, 0.92)
"""shares outside are as good as 0 and 1"""
TWO_LIGHTS = 0.85
"""a band belongs to a change when both lights together make up so much of it"""
BACKWARDS = -0.002
"""share a band; a global shutter may scatter so much about 0"""
FRAMES_A_LIGHT = 2.37
"""no simple ratio, so that the changes fall on every phase of the frames"""
STEPS, LONGER = 16, 0.157
"""each step is longer by this part of a pulse period, so that the changes fall on every phase of every LED's pulses"""


@dataclass(frozen=True, kw_only=True)
class ShutterEstimate:
    """What was measured, s."""

    exposure_s: float
    readout_s: float
    delay_s: float
    """from the stamp to the start of the first row"""
    scatter_s: float
    """standard deviation of the bands about the model, as a time"""
    bands: int

    def timing(self, known: CameraTiming) -> CameraTiming:
        """Return `known` with what was measured; the stamp may be off by three times the scatter."""
        return replace(
            known, exposure_s=self.exposure_s, readout_s=self.readout_s, stamp_delay_s=self.delay_s,
            stamp_error_s=max(3 * self.scatter_s, 1e-4),
        )  # fmt: skip


class ShutterMeter:
    """Collects frames in which the light changed."""

    def __init__(self) -> None:
        """Begin without any."""
        self._samples: list[tuple[float, float, float]] = []

    def add(self, content: Content, old: int, new: int, change_s: float) -> int:
        """Take in a frame in which group `old` gave way to `new` `change_s` after its stamp; return how many bands."""
        both = content.coefficients[:, [old, new]].sum(axis=1)
        total = np.maximum(content.coefficients.sum(axis=1), 1e-9)
        share = content.coefficients[:, new] / np.maximum(both, 1e-9)
        told = (both / total > TWO_LIGHTS) & (content.fitting > 0.6)
        if told.sum() < 3 or np.polyfit(np.flatnonzero(told), share[told], 1)[0] < BACKWARDS:
            return 0  # rows further down see later light: this is another change, the other way round
        used = told & (share > BETWEEN[0]) & (share < BETWEEN[1])
        self._samples += [((band + 0.5) / BANDS, change_s, float(share[band])) for band in np.flatnonzero(used)]
        return int(used.sum())

    def estimate(self) -> ShutterEstimate:
        """Solve for the shutter; CameraError where too few bands saw a change, or what they saw is no shutter."""
        if len(self._samples) < FEWEST_BANDS:
            raise CameraError(
                f"only {len(self._samples)} row bands saw the light change, {FEWEST_BANDS} are needed: "
                "take more frames, and check that ring and camera belong to one sensor"
            )
        height, change_s, share = np.array(self._samples).T
        design, kept = np.column_stack([height, 1 - share, np.ones(len(share))]), np.ones(len(share), bool)
        for _ in range(3):
            solution = np.linalg.lstsq(design[kept], change_s[kept], rcond=None)[0]
            misfit_s = change_s - design @ solution
            kept = np.abs(misfit_s) < 3 * max(1.4826 * float(np.median(np.abs(misfit_s))), 1e-5)
        (readout_s, exposure_s, delay_s), scatter_s = solution, float(misfit_s[kept].std())
        if exposure_s < 2 * scatter_s or readout_s < -3 * scatter_s:
            raise CameraError("the pictures do not follow the light: are the stamps of this camera times at all?")
        return ShutterEstimate(exposure_s=float(exposure_s), readout_s=max(float(readout_s), 0.0),
                               delay_s=float(delay_s), scatter_s=scatter_s, bands=int(kept.sum()))  # fmt: skip


def measure_shutter(
    camera: Camera, groups: NDArray[np.uint8], *, timing: CameraTiming | None = None, frames: int = 60
) -> ShutterEstimate:
    """Measure the shutter of `camera` with two light groups, (2, 12, 3) uint8, that look different.

    Takes their reference images on the spot, then `frames` frames while they alternate. The light is given back.
    Only the frame period and the pulse period of `timing` are used. Raises CameraError without a ring or a result.
    """
    known = timing or CameraTiming()
    with Hold(camera, timing=replace(known, stamp_error_s=known.period_s)) as hold:
        check = ContentCheck([hold.expose(group, number)[0].image for number, group in enumerate(groups)])
        return _watch_changes(camera, groups, known, check, frames)


def _watch_changes(
    camera: Camera, groups: NDArray[np.uint8], known: CameraTiming, check: ContentCheck, frames: int
) -> ShutterEstimate:
    assert camera.ring is not None
    ring, meter = camera.ring, ShutterMeter()
    watch = LightWatch(ring, known)
    dwell_us = round(FRAMES_A_LIGHT * known.period_s * 1e6)
    try:
        longer_us = LONGER * known.pulse_period_s * 1e6
        ring.load_sequence(
            list(groups), [Step(group=k % 2, dwell_us=dwell_us + round(k * longer_us)) for k in range(STEPS)]
        )
        ring.set_sync(SyncMode.FREE)
        ring.start()
        for _ in range(frames):
            frame = camera.read()
            ring.status()
            content = check.read(frame.image)
            changes = [change for change in watch.changes() if max(change.old, change.new) < len(groups)]
            shown = [change.latched_s.middle + known.pulse_period_s / 2 - frame.time_s for change in changes]
            for change, shown_s in sorted(zip(changes, shown, strict=True), key=lambda pair: abs(pair[1])):
                if abs(shown_s) < dwell_us * 1e-6 and meter.add(content, change.old, change.new, shown_s):
                    break
    finally:
        watch.close()
        ring.blank()  # ends the sequence, so that the light of before can be given back
    return meter.estimate()
