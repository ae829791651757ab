"""What happens on the gel, from frame to frame: touched or free, moving or still, too bright or too dark."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame
from gellight.frames.pixel_grid import block_means
from gellight.lab.calibration.records import UntouchedGel
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.reconstruction.light_drift import difference_of

Floats = NDArray[np.float32]
BLOCK_PX = 4
"""changes are looked for in means over blocks of 4 x 4 px, whose noise is a quarter"""
STILL_FRAMES = 3
"""without movement, after which a capture begins"""
MEAN_FRAMES = 4
"""averaged for a press"""
PATIENCE_FRAMES = 150
"""in which something may be wrong before the user is told"""
_SIGMAS = 6.0  # chosen: normal noise of a block passes once in 500 million
_LEAST_CHANGE_GREY = 1.5  # chosen: however quiet the camera is
_TOUCHED_SHARE = 0.0015  # chosen: 28 of the 19,200 blocks of 640 x 480
_CLIPPED_SHARE = 0.002  # chosen: glints may clip, a surface may not
_DARK_GREY = 12.0  # chosen: LEDs or exposure are off, or the lens has its cap on


@dataclass(frozen=True, kw_only=True)
class GelState:
    """What one frame shows."""

    touched: float
    """share of the view that differs from the reference by more than noise and a change of all the light"""
    moved: float
    """share of the view that differs from the frame before by more than noise"""

    @property
    def free(self) -> bool:
        """Nothing touches."""
        return self.touched < _TOUCHED_SHARE

    @property
    def still(self) -> bool:
        """Nothing moves."""
        return self.moved < _TOUCHED_SHARE


class TouchDetector:
    """Compares every frame with the untouched gel and with the frame before."""

    def __init__(self, reference: Floats, noise_grey: float) -> None:
        """Compare with the reference, (H, W, 3) grey levels."""
        self._reference = block_means(reference, BLOCK_PX)
        self._threshold = max(_LEAST_CHANGE_GREY, _SIGMAS * noise_grey / BLOCK_PX)
        self._last: Floats | None = None

    def look(self, frame: CameraFrame) -> GelState:
        """Judge the next frame; the first one counts as moving."""
        seen = block_means(frame.image, BLOCK_PX)
        difference = difference_of(seen, self._reference, follow_light=True)
        touched = np.abs(difference).max(axis=2) > self._threshold
        change = np.inf if self._last is None else np.abs(seen - self._last).max(axis=2)
        self._last = seen
        return GelState(touched=float(touched.mean()), moved=float(np.mean(change > 1.5 * self._threshold)))


def detector_of(run: CalibrationRun) -> TouchDetector:
    """Return what compares frames with the reference of a calibration."""
    return TouchDetector(run.folder.reference(), run.folder.figures(UntouchedGel).noise_grey)


@dataclass(frozen=True, kw_only=True, eq=False)
class Capture:
    """A press that held still."""

    image: NDArray[np.uint8]
    """(H, W, 3) mean of the frames"""
    frame: CameraFrame
    """the last of them"""


def _looks(
    run: CalibrationRun, detector: TouchDetector, patience: int = PATIENCE_FRAMES
) -> Iterator[tuple[CameraFrame, GelState | None]]:
    """Yield every frame with what it shows of the gel, None where it is dark: the ring lights again by itself.

    Raises InputError after more than `patience` dark frames in a row.
    """
    dark = 0
    while True:
        frame = run.frame()
        gel = detector.look(frame)
        run.display.show(live=frame.image)
        dark = dark + 1 if is_dark(frame.image) else 0
        if dark > patience:
            check_light(frame.image, "the gel")
        yield frame, None if dark else gel


def wait_free(run: CalibrationRun, detector: TouchDetector, *, patience: int = PATIENCE_FRAMES) -> None:
    """Wait until nothing touches; after `patience` frames say what may be wrong."""
    complained = False
    run.display.update(awaiting="lift")
    for count, gel in enumerate(gel for _, gel in _looks(run, detector, patience) if gel is not None):
        if gel.free and gel.still:
            run.display.update(problem="" if complained else run.display.shown.problem, awaiting="")
            return
        if count >= patience and not complained:
            problem = (
                f"{gel.touched:.0%} of the gel still looks touched: lift the tool and wipe the gel; if nothing "
                "touches it, something lay on it when the reference was taken: stop and begin again"
            )
            run.refuse(InputError(problem))
            complained = True


def wait_press(run: CalibrationRun, detector: TouchDetector, ended: Callable[[], bool]) -> Capture | None:
    """Wait for a press that holds still, and average it; None when `ended` says so first.

    Where it moves while it is captured, the user is told so, and it is waited for again.
    """
    still, taken = 0, list[CameraFrame]()
    run.display.update(awaiting="press")
    for frame, gel in _looks(run, detector):
        if ended():
            break
        if gel is None or gel.free:
            still, taken = 0, []
        elif not gel.still:
            if taken:
                run.display.update(problem="it moved while it was captured: hold the tool still, or lift and repeat")
            still, taken = 0, []
        elif still < STILL_FRAMES:
            still += 1
        else:
            taken.append(frame)
            if len(taken) == MEAN_FRAMES:
                break
    run.display.update(awaiting="")
    return Capture(image=mean_image(taken), frame=taken[-1]) if len(taken) == MEAN_FRAMES else None


@contextmanager
def next_press(
    run: CalibrationRun,
    detector: TouchDetector,
    press: Callable[[VirtualHand], None],
    ended: Callable[[], bool] = lambda: False,
) -> Iterator[Capture | None]:
    """Wait until nothing touches, then for the next press; a virtual hand does `press`, and lifts however it ends."""
    wait_free(run, detector)
    try:
        if run.hand:
            press(run.hand)
        yield wait_press(run, detector, ended)
    finally:
        if run.hand:
            run.hand.lift()


def mean_image(frames: list[CameraFrame]) -> NDArray[np.uint8]:
    """(H, W, 3) mean, rounded to grey levels."""
    mean = np.mean([frame.image for frame in frames], axis=0, dtype=np.float32)
    return np.asarray(np.rint(mean).astype(np.uint8))


def check_light(image: NDArray[np.uint8], what: str) -> None:
    """Refuse a picture that is clipped or dark; InputError names what to turn."""
    clipped = float((image == 255).any(axis=2).mean())
    if clipped > _CLIPPED_SHARE:
        raise InputError(
            f"{clipped:.1%} of {what} is clipped at 255: lower the exposure or dim the LEDs, and begin again"
        )
    if is_dark(image):
        raise InputError(f"{what} is dark: check the LEDs, the lens cap and the exposure")


def is_dark(image: NDArray[np.uint8]) -> bool:
    """Tell whether not even the bright part of a picture is lit."""
    return bool(np.quantile(image[::BLOCK_PX, ::BLOCK_PX].max(axis=2), 0.9) < _DARK_GREY)
