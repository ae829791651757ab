"""Step 2: the untouched gel. Waits until the light has warmed up, then averages frames and measures their noise."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.frames.pixel_grid import block_means
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.records import UntouchedGel, WarmUp
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import BLOCK_PX, TouchDetector, check_light, detector_of
from gellight.reconstruction.image_noise import measure_noise

Floats = NDArray[np.float32]
WINDOW = 12
"""frames in each of the two windows that are compared while the LEDs warm up"""
STEADY_GREY = 0.25
"""the windows agree to this: the light is steady"""
LONGEST_WAIT_FRAMES = 30 * 60 * 10  # chosen: ten minutes at 30 frames/s
_DEGREE = 7  # chosen: of the polynomials of the smooth light
_FOREIGN_GREY = 4.0  # chosen: farther off the smooth light a block shows something else
_FOREIGN_SHARE = 0.03  # chosen: of the blocks; the user may accept more, as printed marks
_LARGEST_RETURN_GREY = 3.0  # chosen: with more drift the presses would lie under two lights


def take_reference(run: CalibrationRun) -> None:
    """Do the whole step and keep the reference and its figures."""
    run.wait_for_next("Take your hands off the gel: the untouched gel is recorded. Then go on.")
    run.display.update(instruction="The untouched gel is recorded. Touch nothing.")
    while True:
        warm_up = wait_steady(run)
        try:
            images = _record(run, run.options.reference_frames)
            image = np.asarray(np.mean(images, axis=0, dtype=np.float64), np.float32)
            check_light(np.rint(image).astype(np.uint8), "the untouched gel")
        except InputError as error:
            run.refuse(error)
            run.wait_for_next("Take everything off the gel, then go on.")
            continue
        share = foreign_share(image)
        if share <= _FOREIGN_SHARE or _accepted(run, share):
            break
    noise = measure_noise(images, image)
    run.folder.keep_reference(image)
    run.folder.finish(
        UntouchedGel(
            frames=run.options.reference_frames,
            noise_grey=noise.white_grey,
            pixel_noise_grey=noise.pixel_grey,
            **dict(warm_up),
        )
    )
    run.display.update(problem="")


def compare_with_reference(run: CalibrationRun) -> None:
    """After an interruption: refuse to go on under another light than that of the reference."""
    run.display.update(instruction="The light is compared with the reference. Touch nothing.")
    wait_steady(run)
    reference = run.folder.reference()
    frame = run.frame()
    difference = block_means(frame.image, BLOCK_PX) - block_means(reference, BLOCK_PX)
    drift = float(np.abs(np.median(difference, axis=(0, 1))).max())
    if drift > _LARGEST_RETURN_GREY:
        raise BundleError(
            f"the untouched gel is now {drift:.1f} grey levels away from the reference of {run.folder.path}: "
            "remove that folder and begin again"
        )
    if not detector_of(run).look(frame).free:
        raise InputError("something touches the gel: take it off and start again")


def wait_steady(run: CalibrationRun) -> WarmUp:
    """Wait until the light no longer drifts; CameraError where it does not become steady."""
    first: NDArray[np.float64] | None = None
    levels: deque[NDArray[np.float64]] = deque(maxlen=2 * WINDOW)
    for count in range(LONGEST_WAIT_FRAMES):
        frame = run.frame()
        levels.append(frame.image[::8, ::8].reshape(-1, 3).mean(axis=0))
        if len(levels) < 2 * WINDOW:
            continue
        before, after = (np.mean(list(levels)[part], axis=0) for part in (slice(0, WINDOW), slice(WINDOW, None)))
        first = before if first is None else first
        change = float(np.abs(after - before).max())
        run.display.show(live=frame.image)
        run.display.update(progress=Progress(done=round(change, 3), wanted=STEADY_GREY, unit="grey levels of drift"))
        if change < STEADY_GREY:
            moved = float(np.abs(after - first).max())
            return WarmUp(warm_up_frames=count + 1, warm_up_grey=moved, drift_grey=change)
    raise CameraError(
        f"the light still drifts by {change:.2f} grey levels after {LONGEST_WAIT_FRAMES} frames: "
        "switch off automatic exposure and white balance, and keep other light away"
    )


def _record(run: CalibrationRun, count: int) -> list[NDArray[np.uint8]]:
    """Record frames of the gel at rest; InputError if something moves meanwhile."""
    images: list[NDArray[np.uint8]] = []
    detector: TouchDetector | None = None
    while len(images) < count:
        frame = run.frame()
        if detector is None:
            detector = TouchDetector(frame.image.astype(np.float32), 2.0)
            detector.look(frame)
        gel = detector.look(frame)
        if not (gel.free and gel.still):
            raise InputError(
                f"something moved on {max(gel.touched, gel.moved):.0%} of the gel while the reference was taken: "
                "take your hands off and repeat"
            )
        images.append(frame.image)
        run.display.update(progress=Progress(done=len(images), wanted=count, unit="frames"))
    return images


def _accepted(run: CalibrationRun, share: float) -> bool:
    """Ask whether to keep a reference that looks touched: light alone changes smoothly over the gel."""
    problem = (
        f"{share:.0%} of the untouched gel does not look like smooth light: something lies on it or presses it; take "
        "it off, or clean the gel, and go on"
    )
    if run.hand:
        raise InputError(problem)
    return run.wait_for_acceptance(f"{problem}; accept it if the gel has printed marks", retry=True)


def foreign_share(image: Floats) -> float:
    """Return the share of blocks of (H, W, 3) that lie off the smooth light of the rest.

    The light is fitted robustly by polynomials of degree 7 in x and y, on means of 16 x 16 pixels; of 4 x 4 where a
    side of the picture is shorter than 240 pixels.
    """
    blocks = block_means(block_means(image, BLOCK_PX) if min(image.shape[:2]) >= 240 else image, BLOCK_PX)
    rows, columns = np.indices(blocks.shape[:2])
    x, y = 2 * columns / (blocks.shape[1] - 1) - 1, 2 * rows / (blocks.shape[0] - 1) - 1
    basis = np.polynomial.legendre.legvander2d(x.ravel(), y.ravel(), [_DEGREE, _DEGREE])
    keep = [i * (_DEGREE + 1) + j for i in range(_DEGREE + 1) for j in range(_DEGREE + 1 - i)]
    basis, levels = basis[:, keep], blocks.reshape(-1, 3).astype(np.float64)
    weight = np.ones(len(levels))
    for _ in range(8):
        amounts, *_ = np.linalg.lstsq(basis * weight[:, None], levels * weight[:, None], rcond=None)
        off = np.abs(levels - basis @ amounts).max(axis=1)
        weight = 1 / (1 + (off / 1.0) ** 2)
    return float((off > _FOREIGN_GREY).mean())
