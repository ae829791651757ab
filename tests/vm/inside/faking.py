"""What the guest does with vivid, the kernel's own fake camera, and its faults. Runs in the guest."""

import itertools
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.options import CaptureOptions
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.vm.inside.plugging import settle, wait_for

NEXT_CONTROL = 0x80000000
"""flag of V4L2_CTRL_FLAG_NEXT_CTRL: the control after this number"""
OPTIONS = {"format": "YUYV", "width": 320, "height": 180, "gain": 77}


def load(modules: list[str]) -> str:
    """Load the driver with one camera and return its node."""
    for module in modules:
        options = ["n_devs=1", "node_types=0x1", "num_inputs=1", "input_types=0"] if "vivid" in module else []
        subprocess.run(["busybox", "insmod", module, *options], check=True)
    node = wait_for(_node, "vivid's node")
    settle()
    return node


def unload() -> None:
    """Take the driver out again, so that discovery meets USB devices alone."""
    subprocess.run(["busybox", "rmmod", "vivid"], check=True)
    settle()


def _node() -> str:
    names = sorted(Path("/sys/class/video4linux").glob("video*/name"))
    return next((f"/dev/{name.parent.name}" for name in names if name.read_text().startswith("vivid")), "")


def bars(letters: str) -> list[list[float]]:
    """Return the mean colour of each of the eight bars that vivid shows, below the text that it writes over them."""
    options = CaptureOptions.model_validate({**OPTIONS, "format": letters})
    with V4l2Camera(_node(), options) as camera:
        image = camera.read().image
    columns = image[image.shape[0] * 3 // 4 :].mean(axis=0)
    return [bar[len(bar) // 4 : -len(bar) // 4].mean(axis=0).tolist() for bar in np.array_split(columns, 8)]


def set_fault(device: Device, name: str, value: int) -> None:
    """Set one of vivid's controls by its name."""
    number = NEXT_CONTROL
    while True:
        description = v.ControlDescription(id=number)
        device.ask(v.QUERYCTRL, description)  # OSError after the last one
        if description.name.decode() == name:
            break
        number = description.id | NEXT_CONTROL
    device.ask(v.S_CTRL, v.Control(id=description.id, value=value))


def stream(before: dict[str, int], during: dict[str, int], count: int) -> dict[str, Any]:
    """Stream with faults that are set before the start or after the first picture; return what came."""
    node = _node()
    with Device(node) as other:
        _set(other, before)
        try:
            with V4l2Camera(node, CaptureOptions.model_validate(OPTIONS)) as camera:
                camera.picture()
                _set(other, during)
                pictures = [camera.picture() for _ in range(count)]
                return {
                    "counts": camera.counts.as_json(),
                    "gain": camera.controls.read("gain"),
                    "mode": str(camera.mode),
                    "sound": [picture.stamp_is_sound for picture in pictures],
                    "ahead": [picture.stamp_s > picture.arrived_s for picture in pictures],
                    "steps": [later.sequence - first.sequence for first, later in itertools.pairwise(pictures)],
                }
        finally:
            _set(other, dict.fromkeys({**before, **during}, 0))


def _set(device: Device, faults: dict[str, int]) -> None:
    for name, value in faults.items():
        set_fault(device, name, value)
