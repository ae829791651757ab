"""A sensor at rest behind a simulated kernel: the capture of real cameras, decoding and all, at no simulation's cost.

The pictures are made beforehand: the bundle's reference with a grey level of noise, as a camera codes it.
"""

from dataclasses import replace

import numpy as np

from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.reconstruction.image_noise import measure_noise
from gellight.sensor.v4l2.decoding import decode
from gellight.sensor.v4l2.options import CaptureOptions
from gellight.sensor.v4l2.video_camera import V4l2Camera
from gellight.watch.monitor import SensorWatch
from tests.helpers.sessions import session_of
from tests.helpers.simulated_kernel import CameraDevice, SimulatedKernel
from tests.virtual_usb.encoding import Mark, to_jpeg, to_yuyv

PICTURES = 32
"""that come in turn"""
PATH = "/dev/video0"


def session_at_rest(letters: str) -> SensorSession:
    """Return a session whose camera sends MJPG or YUYV at 30 frames/s, with a bundle that knows its gel and noise."""
    bundle = load_bundle(SYNTHETIC)
    pictures = coded(bundle, letters)
    height, width = bundle.image_shape
    device = CameraDevice(
        payload=lambda number: pictures[number % PICTURES], formats={letters: {(width, height): [30]}}
    )
    kernel = SimulatedKernel()
    kernel.cameras = {PATH: device}
    camera = V4l2Camera(PATH, CaptureOptions(fps=30), shape=bundle.image_shape, kernel=kernel)
    seen = [decode(picture, camera.mode) for picture in pictures]
    mean = np.mean(seen, axis=0, dtype=np.float32)
    known = bundle.with_reference(mean, frames=PICTURES)
    noise = {"noise_grey": measure_noise(seen, mean).white_grey}
    known = replace(known, manifest=known.manifest.model_copy(update=noise))
    return session_of(camera, Reconstructor(known), watch=SensorWatch(known, rezero=True))


def coded(bundle: Bundle, letters: str) -> list[bytes]:
    """Return pictures of the untouched gel as a camera sends them."""
    rng = np.random.default_rng(0)
    noisy = (bundle.reference + rng.normal(0, 1, (PICTURES, *bundle.reference.shape)).astype(np.float32)).clip(0, 255)
    images = np.round(noisy).astype(np.uint8)
    if letters == "YUYV":
        return [to_yuyv(image) for image in images]
    return [to_jpeg(image, Mark(number, 0.0, 8000)) for number, image in enumerate(images)]
