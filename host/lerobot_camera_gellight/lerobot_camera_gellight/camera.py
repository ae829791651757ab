"""The camera `gellight`: it reads the frames of a daemon in another process, on this computer or another one."""

import logging
import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras.camera import Camera
from lerobot.cameras.configs import CameraConfig
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
from numpy.typing import NDArray

import gellight
from gellight.stream.running import running

logger = logging.getLogger(__name__)
FIRST_FRAME_MS = 10_000.0


@CameraConfig.register_subclass("gellight")
@dataclass(kw_only=True)
class GelLightCameraConfig(CameraConfig):
    """Which sensor, and what is read of it."""

    width: int | None = 640
    height: int | None = 480
    fps: int | None = 30
    """what the robot asks for; the sensor has its own frame rate, and a frame may be read twice"""
    sensor: str = "auto"
    """as `gellight.subscribe` takes it: auto, the name of a sensor or zenoh://HOST/NAME"""
    zenoh_config: str | None = None
    """file of zenoh's own settings, for TLS and access control"""
    max_age_ms: float = 500
    """of the frame that `read_latest` returns; a robot that asks for more than the sensor gives fails by it"""
    use_rgb: bool = True
    use_depth: bool = True
    """depth becomes a second feature, NAME_depth: float32 metres, positive into the sensor, 0 at rest"""
    use_force: bool = True
    """the normal force becomes a number of the state, NAME.force_n: newtons, where the bundle has a constant for it"""

    def __post_init__(self) -> None:
        """Refuse a camera of which nothing is read."""
        if not (self.use_rgb or self.use_depth):
            raise ValueError("use_rgb and use_depth are both false: set one of them")


class GelLightCamera(Camera):
    """Image, (H, W, 3) uint8 RGB, and depth, (H, W, 1) float32 metres, of one sensor.

    A depth that is read after an image is of the same frame.
    """

    def __init__(self, config: GelLightCameraConfig) -> None:
        """Remember what to connect to."""
        super().__init__(config)
        self.config = config
        self.use_rgb, self.use_depth = config.use_rgb, config.use_depth
        self._frames: gellight.Subscription | None = None
        self._came = threading.Condition()
        self._newest: gellight.TactileFrame | None = None
        self._newest_s = 0.0
        """when it came"""
        self._fresh = False
        """whether the newest frame has not been read yet"""
        self._paired: gellight.TactileFrame | None = None
        """the frame whose image was read last, and whose depth was not"""
        self._unweighed: gellight.TactileFrame | None = None
        """the frame whose image or depth was read last, and whose force was not"""
        self._weighs: bool | None = None
        """what the daemon said of `has_force`; None: it was not asked yet"""

    def __str__(self) -> str:
        """Name the sensor."""
        return f"GelLightCamera({self.config.sensor})"

    @property
    def is_connected(self) -> bool:
        """Whether `connect` was called, and `disconnect` not yet."""
        return self._frames is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Return the sensors whose daemons run on this computer."""
        return [{"type": "gellight", "name": one.name, "id": one.name, "sensor": one.sensor} for one in running()]

    @check_if_already_connected
    def connect(self, warmup: bool = True) -> None:
        """Subscribe; ConnectionError, with the remedy, where no daemon runs or its images have another size.

        warmup: wait for the first frame and check its size.
        """
        try:
            self._frames = gellight.subscribe(self.config.sensor, config=self.config.zenoh_config)
        except gellight.GellightError as error:
            raise ConnectionError(str(error)) from error
        self._frames.listen(self._note)
        if not warmup:
            return
        try:
            height, width = self._next(FIRST_FRAME_MS).depth_mm.shape
        except TimeoutError as error:
            self.disconnect()
            raise ConnectionError(str(error)) from error
        if (width, height) != (self.width, self.height):
            self.disconnect()
            raise ConnectionError(
                f"{self} gives {width} x {height} px, not {self.width} x {self.height}: set width and height so"
            )

    def _note(self, frame: gellight.TactileFrame) -> None:
        with self._came:
            self._newest, self._newest_s, self._fresh = frame, time.monotonic(), True
            self._came.notify_all()

    def _next(self, timeout_ms: float) -> gellight.TactileFrame:
        """Return the newest frame that was not read yet; wait for one up to `timeout_ms`, then TimeoutError."""
        with self._came:
            came = self._came.wait_for(lambda: self._fresh, timeout_ms * 1e-3)
            self._fresh = False
            if came and self._newest is not None:
                return self._newest
        raise TimeoutError(f"{self}: no new frame for {timeout_ms:g} ms: {self._why()}")

    def _latest(self, max_age_ms: float | None) -> gellight.TactileFrame:
        """Return the newest frame at once; TimeoutError where it came more than `max_age_ms` ago."""
        max_age_ms = self.config.max_age_ms if max_age_ms is None else max_age_ms
        with self._came:
            newest, age_ms = self._newest, (time.monotonic() - self._newest_s) * 1e3
            self._fresh = False
        if newest is None:
            raise RuntimeError(f"{self} has given no frame yet: connect with warmup, or wait by read()")
        if age_ms > max_age_ms:
            raise TimeoutError(
                f"{self}: the latest frame is {age_ms:.0f} ms old, more than {max_age_ms:g}: {self._why()}"
            )
        return newest

    def _why(self) -> str:
        """Return why frames do not come, as far as the daemon says."""
        assert self._frames is not None
        try:
            return str(self._frames.status()["error"] or "the sensor is slower than that; see `gellight status`")
        except gellight.GellightError as error:
            return str(error)

    # ---- images ----

    @check_if_not_connected
    def read(self) -> NDArray[np.uint8]:
        """Wait for a new frame and return its image."""
        return self._image_of(self._next(FIRST_FRAME_MS))

    @check_if_not_connected
    def async_read(self, timeout_ms: float = 200) -> NDArray[np.uint8]:
        """Return the image of the newest frame that was not read yet; TimeoutError where none comes."""
        return self._image_of(self._next(timeout_ms))

    @check_if_not_connected
    def read_latest(self, max_age_ms: float | None = None) -> NDArray[np.uint8]:
        """Return the newest image at once, also one that was read before; TimeoutError where it is too old."""
        return self._image_of(self._latest(max_age_ms))

    def _image_of(self, frame: gellight.TactileFrame) -> NDArray[np.uint8]:
        if not self.use_rgb:
            raise RuntimeError(f"{self} gives no images: set use_rgb")
        self._paired = self._unweighed = frame
        return frame.camera_frame.image.copy()

    # ---- depth ----

    @check_if_not_connected
    def read_depth(self) -> NDArray[np.float32]:
        """Return the depth that belongs to the last image, else wait for a new frame."""
        return self._depth_of(self._pair() or self._next(FIRST_FRAME_MS))

    @check_if_not_connected
    def async_read_depth(self, timeout_ms: float = 200) -> NDArray[np.float32]:
        """Return the depth that belongs to the last image, else that of a new frame; TimeoutError where none comes."""
        return self._depth_of(self._pair() or self._next(timeout_ms))

    @check_if_not_connected
    def read_latest_depth(self, max_age_ms: float | None = None) -> NDArray[np.float32]:
        """Return the depth that belongs to the last image, else the newest; TimeoutError where frames are too old."""
        newest = self._latest(max_age_ms)
        return self._depth_of(self._pair() or newest)

    def _pair(self) -> gellight.TactileFrame | None:
        frame, self._paired = self._paired, None
        return frame

    def _depth_of(self, frame: gellight.TactileFrame) -> NDArray[np.float32]:
        if not self.use_depth:
            raise RuntimeError(f"{self} gives no depth: set use_depth")
        self._unweighed = frame
        depth_m: NDArray[np.float32] = frame.depth_mm * np.float32(1e-3)
        return depth_m[..., None]

    # ---- force ----

    @property
    def has_force(self) -> bool:
        """Whether `use_force` is set and the bundle of the sensor has a constant for the force.

        The daemon is asked, once until `disconnect`; ConnectionError, with the remedy, where none runs.
        """
        if self.config.use_force and self._weighs is None:
            try:
                with gellight.subscribe(self.config.sensor, config=self.config.zenoh_config) as frames:
                    calibration: Any = frames.status()["calibration"]
            except gellight.GellightError as error:
                raise ConnectionError(str(error)) from error
            self._weighs = calibration["force"] is not None
        return bool(self._weighs)

    @check_if_not_connected
    def read_latest_force(self, max_age_ms: float | None = None) -> float:
        """Return the normal force, N, that belongs to the last image or depth, else the newest.

        TimeoutError where frames are too old, RuntimeError where the bundle has no constant for it.
        """
        newest = self._latest(max_age_ms)
        frame, self._unweighed = self._unweighed or newest, None
        if frame.force is None:
            raise RuntimeError(f"{self}: its bundle has no constant for the force: see `gellight calibrate force`")
        return frame.force.normal_n

    def disconnect(self) -> None:
        """Unsubscribe."""
        frames, self._frames = self._frames, None
        self._newest = self._paired = self._unweighed = self._weighs = None
        if frames is None:
            return
        try:
            frames.close()
        except gellight.GellightError as error:  # the daemon ended before; whoever read was told so
            logger.warning("%s: %s", self, error)
