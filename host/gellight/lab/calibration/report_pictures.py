"""Small pictures in a row, for the report of a calibration."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gellight.lab.report.charts import picture
from gellight.lab.report.html import box

_WIDTH_PX = 320


def small_pictures(images: Sequence[tuple[NDArray[np.uint8], str]]) -> str:
    """Return (H, W, 3) pictures with the words below each, as HTML."""
    return box("pictures", *(picture(_thinned(image), words, _WIDTH_PX) for image, words in images))


def _thinned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Leave out rows and columns that a small picture does not show."""
    step = max(1, image.shape[1] // _WIDTH_PX)
    return np.ascontiguousarray(image[::step, ::step])
