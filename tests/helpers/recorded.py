"""Camera frames to record, and those that a camera gives until it ends."""

import cv2
import numpy as np

from gellight.frames.camera import EndOfStream
from gellight.frames.frames import CameraFrame, EncodedImage, LightLabel, LightState
from gellight.opening import open_camera

SHAPE = (48, 64)
LIGHT = np.arange(36, dtype=np.uint8).reshape(12, 3)


def picture(seed: int) -> np.ndarray:
    return cv2.GaussianBlur(np.random.default_rng(seed).integers(0, 256, (*SHAPE, 3), np.uint8), (9, 9), 3)


def plain(sequence: int) -> CameraFrame:
    """A frame of a camera that gives no bytes of its own."""
    label = LightLabel(state=LightState.CLEAN, group=2)
    return CameraFrame(image=picture(sequence), time_s=sequence / 30, sequence=sequence, light=LIGHT, label=label)


def encoded(sequence: int, letters: str) -> CameraFrame:
    """A frame whose image was decoded from the camera's bytes; only the bytes count."""
    rgb = picture(sequence)
    line_bytes = 0
    if letters == "MJPG":
        data = cv2.imencode(".jpg", rgb)[1].tobytes()
    elif letters == "GREY":
        line_bytes = 80  # wider in memory than the picture
        data = np.pad(rgb[..., 0], ((0, 0), (0, 16))).tobytes()
    else:
        data = np.random.default_rng(sequence).integers(0, 256, (*SHAPE, 2), np.uint8).tobytes()
    encoded = EncodedImage(data=data, letters=letters, line_bytes=line_bytes)
    return CameraFrame(image=rgb, time_s=sequence / 30, sequence=sequence, encoded=encoded)


def read_all(url: str) -> list[CameraFrame]:
    frames = []
    with open_camera(url) as camera:
        try:
            while True:
                frames.append(camera.read())
        except EndOfStream:
            return frames
