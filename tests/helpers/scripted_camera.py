"""A camera and a reconstruction that do as a test says."""

import dataclasses
import threading
import time
from types import SimpleNamespace
from typing import Self

import numpy as np

from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame, Contact, TactileFrame
from tests.helpers.linear_sensor import reference_image


class ScriptedCamera(Camera):
    """Gives frames as fast as they are taken, then raises `ending`."""

    url = "scripted"
    stage = None
    image_shape = (2, 2)

    def __init__(self, count: int, ending: Exception, period_s: float = 0.0) -> None:
        self.sequence, self.count, self.ending, self.period_s = 0, count, ending, period_s
        self.closed = False

    def read(self) -> CameraFrame:
        time.sleep(self.period_s)
        if self.sequence == self.count:
            raise self.ending
        self.sequence += 1
        return CameraFrame(image=np.zeros((2, 2, 3), np.uint8), time_s=time.monotonic(), sequence=self.sequence)

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> None:
        return None

    def close(self) -> None:
        self.closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()


class FlatCamera(ScriptedCamera):
    """Gives the untouched gel of the linear sensor."""

    image_shape = (24, 32)

    def read(self) -> CameraFrame:
        frame = super().read()
        return dataclasses.replace(frame, image=np.rint(reference_image(self.image_shape)).astype(np.uint8))


class CountingReconstructor:
    """Passes frames through; holds each until `gate` is open."""

    bundle = SimpleNamespace(
        pixel_size_mm=(0.1, 0.2),
        identity="0123456789abcdef",
        manifest=SimpleNamespace(sensor="scripted"),
        metrics={},
        files={},
    )

    def __init__(self) -> None:
        self.gate = threading.Event()
        self.gate.set()
        self.failure: Exception | None = None

    def status(self) -> dict[str, object]:
        return {"mode": "scripted"}

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        assert self.gate.wait(10)
        if self.failure:
            raise self.failure
        flat = np.zeros((2, 2), np.float32)
        return TactileFrame(
            camera_frame=frame,
            difference=np.zeros((2, 2, 3), np.float32),
            gradient_map=np.zeros((2, 2, 2), np.float32),
            normal_map=np.zeros((2, 2, 3), np.float32),
            depth_mm=flat,
            contact=Contact(mask=flat > 0, area_mm2=0.0, indentation_mm=0.0, centroid_mm=None),
        )
