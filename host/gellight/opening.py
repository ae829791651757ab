"""Cameras by URL: image files, a simulated sensor, a real one; the code that uses them cannot tell which.

A file, a folder or a pattern: images. `sim://`: the simulated sensor. `auto`: the one sensor that is plugged in.
`replay://FILE`: a recording.
`sensor://NAME`: the sensor with this serial number or at this USB port. `v4l2:///dev/...`: that camera, its ring only
where `?ring=` names one; `/dev/video0` and `/dev/v4l/...` mean the same. docs/capture.md lists the parameters.
Other distributions add schemes by the entry points `gellight.cameras` (docs/extending.md).
"""

from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path

from gellight.base.errors import CameraError
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, ChooseBundle
from gellight.frames.image_files import KINDS, ImageCamera, image_files, is_file
from gellight.frames.picture import prepared

NODES = ("/dev/video", "/dev/v4l/")
"""how the device nodes of cameras begin"""
REAL = ("auto", "sensor://", "v4l2://", *NODES)
"""how the URLs of real sensors begin"""


def open_camera(
    url: str | Path,
    *,
    geometry: Mapping[str, float | int | str] | None = None,
    bundle: Bundle | ChooseBundle | None = None,
) -> Camera:
    """Open the camera that a URL names, see the top of this file.

    `geometry` is how a simulated sensor differs from the default. A sensor is set and lit as when `bundle` was made:
    give the one that its frames are reconstructed with. Without a bundle the LEDs of a real sensor stay dark until
    `Camera.adopt` lights them, and a simulated one shows its ring full on. Where the bundle takes a view or fills
    marker dots, the frames are prepared so; those of a recording and of a drawn unit already are. A function chooses
    the bundle as soon as the board can be asked; the frames are then as taken. `close`, or the end of `with`, makes the
    LEDs dark. Raises CameraError, BoardError, BundleError, InputError or ConfigError with the remedy.
    """
    camera = _opened(url, geometry, bundle)
    try:
        return prepared(camera, bundle) if isinstance(bundle, Bundle) else camera
    except BaseException:
        camera.close()
        raise


def _opened(
    url: str | Path, geometry: Mapping[str, float | int | str] | None, bundle: Bundle | ChooseBundle | None
) -> Camera:
    """Return the camera that a URL names, set and lit as when `bundle` was made."""
    text = f"v4l2://{url}" if str(url).startswith(NODES) else str(url)
    scheme = text.partition("://")[0].partition("?")[0]
    if scheme == "sim" and "://" in text:
        from gellight.lab.simulator.simulated_camera import open_simulated

        return _adopted(open_simulated(text, geometry or {}), bundle)
    if scheme in ("auto", "sensor", "v4l2") and not is_file(text):
        from gellight.sensor.sensor_camera import open_sensor

        return open_sensor(text, bundle=bundle)
    if scheme == "replay":
        from gellight.recording.replay_camera import open_replay

        return _adopted(open_replay(text), bundle)
    if scheme == "opencv":
        from gellight.sensor.opencv_camera import open_opencv

        return _adopted(open_opencv(text), bundle)
    for theirs in entry_points(group="gellight.cameras", name=scheme) if "://" in text else ():
        return _adopted(theirs.load()(text), bundle)
    if "://" in text:
        raise CameraError(f"no camera speaks {text.split('://')[0]}:// (in {text!r}): {KINDS}")
    return _adopted(ImageCamera(image_files(text), url=text, live=True), bundle)


def _adopted(camera: Camera, bundle: Bundle | ChooseBundle | None) -> Camera:
    """Return `camera`, set and lit as when `bundle` was made; where that fails it is closed, and its LEDs are dark."""
    try:
        chosen = bundle(camera) if callable(bundle) else bundle
        if chosen is not None:
            camera.adopt(chosen.controls, chosen.colours)
    except BaseException:
        camera.close()
        raise
    return camera
