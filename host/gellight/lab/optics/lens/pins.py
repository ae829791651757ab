"""The centres of the pins in a picture of a pin grid: dots that are darker or brighter, or that press into the gel."""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

_BLUR = 0.08
"""in spacings: a pin that presses into the gel is a ring of slopes, which this closes to a spot"""
_WINDOW = 0.35
"""in spacings: radius of the window around a pin whose centroid is its centre"""
_CENTROID_STEPS = 5  # chosen: each moves the window to the centroid of the one before
_CLEAR = 6.0
"""times its noise that a picture has to vary to show pins"""


def spots(picture: Floats, spacing_px: float) -> list[Floats]:
    """Return (H, W) pictures in which the pins of a (H, W, 3) picture may be bright spots on black.

    How much brighter, and how much darker, a pixel is than its surroundings: the mean over some spacings follows the
    light, not the pins.
    """
    grey = picture.mean(axis=2)
    signed = _blurred(grey, max(_BLUR * spacing_px, 0.6)) - _blurred(grey, 1.5 * spacing_px)
    return [signed, -signed]


def dimples(depth_mm: Floats, spacing_px: float) -> list[Floats]:
    """Return the same of pins that press into the gel, from the (H, W) depth that is felt.

    Only depth is highest where the pin is. The picture of a dimple is a ring that is bright where it faces the light,
    which comes from another side at every place: its middle lies up to 5 px off the pin.
    """
    return [depth_mm.astype(np.float32) - _blurred(depth_mm, 1.5 * spacing_px)]


def find_pins(contrast: Floats, spacing_px: float) -> Array:
    """Return the centres (N, 2), px, of the bright spots in a (H, W) picture that are about `spacing_px` apart."""
    low, high = np.quantile(contrast, [0.3, 0.99])
    noise = 1.4826 * float(np.median(np.abs(np.diff(contrast, axis=1))))
    if high - low <= _CLEAR * noise or not np.isfinite(high - low):
        return np.empty((0, 2))
    scaled = np.clip((contrast - low) * (255 / (high - low)), 0, 255).astype(np.uint8)
    found = _detector(spacing_px).detect(scaled)
    seeds = np.array([keypoint.pt for keypoint in found], np.float64).reshape(-1, 2)
    return _whole(seeds, contrast.shape, spacing_px, contrast)


def _detector(spacing_px: float) -> cv2.SimpleBlobDetector:
    wanted = cv2.SimpleBlobDetector.Params()
    wanted.minThreshold, wanted.maxThreshold, wanted.thresholdStep = 40, 230, 10
    wanted.minRepeatability = 3
    wanted.minDistBetweenBlobs = 0.5 * spacing_px
    wanted.filterByColor, wanted.blobColor = True, 255
    wanted.filterByArea = True
    wanted.minArea, wanted.maxArea = max(3.0, (0.08 * spacing_px) ** 2), (0.8 * spacing_px) ** 2
    wanted.filterByCircularity, wanted.minCircularity = True, 0.5
    wanted.filterByInertia, wanted.filterByConvexity = False, False
    return cv2.SimpleBlobDetector.create(wanted)


def _whole(seeds: Array, shape: tuple[int, ...], spacing_px: float, contrast: Floats) -> Array:
    """Refine the spots whose window lies inside the picture; a spot cut by the border has no centre."""
    reach = _WINDOW * spacing_px
    limit = np.array([shape[1] - 1, shape[0] - 1])
    inside = ((seeds >= reach) & (seeds <= limit - reach)).all(axis=1)
    centres = [_centroid(seed, contrast, reach) for seed in seeds[inside]]
    return np.array(centres).reshape(-1, 2)


def _centroid(seed: Array, contrast: Floats, reach: float) -> Array:
    """Move a round window with soft edges until its weighted centroid lies in its middle.

    Only what is brighter than half the spot counts: the light around it, which may fall off, does not.
    """
    centre = seed.copy()
    for _ in range(_CENTROID_STEPS):
        left, top = np.maximum(np.floor(centre - reach), 0).astype(int)
        patch = contrast[top : top + int(2 * reach) + 2, left : left + int(2 * reach) + 2]
        patch = np.clip(patch - (np.quantile(patch, 0.2) + patch.max()) / 2, 0, None)
        rows, columns = np.indices(patch.shape)
        x, y = columns + left - centre[0], rows + top - centre[1]
        share = patch * np.clip(1 - (x**2 + y**2) / reach**2, 0, None)
        total = float(share.sum())
        if total <= 0:
            break
        # The window shrinks the step of a broad spot; twice the step converges for broad and narrow ones.
        centre = centre + np.clip(2 * np.array([(share * x).sum(), (share * y).sum()]) / total, -1, 1)
    return centre


def _blurred(picture: NDArray[np.floating], sigma_px: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(picture.astype(np.float32), (0, 0), sigma_px), np.float32)


def marked(picture: NDArray[np.uint8], found: Array, expected: Array) -> NDArray[np.uint8]:
    """Draw the pins found (circles) and where they are expected (crosses) on a (H, W, 3) picture, twice enlarged."""
    drawn = np.ascontiguousarray(picture.repeat(2, axis=0).repeat(2, axis=1))
    for x, y in np.rint(2 * found + 0.5).astype(int).tolist():
        cv2.circle(drawn, (x, y), 8, (120, 220, 255), 1, cv2.LINE_AA)
    for x, y in np.rint(2 * expected + 0.5).astype(int).tolist():
        cv2.drawMarker(drawn, (x, y), (255, 120, 60), cv2.MARKER_CROSS, 9, 1, cv2.LINE_AA)
    return drawn
