"""Pictures of a gel with printed marker dots, seen from the side."""

import cv2
import numpy as np

CORNERS = ((40.0, 30.0), (180.0, 22.0), (200.0, 150.0), (16.0, 142.0))
"""where the corners of the gel lie in a picture as taken: top left, top right, bottom right, bottom left"""
TAKEN = (180, 220)
DOT_PX = 4.0


def sloping_gel(shape: tuple[int, int]) -> np.ndarray:
    """Return the picture (H, W, 3) of an untouched gel, brighter on the right."""
    return np.broadcast_to(np.linspace(100, 160, shape[1])[None, :, None], (*shape, 3)).astype(np.uint8)


def with_dots(image: np.ndarray, shift: tuple[float, float] = (0.0, 0.0), pitch: float = 16.0) -> np.ndarray:
    """Print a grid of dark dots on a (H, W, 3) picture, moved by `shift` px."""
    rows, columns = np.indices(image.shape[:2])
    x, y = (columns - shift[0]) % pitch - pitch / 2, (rows - shift[1]) % pitch - pitch / 2
    share = np.clip(DOT_PX / 2 + 0.5 - np.hypot(x, y), 0, 1)[..., None]
    return np.asarray(np.rint(image * (1 - share) + 0.2 * image * share), np.uint8)


def from_the_side(image: np.ndarray) -> np.ndarray:
    """See a (H, W, 3) picture from the side, on black."""
    height, width = image.shape[:2]
    ends = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32) - 0.5
    matrix = cv2.getPerspectiveTransform(ends, np.array(CORNERS, np.float32))
    return np.asarray(cv2.warpPerspective(image, matrix, (TAKEN[1], TAKEN[0])), np.uint8)


def centres_of(grey: np.ndarray, near_px: np.ndarray, diameter_px: float) -> np.ndarray:
    """Return (N, 2) x, y px of the darkest spots near (N, 2) places of a (H, W, 3) picture: centroids of darkness."""
    reach, sum_ = int(np.ceil(0.8 * diameter_px)), grey.astype(float).sum(axis=2)
    offsets = np.arange(-reach, reach + 1)
    found = []
    for column, row in np.rint(near_px).astype(int):
        part = sum_[row - reach : row + reach + 1, column - reach : column + reach + 1]
        around = np.median(np.concatenate([part[[0, -1]].ravel(), part[:, [0, -1]].ravel()]))
        dark = np.maximum(1 - part / around, 0)
        dark = np.maximum(dark - 0.3 * dark.max(), 0)
        found.append((column + dark.sum(axis=0) @ offsets / dark.sum(), row + dark.sum(axis=1) @ offsets / dark.sum()))
    return np.array(found)
