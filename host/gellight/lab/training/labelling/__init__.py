"""Labels without clicks: where a ball or a prism touches the gel, found in the picture of a press alone."""

from gellight.lab.training.labelling.circle import PressCircle, find_circle
from gellight.lab.training.labelling.detection import (
    Detection,
    detect,
    detect_prisms,
    detect_several,
    write_overlays,
    write_presses,
)
from gellight.lab.training.labelling.prism import PrismContact, find_prism

__all__ = [
    "Detection",
    "PressCircle",
    "PrismContact",
    "detect",
    "detect_prisms",
    "detect_several",
    "find_circle",
    "find_prism",
    "write_overlays",
    "write_presses",
]
