"""What every camera of the host promises: frames, and beyond them what its sensor can do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame
from gellight.frames.status import CameraStatus, PressStatus
from gellight.ring.light_ring import LightRing


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


class EndOfStream(CameraError):  # noqa: N818  (it is the end, not a fault)
    """The camera has delivered its last frame; more will not come."""


class ReconnectingError(CameraError):
    """The sensor is away and looked for; reading again goes on looking, and returns frames when it is back."""


class PressStage(Protocol):
    """What presses objects into the gel of a simulated sensor."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that can be pressed."""

    @property
    def max_depth_mm(self) -> float:
        """Deepest press allowed."""

    @property
    def gel_thickness_mm(self) -> float:
        """Thickness of the gel."""

    @property
    def camera_height_mm(self) -> float:
        """How high above the gel at rest the camera seems to stand from within the gel; infinite for parallel rays."""

    @property
    def window_mm(self) -> float:
        """Thickness of what the gel is lit and seen through and bends light; 0: nothing does."""

    def prepare(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Compute a press ahead, which takes up to some seconds, while frames go on."""

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press an object `depth_mm` deep at (x, y) mm from the image centre; it stays until released."""

    def drag(self, x_mm: float, y_mm: float, turn_rad: float = 0.0) -> None:
        """Move what is pressed sideways, to (x, y) mm from where it was pressed, turned by so much."""

    def release(self) -> None:
        """Lift the object off the gel."""

    def drive(self, *, on: bool) -> None:
        """Let an object slide, turn and tilt in the gel by itself, or lift it."""

    def take_over(self) -> None:
        """Lift the object, and let no programme press by itself any more."""

    def status(self) -> PressStatus:
        """Return what is pressed now."""


class CameraControls(Protocol):
    """The controls of a camera by name: `exposure_us`, `gain`, `white_balance_k`; automatic ones are off."""

    def names(self) -> tuple[str, ...]:
        """Names of the controls that this camera has."""

    def range(self, name: str) -> tuple[float, float, float]:
        """Return smallest and largest value and the step; CameraError for a control that is not there."""

    def read(self, name: str) -> float:
        """Return the value in force."""

    def set(self, name: str, value: float) -> float:
        """Set a value, read it back and return what holds now.

        Raises InputError for a value out of range and CameraError where the camera does not keep it.
        """


@runtime_checkable
class Camera(Protocol):
    """A source of camera frames; a context manager that closes its device. Cameras inherit from it."""

    url: str
    """what it was opened with"""
    image_shape: tuple[int, int]
    """(H, W) of every frame"""
    waits: bool = False
    """whether its next frame waits until it is read, as in a file: a slow reader then gets every frame, only later"""
    stage: PressStage | None = None
    """the stage of a simulated sensor; None where objects are pressed by hand"""
    ring: LightRing | None = None
    """the light ring of the same sensor, closed with the camera; None where the light cannot be driven"""
    bundle: Bundle | None = None
    """the calibration bundle that came with the frames of a recording; None for sensors, whose board names theirs"""
    controls: CameraControls | None = None
    """exposure, gain and white balance; None where there is nothing to set"""

    @property
    def bundle_files(self) -> Mapping[str, bytes]:
        """What a bundle for its frames has to hold, by file name: how they are made, the force of a simulated gel."""
        return {}

    @property
    def picture_files(self) -> Mapping[str, bytes]:
        """What a bundle has to hold so that its pictures are prepared, by file name: the dots of a simulated gel."""
        return {}

    @property
    def timing(self) -> CameraTiming | None:
        """When its rows are exposed, for labels of light; None where it is not known."""
        return None

    def read(self) -> CameraFrame:
        """Wait for the next frame; raises EndOfStream after the last one and CameraError on a fault."""

    def status(self) -> CameraStatus:
        """Return what is known of the device, ready for JSON; nothing where there is none."""
        return {}

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        """Set and light the sensor like this from now on: what is read next was exposed after that.

        `controls` by name; those that are not named stay as they are. `colours` (12, 3) uint8 RGB of the LEDs, None:
        dark; a camera without a ring keeps its light. May be called from any thread. Raises CameraError for a control
        that the camera does not have or keep, InputError for a value out of range, BoardError where the ring does not
        shine as asked.
        """
        set_controls(self, controls)
        if self.ring is not None:
            self.ring.light(colours)

    def hurry(self) -> None:
        """Let a `read` that waits in another thread for the time of its frame return soon: nobody wants it any more."""
        return

    def close(self) -> None:
        """Release the device; reading afterwards raises CameraError."""

    def __enter__(self) -> Self:
        """Give the camera itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the camera."""
        self.close()


def controls_of(camera: Camera) -> dict[str, float]:
    """Return the controls in force, by name."""
    controls = camera.controls
    return {} if controls is None else {name: controls.read(name) for name in controls.names()}


ChooseBundle = Callable[[Camera], Bundle | None]
"""chooses the bundle of a camera whose board can be asked already; None where it has none"""


def set_controls(camera: Camera, controls: Mapping[str, float]) -> bool:
    """Set controls by name, and return whether one of them has changed.

    Raises CameraError for one that the camera does not have, before any is set, and otherwise as `CameraControls.set`.
    """
    theirs = camera.controls
    known = theirs.names() if theirs else ()
    for name in controls:
        if name not in known:
            raise CameraError(f"{camera.url} has no control {name!r}, which the calibration needs: use the same camera")
    if theirs is None:
        return False
    before = {name: theirs.read(name) for name in controls}
    return before != {name: theirs.set(name, value) for name, value in controls.items()}


def timing_of(camera: Camera) -> CameraTiming:
    """Return what the camera tells of itself, with the exposure its controls tell, where they do.

    Raises InputError where the exposure is longer than the frame period.
    """
    known = camera.timing or CameraTiming()
    if camera.controls is None or "exposure_us" not in camera.controls.names():
        return known
    return replace(known, exposure_s=camera.controls.read("exposure_us") * 1e-6)
