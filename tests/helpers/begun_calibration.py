"""A folder in which a calibration was begun and interrupted."""

from pathlib import Path

from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.state import Identity


def identity(
    sensor: str = "A17",
    *,
    ball_mm: float = 4.0,
    cylinder_mm: float = 8.0,
) -> Identity:
    """What a calibration of pictures of 320 x 240 px is begun with."""
    return Identity(
        sensor=sensor,
        image_size_px=(320, 240),
        ball_radius_mm=ball_mm,
        cylinder_diameter_mm=cylinder_mm,
    )


def begun_in(path: Path, begun: Identity | None = None) -> Folder:
    """Begin a calibration in a folder that is not there yet."""
    return Folder.open(path, begun or identity())
