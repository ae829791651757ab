"""GelLight's host: from camera frames to tactile depth in real time.

    import gellight

    with gellight.connect("sim://?object=BALL&depth=1") as sensor:  # a sensor of this program; "auto": plugged in
        frame = sensor.next_frame()
        print(frame.contact.indentation_mm, "mm deep", frame.depth_mm.shape)

    with gellight.subscribe("auto", wait_s=60) as frames:  # a sensor that `gellight run` or `gellight demo` opened
        for frame in frames:
            print(frame.contact.area_mm2, frame.force and frame.force.normal_n)

connect(url="auto", *, calibration=None, mode=None, every=False, ...) -> Sensor
subscribe(target="auto", *, every=False, maps=(), wait_s=0, token="", ...) -> Subscription
    Both give `next_frame()`, iteration, `listen(function)`, `press`, `release`, `light`, `zero`, `mode`, `status`.
TactileFrame
    `depth_mm`, `normal_map`, `contact`, `contacts`, `force`, `shear`, `pose`, `confidence`, `camera_frame`.

The other names, below, are what programs rely on too. All are imported when they are first used, so that `import
gellight` costs nothing that is not needed.
"""

import os
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gellight.base.errors import GellightError, StreamError
    from gellight.bundle.bundle import Bundle, load_bundle
    from gellight.daemon.session import SensorSession
    from gellight.frame_path.pipeline import Reconstructor
    from gellight.frames.camera import EndOfStream
    from gellight.frames.frames import CameraFrame, Contact, Patch, Provenance, TactileFrame
    from gellight.opening import open_camera
    from gellight.reconstruction.contact import find_contact
    from gellight.reconstruction.integration import integrate, normals
    from gellight.stream.sensor import Sensor, connect
    from gellight.stream.source import NoFrameError
    from gellight.stream.subscription import Subscription, subscribe

    __version__: str

# Before OpenCV is loaded, for a small file may be a picture of gigabytes: 8192 x 8192 pixels, unless told otherwise.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(1 << 26))
# Before ONNX Runtime is loaded, which else sends its maker events; its own function comes too late.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

_HOME = {
    "Bundle": "bundle.bundle",
    "load_bundle": "bundle.bundle",
    "open_camera": "opening",
    "find_contact": "reconstruction.contact",
    "SensorSession": "daemon.session",
    "GellightError": "base.errors",
    "StreamError": "base.errors",
    "EndOfStream": "frames.camera",
    "CameraFrame": "frames.frames",
    "Contact": "frames.frames",
    "Patch": "frames.frames",
    "Provenance": "frames.frames",
    "TactileFrame": "frames.frames",
    "Reconstructor": "frame_path.pipeline",
    "integrate": "reconstruction.integration",
    "normals": "reconstruction.integration",
    "NoFrameError": "stream.source",
    "Sensor": "stream.sensor",
    "connect": "stream.sensor",
    "Subscription": "stream.subscription",
    "subscribe": "stream.subscription",
}

__all__ = [
    "Bundle",
    "CameraFrame",
    "Contact",
    "EndOfStream",
    "GellightError",
    "NoFrameError",
    "Patch",
    "Provenance",
    "Reconstructor",
    "Sensor",
    "SensorSession",
    "StreamError",
    "Subscription",
    "TactileFrame",
    "connect",
    "find_contact",
    "integrate",
    "load_bundle",
    "normals",
    "open_camera",
    "subscribe",
]


def __getattr__(name: str) -> object:
    """Import a public name from the module it lives in; `__version__` is that of the installed package."""
    if name == "__version__":
        return version("gellight")
    if name not in _HOME:
        raise AttributeError(f"module 'gellight' has no attribute {name!r}")
    return getattr(import_module(f"gellight.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
