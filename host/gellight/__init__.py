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
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gellight.base.errors import GellightError as GellightError
    from gellight.base.errors import StreamError as StreamError
    from gellight.bundle.bundle import Bundle as Bundle
    from gellight.bundle.bundle import load_bundle as load_bundle
    from gellight.daemon.session import SensorSession as SensorSession
    from gellight.frame_path.pipeline import Reconstructor as Reconstructor
    from gellight.frames.camera import EndOfStream as EndOfStream
    from gellight.frames.frames import CameraFrame as CameraFrame
    from gellight.frames.frames import Contact as Contact
    from gellight.frames.frames import Patch as Patch
    from gellight.frames.frames import Provenance as Provenance
    from gellight.frames.frames import TactileFrame as TactileFrame
    from gellight.opening import open_camera as open_camera
    from gellight.reconstruction.contact import find_contact as find_contact
    from gellight.reconstruction.integration import integrate as integrate
    from gellight.reconstruction.integration import normals as normals
    from gellight.stream.sensor import Sensor as Sensor
    from gellight.stream.sensor import connect as connect
    from gellight.stream.source import NoFrameError as NoFrameError
    from gellight.stream.subscription import Subscription as Subscription
    from gellight.stream.subscription import subscribe as subscribe

    __version__: str

# Before OpenCV is loaded, for a small file may be a picture of gigabytes: 8192 x 8192 pixels, unless told otherwise.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(1 << 26))
# Before ONNX Runtime is loaded, which else sends its maker events; its own function comes too late.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

_HOME = {
    "base.errors": "GellightError StreamError",
    "bundle.bundle": "Bundle load_bundle",
    "daemon.session": "SensorSession",
    "frame_path.pipeline": "Reconstructor",
    "frames.camera": "EndOfStream",
    "frames.frames": "CameraFrame Contact Patch Provenance TactileFrame",
    "opening": "open_camera",
    "reconstruction.contact": "find_contact",
    "reconstruction.integration": "integrate normals",
    "stream.sensor": "Sensor connect",
    "stream.source": "NoFrameError",
    "stream.subscription": "Subscription subscribe",
}
_MODULES = {name: module for module, names in _HOME.items() for name in names.split()}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    """Import a public name from the module it lives in; `__version__` is that of the installed package."""
    if name == "__version__":
        from importlib.metadata import version

        return version("gellight")
    if name not in _MODULES:
        raise AttributeError(f"module 'gellight' has no attribute {name!r}")
    return getattr(import_module(f"gellight.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
