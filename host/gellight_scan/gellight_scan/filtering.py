"""Form, waviness and roughness of heights: ISO 16610-21 (profiles) and -61 (areas), where heights may be missing.

The Gaussian filter with the nesting index c ("cutoff") has the weight exp(-pi (x / (alpha c))^2) / (alpha c), with
alpha = sqrt(ln 2 / pi) = 0.4697. It lets half of the amplitude of waves of the length c through, and of the length l
exp(-pi (alpha c / l)^2): a Gaussian of standard deviation 0.1874 c. Its weights end at a distance of c.

Missing heights have no weight, and the weights of the others sum up to one. So the mean is drawn away from a border;
what lies within half a cutoff of one is run-in, and is not evaluated.
"""

from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError

Array = NDArray[np.float64]
SIGMA_SHARE = sqrt(log(2) / 2) / pi
"""standard deviation of the filter's Gaussian as a share of its cutoff: 0.1874"""
RUN_IN = 0.5
"""of the cutoff, at each end of a profile and along the border of an area"""
FORMS = {"none": 0, "plane": 1, "curved": 2}
"""degree of the polynomial that is taken off before: 2 stands for spheres and cylinders of small slope"""


def without_form(height: Array, form: str) -> Array:
    """Take the best polynomial in x and y off heights (N,) or (H, W), by least squares; NaN stays.

    Raises InputError for a form that is not in `FORMS`.
    """
    if form not in FORMS:
        raise InputError(f"no form {form!r} can be taken off: choose one of {', '.join(FORMS)}")
    known = np.isfinite(height)
    places = [at / size - 0.5 for at, size in zip(np.nonzero(known), height.shape, strict=True)]
    powers = [each for each in np.ndindex(*(FORMS[form] + 1,) * height.ndim) if sum(each) <= FORMS[form]]
    terms = (np.prod([at**n for at, n in zip(places, each, strict=True)], axis=0) for each in powers)
    basis = np.stack(list(terms), axis=1)
    left = np.full(height.shape, np.nan)
    # The normal equations: a map has too many pixels for a basis that is decomposed as a whole.
    factors = np.linalg.lstsq(basis.T @ basis, basis.T @ height[known], rcond=1e-12)[0]
    left[known] = height[known] - basis @ factors
    return left


def waviness(height: Array, cutoff_px: float) -> Array:
    """Return what the Gaussian filter lets through of heights (N,) or (H, W), mm; NaN where they are."""
    known, sigma = np.isfinite(height), SIGMA_SHARE * cutoff_px

    def filtered(values: Array) -> Array:
        return np.asarray(ndimage.gaussian_filter(values, sigma, mode="constant", truncate=1 / SIGMA_SHARE))

    weight = filtered(known.astype(np.float64))
    return np.where(known, filtered(np.where(known, height, 0.0)) / np.maximum(weight, 1e-12), np.nan)


def beyond_run_in(known: NDArray[np.bool_], cutoff_px: float) -> NDArray[np.bool_]:
    """(N,) or (H, W): what lies inside the outline of what is known, farther than half a cutoff from it.

    Holes count as inside: they shift the mean little, and what is missing there is judged by its share.
    """
    inside = np.pad(ndimage.binary_fill_holes(known), 1)
    distance = ndimage.distance_transform_edt(inside)
    return np.asarray(distance[(slice(1, -1),) * known.ndim] > RUN_IN * cutoff_px)


def transmission(wavelength_mm: float, sigma_mm: float) -> float:
    """Return what a Gaussian blur of this standard deviation leaves of waves: exp(-2 (pi sigma / wavelength)^2)."""
    return float(np.exp(-2 * (pi * sigma_mm / wavelength_mm) ** 2))


def finest_mm(sigma_mm: float, share: float) -> float:
    """Return the length of the waves of which a Gaussian blur takes this share."""
    return pi * sigma_mm * sqrt(-2 / log(1 - share))
