"""Labels without clicks: where a ball touches the gel, found in the picture of a press alone."""

from gellight.lab.training.labelling.circle import PressCircle, find_circle
from gellight.lab.training.labelling.detection import (
    Detection,
    detect,
    write_overlays,
    write_presses,
)

__all__ = [
    "Detection",
    "PressCircle",
    "detect",
    "find_circle",
    "write_overlays",
    "write_presses",
]
