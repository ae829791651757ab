"""The reference images that the page needs to make difference images of camera images.

A difference image is as large as the frame and changes with it; the reference image behind it stays the same for hours.
So the page gets the reference once, by name, and subtracts it itself. A new name means a new reference image: after a
calibration, or when the zero was set anew.
"""

import hashlib

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.dashboard.view import reduce, view_shape, webp
from gellight.frames.frames import TactileFrame

SAMPLE_PX = 8
"""every eighth pixel of every eighth row tells whether the reference image is still the same"""
SAME_GREY = 0.25
REFRESH_S = 1.0
"""light that changes evenly over the view, and is followed, is no new reference image more often than this"""
KEPT = 4
"""reference images that are kept for pages that ask late"""


class ReferenceViews:
    """The reference images of the frames that were shown last, at view size."""

    def __init__(self) -> None:
        """Know none yet."""
        self._pictures: dict[str, bytes] = {}
        self._name = ""
        self._sample: NDArray[np.float32] | None = None
        self._kept_s = 0.0

    def of(self, frame: TactileFrame) -> tuple[str, list[float]]:
        """Return the name of the reference image of `frame`, and its (3,) light drift in grey levels.

        The difference image is the camera image minus the reference image minus the drift; for up to `REFRESH_S` but
        for light that has changed evenly.
        """
        sample = frame.camera_frame.image[::SAMPLE_PX, ::SAMPLE_PX] - frame.difference[::SAMPLE_PX, ::SAMPLE_PX]
        if self._sample is not None and self._sample.shape == sample.shape:
            change = sample - self._sample
            drift = np.median(change.reshape(-1, 3), axis=0)
            new = frame.camera_frame.time_s - self._kept_s >= REFRESH_S
            if np.abs(change - (drift if new else _even(change, self._sample))).max() <= SAME_GREY:
                return self._name, [round(float(grey), 3) for grey in drift]
        self._sample, self._kept_s = sample, frame.camera_frame.time_s
        self._name = self._keep(frame)
        return self._name, [0.0, 0.0, 0.0]

    def picture(self, name: str) -> bytes:
        """Return the reference image `name` as WebP without loss; InputError where it is not kept any more."""
        try:
            return self._pictures[name]
        except KeyError:
            raise InputError(f"no reference image {name!r}: take the name from the newest frame") from None

    def _keep(self, frame: TactileFrame) -> str:
        reference = frame.camera_frame.image.astype(np.float32) - frame.difference
        picture = webp(reduce(reference, view_shape(frame.depth_mm.shape)))
        name = hashlib.sha256(picture).hexdigest()[:16]
        self._pictures.pop(name, None)
        self._pictures[name] = picture
        while len(self._pictures) > KEPT:
            self._pictures.pop(next(iter(self._pictures)))
        return name


def _even(change: NDArray[np.float32], sample: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the part of an (H, W, 3) change that is the sample times a plane over the view, by least squares."""
    height, width, _ = change.shape
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    plane = np.stack([np.ones_like(x), x, y], axis=-1)
    even = np.empty_like(change)
    for channel in range(3):
        terms = (plane * sample[..., channel, None]).reshape(-1, 3)
        weights, *_ = np.linalg.lstsq(terms, change[..., channel].ravel(), rcond=None)
        even[..., channel] = (terms @ weights).reshape(height, width)
    return even
