"""What the guest does with cameras: the product's own capture on the real driver. Runs in the guest."""

import os
import statistics
import time
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import cv2

from gellight.base.errors import CameraError, GellightError
from gellight.lab.doctor.sensor_checks import check_stamps
from gellight.sensor.v4l2.formats import decode
from gellight.sensor.v4l2.options import CaptureOptions
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.virtual_usb.encoding import read_mark
from tests.vm.inside.agent import report
from tests.vm.inside.plugging import video_link

SLOW_S = 0.12
"""how long a slow program works on each picture"""
FIXED = {"exposure_us": "8000", "gain": "0", "white_balance_k": "4600"}
"""the values with which the virtual camera shows what the simulated one took"""


def opened(serial: str, options: str = "") -> V4l2Camera:
    """Open a sensor's camera by its link."""
    wanted = CaptureOptions.model_validate({**FIXED, **dict(parse_qsl(options))})
    return V4l2Camera(str(video_link(serial)), wanted)


def stream(serial: str, options: str, count: int) -> dict[str, Any]:
    """Stream `count` pictures; return what came with them."""
    with opened(serial, options) as camera:
        pictures = [camera.picture() for _ in range(count)]
        image = decode(pictures[-1].data, camera.mode)
        return {
            "mode": str(camera.mode),
            "shape": image.shape,
            "sequence": [picture.sequence for picture in pictures],
            "stamps": [picture.stamp_s for picture in pictures],
            "sound": [picture.stamp_is_sound for picture in pictures],
            "numbers": [read_mark(picture.data).number for picture in pictures] if "MJPG" in options else [],
            "picture": image[::4, ::4].tolist(),
            "status": camera.status(),
        }


def formats(serial: str) -> list[str]:
    """Return what the camera offers."""
    with opened(serial) as camera:
        return [str(offer) for offer in camera._device.offers()]


def set_controls(serial: str, values: dict[str, float]) -> dict[str, Any]:
    """Set controls while streaming; return what holds then and how bright the picture is before and after."""
    with opened(serial) as camera:
        before = _settled(camera)
        held = {name: camera.controls.set(name, value) for name, value in values.items()}
        return {
            "held": held,
            "read": {name: camera.controls.read(name) for name in values},
            "ranges": {name: camera.controls.range(name) for name in camera.controls.names()},
            "locked": camera.controls.locked(),
            "brighter": _settled(camera) / before,
        }


def _settled(camera: V4l2Camera) -> float:
    return float([camera.read() for _ in range(6)][-1].image.mean())


def complaint(serial: str, options: str, user: int = 0) -> str:
    """Open a camera as a user and read; return the message of the error that it is."""
    os.setuid(user)
    try:
        with opened(serial, options) as camera:
            for _ in range(30):
                camera.read()
    except GellightError as error:
        return f"{type(error).__name__}: {error}"
    return ""


def read_frames(serial: str, options: str, count: int) -> dict[str, int]:
    """Read decoded frames as the daemon does; return the counts of the stream."""
    with opened(serial, options) as camera:
        for _ in range(count):
            camera.read()
        return camera.counts.as_json()


def stamps(serial: str, count: int = 45) -> dict[str, str]:
    """Return what the check of the time stamps, as in `gellight doctor`, says."""
    with opened(serial) as camera:
        return check_stamps(camera, [camera.picture() for _ in range(count)]).as_json()


def watch(serial: str) -> dict[str, Any]:
    """Stream until the camera fails; report the first picture, and tell what failed and how soon."""
    with opened(serial) as camera:
        camera.read()
        report("streaming")
        last_s = time.monotonic()
        try:
            while True:
                camera.read()
                last_s = time.monotonic()
        except CameraError as error:
            return {"error": type(error).__name__, "text": str(error), "seconds": time.monotonic() - last_s}


def ages(serial: str, offset_s: float, count: int = 14) -> dict[str, float]:
    """Return the median and 95th percentile age (s) of pictures that a slow program gets, by ours and by OpenCV.

    Age: from the start of the exposure to the moment at which the program has the picture.
    """
    ours, theirs = [], []
    with opened(serial, "format=MJPG") as camera:
        for _ in range(count):
            taken_s = read_mark(camera.picture().data).time_s + offset_s
            ours.append(time.monotonic() - taken_s)
            time.sleep(SLOW_S)
    capture = cv2.VideoCapture(str(Path(video_link(serial)).resolve()), cv2.CAP_V4L2)
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    for _ in range(count):
        found, raw = capture.read()
        if not found:
            raise TimeoutError("OpenCV got no picture")
        taken_s = read_mark(raw.tobytes()).time_s + offset_s
        theirs.append(time.monotonic() - taken_s)
        time.sleep(SLOW_S)
    capture.release()
    both = {"ours": sorted(ours[4:]), "OpenCV": sorted(theirs[4:])}  # both queues are full by then
    return {
        **{f"{name} median": statistics.median(values) for name, values in both.items()},
        **{f"{name} 95 %": values[round(0.95 * (len(values) - 1))] for name, values in both.items()},
    }
