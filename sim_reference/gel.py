"""The gel: an elastic layer bonded to its support, pressed by a rigid object without friction.

Under a normal pressure p, a layer of thickness h has the surface depth u whose Fourier transform is G(k) p(k)
(Johnson, Contact Mechanics, 1985, section 5.8, and the references there):

    G(k) = (1 - nu) / (mu k) * (2 K sinh 2q - 4 q) / (2 K cosh 2q + 4 q^2 + 1 + K^2),   q = k h,  K = 3 - 4 nu

and G(0) = h (1 - 2 nu) / (2 mu (1 - nu)), the uniaxial compression. Contact without tension and penetration is found by
the conjugate gradient method of Polonsky and Keer (Wear 231, 1999). Depth does not depend on the shear modulus mu, so
pressures are in units of mu. This is a small-strain model: it knows neither large deformation nor friction.
"""

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from sim_reference.deformation import Deformation, NotConverged
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]]
"""of single or double precision; what comes out has that of what went in"""


def wave_number(size: int, spacing_mm: float) -> Array:
    """Return |k| in rad/mm on the grid of a real FFT, (size, size // 2 + 1)."""
    kx = 2 * np.pi * scipy.fft.rfftfreq(size, spacing_mm)[None, :]
    ky = 2 * np.pi * scipy.fft.fftfreq(size, spacing_mm)[:, None]
    return np.asarray(np.hypot(kx, ky))


def coating(size: int, spacing_mm: float, smoothing_mm: float) -> Array:
    """Return the transform of a Gaussian of standard deviation `smoothing_mm`: what the coating lets through."""
    return np.asarray(np.exp(-((wave_number(size, spacing_mm) * smoothing_mm) ** 2) / 2))


def compliance(size: int, spacing_mm: float, thickness_mm: float, poisson_ratio: float) -> Array:
    """Return G(k) on the grid of a real FFT, (size, size // 2 + 1), in mm per shear modulus."""
    k = wave_number(size, spacing_mm)
    k[0, 0] = 1.0
    q = np.minimum(k * thickness_mm, 30.0)  # beyond, the layer is a half space to 1e-13 and sinh would overflow
    kappa = 3 - 4 * poisson_ratio
    layer = (2 * kappa * np.sinh(2 * q) - 4 * q) / (2 * kappa * np.cosh(2 * q) + 4 * q**2 + 1 + kappa**2)
    response = (1 - poisson_ratio) / k * layer
    response[0, 0] = thickness_mm * (1 - 2 * poisson_ratio) / (2 * (1 - poisson_ratio))
    return np.asarray(response)


def press(
    object_height_mm: Array,
    spacing_mm: float,
    press_depth_mm: float,
    geometry: SensorGeometry,
    *,
    tolerance: float = 1e-4,
    max_iterations: int = 500,
) -> Deformation:
    """Press a rigid object into the gel and return the gel's surface.

    `object_height_mm` (n, n) is the object's surface towards the gel, 0 at its highest point, `NO_OBJECT` beside it;
    keep a margin of two gel thicknesses, for the grid is periodic. `press_depth_mm` is how far the highest point goes
    beyond first touch. Raises
    ValueError for a press that is negative, deeper than 60 % of the gel or not a number, and for an object that is no
    square of numbers, NotConverged otherwise.
    """
    geometry.check_press(press_depth_mm)
    size = len(object_height_mm)
    if object_height_mm.shape != (size, size) or not np.isfinite(object_height_mm).all():
        raise ValueError(
            f"object height of shape {object_height_mm.shape}: give (n, n) finite numbers, NO_OBJECT where nothing is"
        )
    response = compliance(size, spacing_mm, geometry.gel_thickness_mm, geometry.poisson_ratio)
    rest_gap = -(object_height_mm + press_depth_mm)
    pressure = contact_pressure(rest_gap, response, geometry.gel_thickness_mm, tolerance, max_iterations)
    smoothing = coating(size, spacing_mm, geometry.coating_smoothing_mm)
    return Deformation(deflection(pressure, response * smoothing), pressure, spacing_mm)


def deflection(pressure: Real, response: Real) -> Any:
    """Return the depth (n, n) in mm under `pressure` (n, n): the product with G in Fourier space."""
    return np.asarray(scipy.fft.irfft2(scipy.fft.rfft2(pressure) * response, s=pressure.shape))


def contact_pressure(
    rest_gap: Real, response: Real, thickness_mm: float, tolerance: float = 1e-4, max_iterations: int = 500
) -> Any:
    """Find p >= 0 with gap = G p + rest_gap >= 0 and p gap = 0 (Polonsky and Keer, steps as numbered there).

    rest_gap: (n, n) mm between the gel at rest and the object, negative where it penetrates. response: `compliance`.
    The iteration ends when the pressure changes by less than `tolerance` of its sum. Returns (n, n), in units of the
    shear modulus and in the precision of what is given. Raises NotConverged.
    """
    pressure = np.maximum(-rest_gap, 0) / rest_gap.dtype.type(thickness_mm)
    if not pressure.any():
        return pressure
    direction = np.zeros_like(pressure)
    previous_norm, conjugate, step = 1.0, 0.0, 0.0
    for _ in range(max_iterations):
        gap = deflection(pressure, response) + rest_gap
        contact = pressure > 0
        norm = float((gap[contact] ** 2).sum())
        if norm == 0 and gap.min() >= 0:  # a contact of one point is solved exactly
            return pressure
        direction = np.where(contact, gap + conjugate * norm / previous_norm * direction, 0.0)
        previous_norm = norm or 1.0
        change = deflection(direction, response)
        if norm > 0:
            step = float((gap * direction)[contact].sum() / (change * direction)[contact].sum())
        updated = np.maximum(pressure - step * direction, 0.0)
        penetrating = (updated == 0) & (gap < 0) & ~contact
        updated = np.where(penetrating, -step * gap, updated)
        conjugate = 0.0 if penetrating.any() else 1.0
        moved = float(np.abs(updated - pressure).sum() / updated.sum())
        pressure = updated
        if moved < tolerance:
            return pressure
    raise NotConverged(
        f"the contact changed by {moved:.1e} in iteration {max_iterations}, wanted {tolerance:.1e}: use a coarser "
        "grid, a larger margin around the object, or a smaller Poisson's ratio"
    )
