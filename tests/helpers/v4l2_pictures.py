"""A fake camera to open, and pictures for it to send."""

import cv2
import numpy as np

from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.formats import Wanted
from gellight.sensor.v4l2.options import parse_url
from gellight.sensor.v4l2.stream import Stream
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.helpers.fake_kernel import FakeCamera, FakeKernel

PATH = "/dev/video7"
SAMPLINGS = {
    "4:4:4": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    "4:2:2": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422,
    "4:2:0": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
}


def fake(**changes: object) -> tuple[FakeKernel, FakeCamera]:
    camera = FakeCamera(**changes)  # type: ignore[arg-type]
    return FakeKernel({PATH: camera}), camera


def streaming(kernel: FakeKernel, letters: str = "MJPG", buffers: int = 4) -> Stream:
    device = Device(PATH, kernel=kernel)
    device.configure(Wanted(width=640, height=480, letters=letters, fps=30))
    return device.start(buffers=buffers)


def open_v4l2(url: str, kernel: FakeKernel) -> V4l2Camera:
    """Open the camera of a `v4l2://` URL alone, without what `open_camera` adds to it."""
    path, options = parse_url(url)
    return V4l2Camera(path, options, url=url, kernel=kernel)


def jpeg(image: np.ndarray, quality: int = 90) -> bytes:
    return cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def scene(seed: int = 0, shape: tuple[int, int] = (480, 640)) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    waves = np.stack([100 + 80 * np.sin(x / 90), 90 + 80 * np.cos(y / 70), 110 + 60 * np.sin((x + y) / 50)], -1)
    return np.clip(waves + np.random.default_rng(seed).normal(0, 3, waves.shape), 0, 255).astype(np.uint8)


def coded_jpeg(image: np.ndarray, sampling: str = "4:2:2", restart: int = 0, quality: int = 90) -> bytes:
    """Compress (H, W, 3) RGB; `restart`: MCUs between restart markers."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, SAMPLINGS[sampling],
               cv2.IMWRITE_JPEG_RST_INTERVAL, restart]  # fmt: skip
    return cv2.imencode(".jpg", image[..., ::-1], options)[1].tobytes()
