"""How evenly the untouched gel is lit: the figures of section 3.2.2 of the paper, and their contour picture."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from gellight.lab.calibration.display import Picture
from gellight.lab.calibration.records import Uniformities, Uniformity

Floats = NDArray[np.float32]
_BLUR_SHARE = 0.01
"""of the picture's width: the paper blurs before it draws contours"""
BANDS = 12


def uniformity(intensity: Floats) -> Uniformity:
    """Return mean, standard deviation and the share of pixels within 1, 2 and 3 of it, of (H, W) grey levels."""
    mean, sigma = float(intensity.mean()), float(intensity.std())
    away = np.abs(intensity - mean)
    low, high = np.percentile(intensity, [1, 99])
    return Uniformity(
        mean_grey=mean,
        sigma_grey=sigma,
        within_1_sigma=float((away <= sigma).mean()),
        within_2_sigma=float((away <= 2 * sigma).mean()),
        within_3_sigma=float((away <= 3 * sigma).mean()),
        darkest_grey=float(low),
        brightest_grey=float(high),
    )


def of_image(image: Floats) -> Uniformities:
    """Return the figures of the average of the colours and of each colour of (H, W, 3) grey levels."""
    red, green, blue = (uniformity(image[..., channel]) for channel in range(3))
    return Uniformities(average=uniformity(image.mean(axis=2)), red=red, green=green, blue=blue)


def contour_picture(intensity: Floats) -> Picture:
    """Draw (H, W) grey levels as filled contours with lines between the bands, dark blue to pale yellow."""
    smooth = gaussian_filter(intensity, max(1.0, _BLUR_SHARE * intensity.shape[1]))
    low, high = float(smooth.min()), float(smooth.max())
    band = np.minimum((smooth - low) / max(high - low, 1e-6) * BANDS, BANDS - 1).astype(int)
    ramp = np.linspace(0, 1, BANDS)[:, None]
    first, middle, last = np.array([[38, 42, 94], [52, 148, 142], [250, 238, 170]])
    colours = np.where(ramp < 0.5, first + 2 * ramp * (middle - first), middle + (2 * ramp - 1) * (last - middle))
    picture = colours[band].astype(np.uint8)
    line = np.zeros(band.shape, bool)
    line[:, 1:] |= band[:, 1:] != band[:, :-1]
    line[1:] |= band[1:] != band[:-1]
    picture[line] = picture[line] // 2
    return np.asarray(picture)
