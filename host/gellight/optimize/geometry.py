"""The geometry that the optimiser works on: a settings file with a [geometry] section, and what cannot be built."""

import tomllib
from dataclasses import fields
from math import cos, degrees
from pathlib import Path

import tomli_w
from pydantic import ValidationError

from gellight.config import GeometrySettings, Settings
from gellight.errors import ConfigError
from gellight.simulated import built
from sim_reference.geometry import SensorGeometry

STRIP_WIDTH_MM = 6.5
"""of the flexible circuit that carries the LEDs"""


def read_geometry(path: Path | None) -> SensorGeometry:
    """Return the sensor of a settings file (the form of gellight.toml), the paper's where `path` is None.

    Raises ConfigError for a file that cannot be read, an unknown key, or a sensor that cannot be built.
    """
    chosen = GeometrySettings() if path is None else _settings(path).geometry
    geometry = built(chosen.overrides())
    check(geometry)
    return geometry


def check(geometry: SensorGeometry, strip_width_mm: float = STRIP_WIDTH_MM) -> None:
    """Raise ConfigError for LEDs in the gel or a ring that does not fit into the housing."""
    above = geometry.camera_height_mm - geometry.mounting_height_mm
    if above <= geometry.gel_thickness_mm:
        raise ConfigError(
            f"the LEDs are {above:g} mm above the gel surface, inside the gel of {geometry.gel_thickness_mm:g} mm: "
            f"choose mounting_height_mm below {geometry.camera_height_mm - geometry.gel_thickness_mm:g}"
        )
    outer = outer_radius_mm(geometry, strip_width_mm)
    if outer > geometry.gel_diameter_mm / 2:
        raise ConfigError(
            f"the ring reaches {outer:.2f} mm from the axis, the housing is {geometry.gel_diameter_mm / 2:g} mm in "
            f"radius: choose ring_radius_mm up to "
            f"{geometry.gel_diameter_mm / 2 - outer + geometry.ring_radius_mm:.2f}"
        )


def outer_radius_mm(geometry: SensorGeometry, strip_width_mm: float) -> float:
    """Return the radius of the outer edge of the conical strip."""
    return geometry.ring_radius_mm + strip_width_mm / 2 * cos(geometry.incident_angle_rad)


def design_file(geometry: SensorGeometry) -> bytes:
    """Return the settings file of a sensor: `gellight` started beside it simulates this sensor."""
    section = {}
    for field in fields(geometry):
        value = getattr(geometry, field.name)
        name = field.name.removesuffix("_rad") + "_deg" if field.name.endswith("_rad") else field.name
        section[name] = round(degrees(value), 6) if field.name.endswith("_rad") else _rounded(value)
    return tomli_w.dumps({"geometry": section}).encode()


def _rounded(value: float | int | str) -> float | int | str:
    return round(value, 6) if isinstance(value, float) else value


def _settings(path: Path) -> Settings:
    try:
        return Settings.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{path} cannot be read ({error.strerror}): give a file with a [geometry] section") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(step) for step in first["loc"])
        raise ConfigError(
            f"{path}: {place} = {first['input']!r}: {first['msg']}; `gellight config --help` tells where the keys are "
            "described"
        ) from error
    except ValueError as error:
        raise ConfigError(f"{path} is not TOML in UTF-8 ({error}): correct it") from error
