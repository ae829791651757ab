"""Sensors that others make: what is published of their geometry. What is not known is None, and has to be measured.

docs/other-sensors.md says where each figure comes from.
"""

from dataclasses import dataclass

from gellight.base.allowed import nearest
from gellight.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Preset:
    """One kind of sensor."""

    name: str
    title: str
    view_mm: tuple[float, float] | None
    """width and height of the gel that can be seen, as published; the picture may show more, or less"""
    ball_radius_mm: float | None
    """of a ball that it was calibrated with"""
    lights: str
    """for people"""


PRESETS = (  # what is published of these sensors
    Preset(
        name="gelsight-mini", title="GelSight Mini", view_mm=(18.6, 14.3), ball_radius_mm=2.35, lights="coloured, on"
    ),
    Preset(name="digit", title="DIGIT", view_mm=(19.0, 16.0), ball_radius_mm=None, lights="red, green and blue, on"),
    Preset(name="9dtact", title="9DTact", view_mm=(23.2, 17.4), ball_radius_mm=4.0, lights="white, on"),
)


def preset_called(name: str) -> Preset:
    """Return the preset of this name; InputError names the nearest, or all."""
    for preset in PRESETS:
        if preset.name == name:
            return preset
    known = [preset.name for preset in PRESETS]
    raise InputError(f"there is no preset {name!r}: {nearest(name, known)}")
