"""Objects by name: those of the reference, the probes of the calibration, and plates with a relief that is known.

The name of a relief says its measures in mm. SINE-2-0.02 has waves along x of 2 mm and an amplitude of 0.02 mm. The
plates are flat to 12 mm from their middle, then rounded, so that their edge does not cut the gel. All measures are
ours, but for the probe of 8 mm diameter (section 3.2.3 of the paper).
"""

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim_reference import objects
from sim_reference.deformation import NO_OBJECT, Deformation, GelModel, grid
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE

Array = NDArray[np.float64]
FLAT_MM, PLATE_MM, ROUNDING_MM = 12.0, 15.0, 6.0
"""radius that is flat, radius of the plate, and radius of its rounded edge"""
FINEST_MM = 0.5
"""shortest wave with a name: four points of the grid that objects are pressed on"""
LARGEST_MM = 0.5
"""of amplitude: the gel is not deep"""
FORM = "SINE-WAVELENGTH-AMPLITUDE, in mm"
_NUMBER = r"(\d+(?:\.\d+)?)"
_SINE = re.compile(rf"SINE-{_NUMBER}-{_NUMBER}")


CYLINDER_RADIUS_MM = 4.0  # docs/calibration.md: 8 mm in diameter
PIN_RADIUS_MM, PIN_PITCH_MM, PIN_HEIGHT_MM = 0.35, 2.0, 1.0  # chosen: round pins with 1.3 mm between them
PIN_GRID_MM = (44.0, 34.0)
"""width and height of the plate of the pin grid: more than the view"""


def cylinder(x: Array, y: Array) -> Array:
    """Return the flat end of the cylinder probe; beside it there is nothing."""
    return np.where(np.hypot(x, y) < CYLINDER_RADIUS_MM, 0.0, NO_OBJECT)


def pin_grid(x: Array, y: Array) -> Array:
    """Return round pins in a square grid on a plate, one of them in the middle."""
    off = [c - PIN_PITCH_MM * np.rint(c / PIN_PITCH_MM) for c in (x, y)]
    on_plate = (np.abs(x) < PIN_GRID_MM[0] / 2) & (np.abs(y) < PIN_GRID_MM[1] / 2)
    return np.where(on_plate, np.where(np.hypot(*off) < PIN_RADIUS_MM, 0.0, -PIN_HEIGHT_MM), NO_OBJECT)


PROBES: dict[str, Callable[[Array, Array], Array]] = {"CYLINDER": cylinder, "PINS": pin_grid}


def names_relief(name: str) -> bool:
    """Whether a name is meant to be that of a relief."""
    return name.startswith("SINE-")


def object_height(name: str, x_mm: Array, y_mm: Array) -> Array:
    """Return the surface of an object at x (1, W) or (H, W) and y (H, 1) or (H, W): (H, W) mm, highest point 0.

    Raises as `check_name`.
    """
    check_name(name)
    if names_relief(name):
        return relief_plate(name)(x_mm, y_mm)
    return PROBES[name](x_mm, y_mm) if name in PROBES else objects.object_height(name, x_mm, y_mm)


def check_name(name: str, others: tuple[str, ...] = ()) -> None:
    """Raise ValueError unless a name is that of an object of the reference, a probe, a relief or one of `others`."""
    known = (*others, *objects.OBJECT_NAMES, *PROBES)
    if names_relief(name):
        relief_plate(name)
    elif name not in known:
        raise ValueError(f"no object {name!r}: choose one of {', '.join(known)}, or {FORM}")


def press_object(name: str, press_depth_mm: float, geometry: SensorGeometry, model: GelModel) -> Deformation:
    """Press an object into the gel of `model`, as `surface.press_object`; raises as that and as `check_name`."""
    spacing_mm = GRID_EXTENT_MM / GRID_SIZE
    at = grid(GRID_SIZE, spacing_mm)
    return model(object_height(name, at[None, :], at[:, None]), spacing_mm, press_depth_mm, geometry)


def relief_plate(name: str) -> Callable[[Array, Array], Array]:
    """Return the height over x (1, W) or (H, W) and y (H, 1) or (H, W), mm, of the plate that a name describes.

    Raises ValueError for a name that is no relief, and for measures that cannot be pressed.
    """
    found = _SINE.fullmatch(name)
    if not found:
        raise ValueError(f"no relief {name!r}: give {FORM}")
    wavelength, amplitude = map(float, found.groups())
    if not (FINEST_MM <= wavelength <= FLAT_MM and 0 < amplitude <= LARGEST_MM):
        raise ValueError(
            f"relief {name}: waves can be {FINEST_MM:g} to {FLAT_MM:g} mm long, and the amplitude up to "
            f"{LARGEST_MM:g} mm; it is {FORM}"
        )
    return lambda x, y: sine_plate(x, y, wavelength, amplitude)


def sine_plate(x: Array, y: Array, wavelength_mm: float, amplitude_mm: float) -> Array:
    """Return a plate with waves along x, a crest in its middle, whose Ra is 2 / pi of the amplitude."""
    return on_plate(x, y, amplitude_mm * (np.cos(2 * np.pi * x / wavelength_mm) - 1 + 0 * y))


def on_plate(x: Array, y: Array, relief_mm: Array) -> Array:
    """Return a relief on the plate, whose edge is rounded; NO_OBJECT beside it."""
    radius = np.hypot(x, y)
    rounded = np.maximum(radius - FLAT_MM, 0) ** 2 / (2 * ROUNDING_MM)
    return np.where(radius < PLATE_MM, relief_mm - rounded, NO_OBJECT)
