"""GelLight's host: from camera frames to tactile depth in real time.

The names below are what programs rely on. They are imported when they are first used, so that `import gellight` costs
nothing that is not needed.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gellight.calibration import Calibration, load_calibration
    from gellight.camera import open_camera
    from gellight.contact import find_contact
    from gellight.daemon import Daemon
    from gellight.errors import GellightError
    from gellight.frames import CameraFrame, Contact, TactileFrame
    from gellight.pipeline import Reconstructor
    from gellight.reconstruction import integrate, normals

_HOME = {
    "Calibration": "calibration",
    "load_calibration": "calibration",
    "open_camera": "camera",
    "find_contact": "contact",
    "Daemon": "daemon",
    "GellightError": "errors",
    "CameraFrame": "frames",
    "Contact": "frames",
    "TactileFrame": "frames",
    "Reconstructor": "pipeline",
    "integrate": "reconstruction",
    "normals": "reconstruction",
}

__all__ = [
    "Calibration",
    "CameraFrame",
    "Contact",
    "Daemon",
    "GellightError",
    "Reconstructor",
    "TactileFrame",
    "find_contact",
    "integrate",
    "load_calibration",
    "normals",
    "open_camera",
]


def __getattr__(name: str) -> object:
    """Import a public name from the module it lives in."""
    if name not in _HOME:
        raise AttributeError(f"module 'gellight' has no attribute {name!r}")
    return getattr(import_module(f"gellight.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
