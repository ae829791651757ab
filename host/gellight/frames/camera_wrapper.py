"""The base of cameras that stand in front of another camera and change what is read from it."""

from collections.abc import Mapping
from typing import Any

from gellight.base.errors import BoardError, CameraError
from gellight.base.locking import FairLock
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, CameraControls, CameraTiming, PressStage, ReconnectingError
from gellight.frames.status import CameraStatus
from gellight.ring.light_ring import LightRing
from gellight.ring.transport import SilentError


def _passed_on(name: str) -> Any:
    """Return a property that reads an attribute of the camera inside, and cannot be set."""
    return property(lambda wrapper: getattr(wrapper._camera, name))


class CameraWrapper(Camera):
    """Passes everything but `read` on to the camera inside.

    Nothing is copied: a sensor that was unplugged has another ring and other controls when it is back.
    """

    url: str = _passed_on("url")
    image_shape: tuple[int, int] = _passed_on("image_shape")
    waits: bool = _passed_on("waits")
    stage: PressStage | None = _passed_on("stage")
    ring: LightRing | None = _passed_on("ring")
    bundle: Bundle | None = _passed_on("bundle")
    controls: CameraControls | None = _passed_on("controls")
    adopt: Any = _passed_on("adopt")
    hurry: Any = _passed_on("hurry")
    close: Any = _passed_on("close")

    def __init__(self, camera: Camera) -> None:
        """Take over `camera`."""
        self._camera = camera
        self._fair_lock = FairLock()

    def _alone(self) -> FairLock:
        """Use camera and ring alone. Threads take turns, so `adopt` need not wait for a pause of who reads."""
        return self._fair_lock

    @property
    def bundle_files(self) -> Mapping[str, bytes]:
        """What a bundle for its frames has to hold."""
        return self._camera.bundle_files

    @property
    def timing(self) -> CameraTiming | None:
        """When the camera inside exposes its rows."""
        return self._camera.timing

    def status(self) -> CameraStatus:
        """Return what is known of the camera inside."""
        return self._camera.status()

    def release(self) -> None:
        """Give back what was set and lit for this wrapper; the camera inside stays open."""

    def _why_failed(self, error: BoardError, ring: LightRing | None) -> CameraError | BoardError:
        """Return what to raise where the board failed: `error` itself, or that the stream goes on.

        It goes on where the sensor was unplugged and is back, and where a board that was not heard for a while answers
        again. Raises ReconnectingError itself while the sensor is away.
        """
        self._camera.read()
        if self.ring is not ring:
            return ReconnectingError(f"{self.url} was unplugged and is back: {error}")
        if ring is None or not isinstance(error, SilentError):
            return error
        try:
            ring.clock()
        except BoardError:
            return error
        return ReconnectingError(f"the board of {self.url} answers again: {error}")
