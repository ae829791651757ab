"""The ball that was pressed, and the gel, as the command and the settings tell them."""

from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle
from gellight.lab.training.presses import Ball
from gellight.photometric.window import seen_height_mm
from gellight.reconstruction.force import SILICONE, Layer


def told_ball(radius_mm: float, pixel_size_mm: float) -> Ball:
    """Return the ball, seen from the height that [geometry] tells; ConfigError or InputError for what cannot be."""
    height_mm = seen_height_mm(load_settings().geometry.overrides())
    return Ball(radius_mm=radius_mm, pixel_size_mm=pixel_size_mm, camera_height_mm=height_mm)


def told_layer(bundle: Bundle | None = None) -> Layer | None:
    """Return the gel that [geometry] tells, else the bundle; None where nobody says how thick it is."""
    told = load_settings().geometry
    thickness_mm = told.gel_thickness_mm or (bundle.manifest.gel_thickness_mm if bundle else 0.0)
    if not thickness_mm:
        return None
    return Layer(thickness_mm, SILICONE if told.poisson_ratio is None else told.poisson_ratio)
