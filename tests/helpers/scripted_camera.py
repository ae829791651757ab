"""A camera, its controls and a reconstruction that do as a test says."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import CameraError
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.simulator.shutter import SimulatedControls
from tests.helpers.linear_sensor import reference_image
from tests.helpers.scripted_ring import Failures, ScriptedRing
from tests.helpers.tactile import tactile

Picture = NDArray[np.uint8] | CameraFrame


class ScriptedControls(SimulatedControls):
    """Exposure, gain and white balance; notes what is set, and fails at the steps of `failures`, by name."""

    def __init__(self, apply: Callable[..., None] = lambda *_: None, failures: Failures | None = None) -> None:
        super().__init__(apply)
        self.failures = failures or Failures()
        self.was_set: list[tuple[str, float]] = []

    def set(self, name: str, value: float) -> float:
        self.failures.step(name, CameraError)
        self.was_set.append((name, value))
        return super().set(name, value)


class ScriptedCamera(Camera):
    """Gives the frames a test says, numbered from 1, and notes what it adopted and whether it was closed.

    `pictures` is the image of every frame (default: black), or gives the image or the whole frame for the number of a
    read; it may wait, raise, or change the camera. Frames come `period_s` after they are asked for, stamped `ahead_s`
    later than that; after `count` of them `ending` is raised.
    """

    stage = None

    def __init__(self, pictures: NDArray[np.uint8] | Callable[[int], Picture] | None = None, *,
                 shape: tuple[int, int] = (2, 2), count: float = inf, ending: Exception | None = None,
                 period_s: float = 0.0, ahead_s: float = 0.0, url: str = "scripted", ring: Any = None,
                 controls: Any = None) -> None:  # fmt: skip
        self.pictures = np.zeros((*shape, 3), np.uint8) if pictures is None else pictures
        self.image_shape = shape if callable(self.pictures) else self.pictures.shape[:2]
        self.sequence, self.count, self.ending = 0, count, ending or EndOfStream("used up")
        self.period_s, self.ahead_s, self.url = period_s, ahead_s, url
        self.ring, self.controls = ring, controls
        self.adopted: list[tuple[dict[str, float], NDArray[np.uint8] | None]] = []
        self.closed = False

    def read(self) -> CameraFrame:
        time.sleep(self.period_s)
        if self.sequence >= self.count:
            raise self.ending
        self.sequence += 1
        time_s = time.monotonic() + self.ahead_s
        picture = self.pictures(self.sequence) if callable(self.pictures) else self.pictures
        if isinstance(picture, CameraFrame):
            return picture
        return CameraFrame(image=picture, time_s=time_s, sequence=self.sequence, source=self.url)

    def adopt(self, controls: Mapping[str, float], colours: NDArray[np.uint8] | None) -> None:
        self.adopted.append((dict(controls), colours))
        super().adopt(controls, colours)

    def close(self) -> None:
        self.closed = True
        if self.ring is not None:
            self.ring.close()


def flat_camera(**options: Any) -> ScriptedCamera:
    """Return a camera that sees the untouched gel of the linear sensor, 24 x 32 px, every 2 ms."""
    image = np.rint(reference_image((24, 32))).astype(np.uint8)
    return ScriptedCamera(image, **{"period_s": 0.002, **options})


class LitCamera(ScriptedCamera):
    """Sees the untouched gel of the linear sensor; each step of its controls and its ring can be made to fail."""

    def __init__(self) -> None:
        self.failures = Failures()
        super().__init__(
            flat_camera().pictures, period_s=0.002, url="lit", ring=ScriptedRing(failures=self.failures),
            controls=ScriptedControls(failures=self.failures),
        )  # fmt: skip

    def setting(self) -> tuple[dict[str, float], list[list[int]]]:
        return {name: self.controls.read(name) for name in self.controls.names()}, self.ring.lit.tolist()


class CountingReconstructor:
    """Passes frames through; holds each until `gate` is open."""

    bundle = SimpleNamespace(
        pixel_size_mm=(0.1, 0.2),
        identity="0123456789abcdef",
        manifest=SimpleNamespace(sensor="scripted", camera_height_mm=0.0),
        metrics={},
        files={},
        controls={},
        colours=None,
        check_fits=lambda camera, image_shape: None,
    )

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.gate.set()
        self.failure: Exception | None = None

    def status(self) -> dict[str, object]:
        return {"mode": "scripted"}

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        assert self.gate.wait(60)
        if self.failure:
            raise self.failure
        return replace(tactile(np.zeros((2, 2))), camera_frame=frame)
