"""The sensor's geometry: read from a settings file, checked for what cannot be built, and written."""

from math import cos, degrees
from pathlib import Path
from types import MappingProxyType

import tomli_w

from gellight.base.errors import ConfigError
from gellight.base.settings import GeometrySettings, read_settings
from gellight.lab.simulator.simulated_camera import built
from sim_reference.geometry import ACRYLIC_MM, AS_BUILT, SensorGeometry
from sim_reference.refraction import window_of

STRIP_WIDTH_MM = 6.5
"""of the flexible circuit that carries the LEDs"""
MODEL = MappingProxyType({"perspective": False, "window": False})
"""how the paper's model sees and lights the gel; of a design that is built nobody chooses it"""


def read_geometry(path: Path | None, *, as_built: bool = True) -> SensorGeometry:
    """Return the sensor of a settings file (the form of gellight.toml), the default one where `path` is None.

    Without `as_built` it is the paper's model of it: studies of the light bring their own window and camera.
    Raises ConfigError for a file that cannot be read, an unknown key, no geometry, or a sensor that cannot be built.
    """
    if path is None:
        return AS_BUILT if as_built else SensorGeometry()
    overrides = read_settings(path).geometry.overrides()
    if not overrides:
        raise ConfigError(
            f"{path} says nothing of a sensor's geometry: write its lengths and angles under [geometry], or leave "
            "--geometry out for the default sensor"
        )
    geometry = built(overrides if as_built else {**overrides, **MODEL})
    check(geometry)
    return geometry


def check(geometry: SensorGeometry) -> None:
    """Raise ConfigError for a missing colour, LEDs inside the gel or its acrylic, or a ring wider than the housing."""
    missing = [colour for colour in "RGB" if colour not in geometry.led_colours]
    if missing:
        raise ConfigError(
            f"led_colours {geometry.led_colours!r}: no LED is {' or '.join(missing)}, give at least one of each of R, "
            "G, B"
        )
    above, window = geometry.camera_height_mm - geometry.mounting_height_mm, window_of(geometry).thickness_mm
    if above <= window:
        raise ConfigError(
            f"the LEDs are {above:g} mm above the gel surface, inside the gel of {geometry.gel_thickness_mm:g} mm and "
            f"its acrylic of {ACRYLIC_MM:g} mm: choose camera_height_mm - mounting_height_mm above {window:g}"
        )
    outer = outer_radius_mm(geometry)
    if outer > geometry.gel_diameter_mm / 2:
        raise ConfigError(
            f"the ring reaches {outer:.2f} mm from the axis, the housing is {geometry.gel_diameter_mm / 2:g} mm in "
            f"radius: choose ring_radius_mm up to "
            f"{geometry.gel_diameter_mm / 2 - outer + geometry.ring_radius_mm:.2f}"
        )


def outer_radius_mm(geometry: SensorGeometry) -> float:
    """Return the radius of the outer edge of the conical strip."""
    return geometry.ring_radius_mm + STRIP_WIDTH_MM / 2 * cos(geometry.incident_angle_rad)


def ring_colours(geometry: SensorGeometry) -> str:
    """Return the colours of the ring, LED by LED, as `gellight ring set` takes them."""
    return ",".join({"R": "ff0000", "G": "00ff00", "B": "0000ff"}[colour] for colour in geometry.led_colours)


def design_file(geometry: SensorGeometry) -> bytes:
    """Return the settings file of a sensor: `gellight` started beside it simulates, or drives, this sensor."""
    section = {}
    for name, value in vars(geometry).items():
        if name.endswith("_rad"):
            name, value = f"{name.removesuffix('_rad')}_deg", degrees(value)
        if name in GeometrySettings.model_fields and name not in MODEL:
            section[name] = round(value, 6) if isinstance(value, float) else value
    return f"# gellight ring set {ring_colours(geometry)}\n\n{tomli_w.dumps({'geometry': section})}".encode()
