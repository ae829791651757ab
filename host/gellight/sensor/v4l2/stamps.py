"""When the exposure of a picture began, from what the driver's time stamp means.

A stamp is one of these:

- the start of the exposure: drivers of sensors say so by a flag. So does uvcvideo with hardware time stamps (its module
  parameter `hwtimestamps`), which come from the camera's own clock.
- the first USB packet of the picture: what uvcvideo stamps otherwise, with the same flag. A rolling shutter sends its
  first row when that row's exposure has ended. So the exposure began one exposure earlier, or `delay_us` more where the
  camera compresses or stores the picture first.
- the end of the frame: one readout and one exposure after its start.
- false: not on the right clock, or not later than the one before. Then the start is estimated so that it is never too
  late: the picture came after the driver was last found without one, and was held back for at most a period.

The driver does not know `delay_us` and `readout_us`: `gellight doctor` measures them against the light ring. Without
them the delay is taken as 0 and the readout as a whole frame period. `stamp_error_us` bounds how far a stamp may be
off; `cadence` measures how regularly stamps really come.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gellight.frames.camera import CameraTiming
from gellight.sensor.v4l2.stream import Picture

STAMP_ERROR_S = 0.002
"""of a stamp whose meaning is known, where nothing else is said: scheduling of the USB and of the interrupt"""


@dataclass(frozen=True, kw_only=True)
class StampMeaning:
    """How a camera's stamps and the start of the first row's exposure are related, as the camera is set now."""

    hardware_stamps: bool
    """a stamp that is said to be the start of the exposure is that, not the first packet"""
    period_s: float
    exposure_s: float | None = None
    """None where the camera does not report it: then a whole period is taken, the longest it can be"""
    delay_s: float | None = None
    """None where it was not measured: then 0 is taken, the shortest it can be"""
    readout_s: float | None = None
    """None where it was not measured: then a whole period is taken, the longest it can be"""
    stamp_error_s: float = STAMP_ERROR_S
    """that a stamp may be off by, either way"""

    @property
    def _longest(self) -> tuple[float, float]:
        """Exposure and readout, s; a whole period where one is not known."""
        exposure_s = self.period_s if self.exposure_s is None else self.exposure_s
        return exposure_s, self.period_s if self.readout_s is None else self.readout_s

    def start_s(self, picture: Picture) -> float:
        """Return when the exposure of the first row began, s on the clock of `time.monotonic`."""
        (exposure_s, readout_s), delay_s = self._longest, self.delay_s or 0.0
        if not picture.stamp_is_sound:
            return picture.absent_s - self.period_s - readout_s - exposure_s - delay_s
        if not picture.stamp_is_start:
            return picture.stamp_s - readout_s - exposure_s - delay_s
        return picture.stamp_s - delay_s - (0.0 if self.hardware_stamps else exposure_s)

    def camera_timing(self) -> CameraTiming:
        """Return the times that tell the light of a frame, with a whole period of doubt for each that is not known.

        Cameras hold a picture back for at most about a period; a camera that stamps the start needs no delay.
        """
        exposure_s, readout_s = self._longest
        unknown = [self.exposure_s, self.readout_s, 0.0 if self.hardware_stamps else self.delay_s].count(None)
        return CameraTiming(
            exposure_s=exposure_s,
            readout_s=readout_s,
            period_s=self.period_s,
            stamp_error_s=self.stamp_error_s + unknown * self.period_s,
        )


@dataclass(frozen=True, kw_only=True)
class Cadence:
    """How regularly the stamps of a camera come."""

    period_s: float
    """the usual one"""
    wander_s: float
    """distance from a steady rate that 95 % of the stamps keep"""
    farthest_s: float
    """that all of them keep"""
    left_out: int
    """pictures that are missing between stamps although the driver numbered the others without a gap"""


def cadence(pictures: Sequence[Picture]) -> Cadence:
    """Compare the stamps of at least two pictures with the steady rate that fits them best (least squares)."""
    stamps_s = np.array([picture.stamp_s for picture in pictures])
    steps = np.maximum(np.diff([picture.sequence for picture in pictures]), 1)
    period_s = max(float(np.median(np.diff(stamps_s) / steps)), 1e-6)
    periods = np.maximum(np.rint(np.diff(stamps_s) / period_s), steps)
    places = np.concatenate([[0.0], np.cumsum(periods)])
    off_s = np.abs(stamps_s - np.polyval(np.polyfit(places, stamps_s, 1), places))
    return Cadence(period_s=period_s, wander_s=float(np.percentile(off_s, 95)), farthest_s=float(off_s.max()),
                   left_out=int((periods - steps).sum()))  # fmt: skip


def hardware_stamps(driver: str, *, sysfs: Path = Path("/sys")) -> bool:
    """Whether a stamp of `driver` that is said to be the start of the exposure is taken at its word."""
    if driver != "uvcvideo":
        return True
    try:
        setting = (sysfs / "module/uvcvideo/parameters/hwtimestamps").read_text().strip()
    except OSError:
        return False
    return setting not in ("0", "N")
