"""The ball that was pressed, as the command and the settings tell it."""

from gellight.base.settings import load_settings
from gellight.lab.training.presses import Ball
from gellight.photometric.window import seen_height_mm


def told_ball(radius_mm: float, pixel_size_mm: float) -> Ball:
    """Return the ball, seen from the height that [geometry] tells; ConfigError or InputError for what cannot be."""
    height_mm = seen_height_mm(load_settings().geometry.overrides())
    return Ball(radius_mm=radius_mm, pixel_size_mm=pixel_size_mm, camera_height_mm=height_mm)
