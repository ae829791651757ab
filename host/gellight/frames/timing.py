"""When a camera exposes its rows and how LEDs pulse, as far as the host can know it: bounds, not truths."""

from dataclasses import dataclass

from gellight.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class CameraTiming:
    """The times of a rolling shutter and their uncertainty. All in s. The defaults suit a plain 30 Hz camera.

    Row r of H begins its exposure at `frame.time_s + stamp_delay_s + readout_s * r / (H - 1)` and ends it `exposure_s`
    later.
    """

    exposure_s: float = 0.008
    readout_s: float = 0.012
    """from the start of the first row to the start of the last"""
    period_s: float = 1 / 30
    """from frame to frame"""
    stamp_delay_s: float = 0.0
    """from the stamp of a frame to the start of its first row, where the camera stamps something else"""
    stamp_error_s: float = 0.001
    """largest error of the beginning and the end of a row's exposure, either way"""
    pulse_period_s: float = 0.0025
    """longest cycle of the LEDs' pulse-width modulation: a latched colour shows within it (2 kHz parts: 0.0005)"""

    def __post_init__(self) -> None:
        """Refuse what no camera does."""
        if min(self.exposure_s, self.period_s) <= 0 or min(self.readout_s, self.stamp_error_s, self.pulse_period_s) < 0:
            raise InputError(f"{self}: exposure and period have to be positive, the other times not negative")
        if self.exposure_s > self.period_s:
            raise InputError(
                f"an exposure of {self.exposure_s * 1e3:g} ms is longer than the frame period of "
                f"{self.period_s * 1e3:g} ms: shorten the exposure or lower the frame rate"
            )

    @property
    def duration_s(self) -> float:
        """From the start of the first row to the end of the last."""
        return self.readout_s + self.exposure_s

    def span_s(self, time_s: float) -> tuple[float, float]:
        """Return from when to when, at most, a frame with this stamp was exposed."""
        begin_s = time_s + self.stamp_delay_s
        return begin_s - self.stamp_error_s, begin_s + self.duration_s + self.stamp_error_s
