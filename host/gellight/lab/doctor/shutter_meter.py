"""Measure a rolling shutter by its own pictures of a changing light: exposure, readout, and what the stamp means.

In a frame during which light A gave way to light B at a time t after the stamp, the row at the height x (0 top, 1
bottom) has the share

    u = (R x + d + E - t) / E           (0 before, 1 after)

of B, with the readout R, the exposure E and the delay d from stamp to start. So

    t = R x + E (1 - u) + d

is linear, and a few dozen mixed frames at any phase tell all three. It is solved for t, which the jitter of the stamps
disturbs; x and u are known well.

Light adds up. So u follows for each row band from the pictures that the gel gives under each light alone:

    min |w (y - A (1 - u, u))|      y: cells of the band, A: the same cells of both reference images

Cells that do not fit, for a finger may come to the gel, are weighted down (w, Cauchy's weights).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import Camera, CameraTiming
from gellight.frames.pixel_grid import area_means
from gellight.ring.enumerations import SyncMode
from gellight.ring.light_ring import Step
from gellight.sensor.lighting.hold import expose, ring_in_hand
from gellight.sensor.lighting.light_watch import LightWatch

Array = NDArray[np.float64]
Image = NDArray[np.uint8] | NDArray[np.float32]
BANDS, CELLS = 16, 32  # chosen: of rows, each seen at its own time, and cells along a band
ROUNDS = 4  # chosen: of weighting by what the one before left
NOISE_GREY, SHADING = 0.15, 0.05
"""error of a cell: grey levels of noise, and the share of its level by drift and reflexes"""
FITTING = 0.6
"""a band says something where this share of its cells fit"""
FEWEST_BANDS = 60  # chosen: twenty for each of three unknowns
BETWEEN = (0.08, 0.92)
"""shares outside are as good as 0 and 1"""
BACKWARDS = -0.002
"""share a band; as far as that of a global shutter scatters below 0"""
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

    def timing(self, known: CameraTiming) -> CameraTiming:
        """Return `known` with what was measured; the stamp may be off by three times the scatter."""
        return replace(
            known, exposure_s=self.exposure_s, readout_s=self.readout_s, stamp_delay_s=self.delay_s,
            stamp_error_s=max(3 * self.scatter_s, 1e-4),
        )  # fmt: skip


class TwoLights:
    """Tells how much of each of two lights is in the row bands of a picture."""

    def __init__(self, references: tuple[Image, Image]) -> None:
        """Take one (H, W, 3) picture under each; InputError where they look the same, or show nothing."""
        self._basis = np.stack([cells(image) for image in references], axis=2)
        columns = self._basis.reshape(-1, 2)
        norms = np.linalg.norm(columns, axis=0)
        if (norms < np.sqrt(len(columns))).any():  # less than 1 grey level
            raise InputError(f"light group {int(norms.argmin())} is dark in its picture: choose a brighter one")
        if columns[:, 0] @ columns[:, 1] / norms.prod() > 0.999:
            raise InputError("the two light groups look the same in their pictures: choose LEDs on opposite sides")

    def amounts(self, image: Image) -> Array:
        """Return (BANDS, 2) how much of each light is in (H, W, 3); NaN for a band that neither explains."""
        observed = cells(image)
        scale = NOISE_GREY + SHADING * observed
        found = np.stack([robust_fit(*band) for band in zip(self._basis, observed, scale, strict=True)])
        misfit = np.abs(observed - np.einsum("bcn,bn->bc", self._basis, found)) / scale
        found[(misfit < 1.5).mean(axis=1) < FITTING] = np.nan
        return found


def cells(image: Image) -> Array:
    """Return the mean of the cells of each row band of (H, W, 3): (BANDS, CELLS * 3) grey levels."""
    height, width = image.shape[:2]
    if height < BANDS or width < CELLS:
        raise InputError(f"an image of {width} x {height} px is too small to measure the shutter")
    return area_means(image.astype(np.float32), (BANDS, CELLS)).reshape(BANDS, CELLS * 3).astype(np.float64)


def robust_fit(basis: Array, observed: Array, scale: Array) -> Array:
    """Return x >= 0, (n,), for observed (m,) ~ basis (m, n) x, with Cauchy's weights against cells that are touched."""
    weight = 1 / scale
    for _ in range(ROUNDS):
        found, _ = nnls(basis * weight[:, None], observed * weight)
        misfit = np.abs(observed - basis @ found) / scale
        weight = 1 / (scale * np.sqrt(1 + (misfit / max(1.5 * float(np.median(misfit)), 1.0)) ** 2))
    return np.asarray(found)


class ShutterMeter:
    """Collects frames in which the light changed."""

    def __init__(self) -> None:
        """Begin without any."""
        self._samples: list[tuple[float, float, float]] = []

    def add(self, amounts: Array, old: int, new: int, change_s: float) -> int:
        """Take in a frame in which light `old` gave way to `new` `change_s` after its stamp; return how many bands.

        `amounts`, (BANDS, 2), is of `TwoLights`.
        """
        told = np.isfinite(amounts).all(axis=1)
        share = amounts[:, new] / np.maximum(amounts[:, [old, new]].sum(axis=1), 1e-9)
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
                               delay_s=float(delay_s), scatter_s=scatter_s)  # fmt: skip


def measure_shutter(
    camera: Camera, groups: NDArray[np.uint8], *, timing: CameraTiming | None = None, frames: int = 60
) -> ShutterEstimate:
    """Measure the shutter of `camera` with two light groups, (2, 12, 3) uint8, that look different.

    Takes their reference images on the spot, then `frames` frames while they alternate. The light is given back.
    Only the frame period and the pulse period of `timing` are used. Raises CameraError without a ring or a result.
    """
    known = timing or CameraTiming()
    doubted = replace(known, stamp_error_s=max(known.stamp_error_s, known.period_s))
    with ring_in_hand(camera):
        one, other = (expose(camera, group, number, timing=doubted)[0].image for number, group in enumerate(groups))
        return _watch_changes(camera, groups, known, TwoLights((one, other)), frames)


def _watch_changes(
    camera: Camera, groups: NDArray[np.uint8], known: CameraTiming, lights: TwoLights, frames: int
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
            amounts = lights.amounts(frame.image)
            changes = [change for change in watch.changes() if max(change.old, change.new) < len(groups)]
            shown = [change.latched_s.middle + known.pulse_period_s / 2 - frame.time_s for change in changes]
            for change, shown_s in sorted(zip(changes, shown, strict=True), key=lambda pair: abs(pair[1])):
                if abs(shown_s) < dwell_us * 1e-6 and meter.add(amounts, change.old, change.new, shown_s):
                    break
    finally:
        watch.close()
        ring.blank()  # ends the sequence, so that the light of before can be given back
    return meter.estimate()
