"""Cameras by URL: image files, a simulated sensor, a real one; the code that uses them cannot tell which.

A file, a folder or a pattern: images. `sim://`: the simulated sensor. `auto`: the one sensor that is plugged in.
`sensor://NAME`: the sensor with this serial number or at this USB port. `v4l2:///dev/...`: that camera, its ring only
where `?ring=` names one. docs/capture.md lists the parameters.
"""

import glob
import re
import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.errors import CameraError, InputError
from gellight.frames import CameraFrame

if TYPE_CHECKING:
    from gellight.calibration import Calibration
    from gellight.lighting.timing import CameraTiming
    from gellight.ring import LightRing
    from gellight.selfcheck import SelfCheck

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_KINDS = (
    "give an image file, a folder of images, a quoted pattern such as 'presses/*.png', sim://, auto, sensor://NAME or "
    "v4l2:///dev/video0"
)


class EndOfStream(CameraError):  # noqa: N818  (it is the end, not a fault)
    """The camera has delivered its last frame; more will not come."""


class ReconnectingError(CameraError):
    """The sensor is away and looked for; reading again goes on looking, and returns frames when it is back."""


class PressStage(Protocol):
    """What presses objects into the gel of a simulated sensor."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that can be pressed."""

    @property
    def max_depth_mm(self) -> float:
        """Deepest press allowed."""

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press an object `depth_mm` deep at (x, y) mm from the image centre; it stays until released."""

    def release(self) -> None:
        """Lift the object off the gel."""

    def take_over(self) -> None:
        """Lift the object, and let no programme press by itself any more."""

    def status(self) -> dict[str, object]:
        """Return object, depth_mm, x_mm, y_mm and visitor: whether someone other than a programme presses."""


class CameraControls(Protocol):
    """The controls of a camera by name: `exposure_us`, `gain`, `white_balance_k`; automatic ones are off."""

    def names(self) -> tuple[str, ...]:
        """Names of the controls that this camera has."""

    def range(self, name: str) -> tuple[float, float, float]:
        """Return smallest and largest value and the step; CameraError for a control that is not there."""

    def read(self, name: str) -> float:
        """Return the value in force."""

    def set(self, name: str, value: float) -> float:
        """Set a value, read it back and return what holds now.

        Raises InputError for a value out of range and CameraError where the camera does not keep it.
        """


@runtime_checkable
class Camera(Protocol):
    """A source of camera frames; a context manager that closes its device. Cameras inherit from it."""

    url: str
    """what it was opened with"""
    image_shape: tuple[int, int]
    """(H, W) of every frame"""
    stage: PressStage | None
    """the stage of a simulated sensor; None where objects are pressed by hand"""
    ring: "LightRing | None" = None
    """the light ring of the same sensor, closed with the camera; None where the light cannot be driven"""
    controls: CameraControls | None = None
    """exposure, gain and white balance; None where there is nothing to set"""

    @property
    def timing(self) -> "CameraTiming | None":
        """When its rows are exposed, for labels of light; None where it is not known."""
        return None

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> "SelfCheck | None":
        """Return what judges the reconstruction of its frames; None where the truth cannot be known."""

    def read(self) -> CameraFrame:
        """Wait for the next frame; raises EndOfStream after the last one and CameraError on a fault."""

    def status(self) -> dict[str, object]:
        """Return what is known of the device, ready for JSON; nothing where there is none."""
        return {}

    def adopt(self, calibration: "Calibration") -> None:
        """Set and light the sensor as another bundle says; nothing where nothing can be set. Raises as opening does."""
        return

    def close(self) -> None:
        """Release the device; reading afterwards raises CameraError."""

    def __enter__(self) -> Self:
        """Give the camera itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the camera."""
        self.close()


def open_camera(
    url: str | Path,
    *,
    geometry: Mapping[str, float | int | str] | None = None,
    calibration: "Calibration | None" = None,
) -> Camera:
    """Open the camera that a URL names, see the top of this file.

    `geometry` is how a simulated sensor differs from the paper's. A real sensor is set and lit as `calibration` was
    made; without one its LEDs stay dark. Raises CameraError, BoardError, InputError or ConfigError with the remedy.
    """
    text = str(url)
    scheme = text.partition("://")[0].partition("?")[0]
    if scheme == "sim" and "://" in text:
        camera: Camera = import_module("gellight.simulated").open_simulated(text, geometry or {})
        return camera
    if scheme in ("auto", "sensor", "v4l2") and not _is_file(text):
        opened: Camera = import_module("gellight.sensor_camera").open_sensor(text, calibration=calibration)
        return opened
    if scheme == "opencv":
        fallback: Camera = import_module("gellight.opencv_camera").open_opencv(text)
        return fallback
    if "://" in text:
        raise CameraError(f"no camera speaks {text.split('://')[0]}:// (in {text!r}): {_KINDS}")
    return ImageCamera(image_files(text), url=text)


class ImageCamera(Camera):
    """Deliver image files, each once and in the given order, as the frames of a camera."""

    def __init__(self, paths: Sequence[Path], *, url: str | None = None) -> None:
        """Open the files; the first one is read to learn the size, the others when their turn comes."""
        if not paths:
            raise CameraError(f"no images: {_KINDS}")
        self._paths = tuple(paths)
        self.url = url if url is not None else str(paths[0])
        height, width, _ = read_image(self._paths[0]).shape
        self.image_shape = (height, width)
        self.stage = None
        self._next = 0
        self._closed = False

    def __len__(self) -> int:
        """Count the images, read or not."""
        return len(self._paths)

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> None:
        """Return None: nobody knows what was really pressed."""

    def read(self) -> CameraFrame:
        """Read the next image; raises EndOfStream after the last one."""
        if self._closed:
            raise CameraError(f"camera {self.url} is closed: open it again")
        if self._next >= len(self._paths):
            raise EndOfStream(f"camera {self.url} has delivered all of its {len(self._paths)} images")
        sequence, path = self._next, self._paths[self._next]
        self._next += 1
        image = read_image(path)
        if image.shape[:2] != self.image_shape:
            raise InputError(
                f"{path} is {_size(image.shape)}, {self._paths[0].name} is {_size(self.image_shape)}: "
                "put images of one size together"
            )
        return CameraFrame(image=image, time_s=time.monotonic(), sequence=sequence, source=str(path))

    def close(self) -> None:
        """End the delivery."""
        self._closed = True


def read_image(path: Path) -> NDArray[np.uint8]:
    """Read an image file of three 8-bit channels as (H, W, 3) RGB; anything else raises InputError."""
    if not path.is_file():
        raise InputError(f"image {path} does not exist: check the name")
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise InputError(f"{path} is not an image by its name: convert it to one of {' '.join(IMAGE_SUFFIXES)}")
    try:
        content = np.fromfile(path, np.uint8)
        image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION) if content.size else None
    except (OSError, cv2.error) as error:
        raise InputError(f"{path} cannot be read ({error}): capture or copy it again") from error
    if image is None:
        raise InputError(f"{path} is not an image or is cut off: capture or copy it again")
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InputError(
            f"{path} has {channels} channels of {image.dtype.itemsize * 8} bit: "
            "capture it as RGB with 8 bit per channel and without alpha"
        )
    return np.ascontiguousarray(image[..., ::-1])


def image_files(text: str) -> list[Path]:
    """List the files that a folder, a pattern or a file name stands for, in natural order."""
    path = Path(text)
    if _is_file(text) and path.is_dir():
        found = [p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and not p.name.startswith(".")]
        if not found:
            raise CameraError(f"folder {path} has no images ({' '.join(IMAGE_SUFFIXES)}): {_KINDS}")
    elif _is_file(text):
        found = [path]
    else:
        found = [Path(name) for name in glob.glob(text)]  # noqa: PTH207  (the pattern may be absolute)
        if not found:
            raise CameraError(f"{text!r} is no file, no folder and no pattern that matches a file: {_KINDS}")
    return sorted(found, key=_natural)


def _is_file(text: str) -> bool:
    """Whether it is the name of a file or a folder; one that is too long for a name is not."""
    try:
        return Path(text).exists()
    except OSError:
        return False


def _natural(path: Path) -> tuple[list[tuple[int, int | str]], str]:
    """Sort key that puts image2 before image10."""
    pieces = re.split(r"(\d+)", path.name)
    return [(0, int(piece)) if piece.isdecimal() else (1, piece.lower()) for piece in pieces], str(path)


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]} px"
