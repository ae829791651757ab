"""Cameras that wrap a camera pass on every member of the promise, asked for each time and not copied."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gellight.base.mailbox import Mailbox
from gellight.daemon.frame_threads import SharedCamera
from gellight.daemon.switched_camera import SwitchedCamera
from gellight.frames.camera import Camera, CameraTiming
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.picture import PictureSteps, PreparedCamera
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from gellight.sensor.series_camera import SeriesCamera
from tests.helpers.scripted_camera import ScriptedCamera, ScriptedControls
from tests.helpers.scripted_ring import ScriptedRing
from tests.helpers.simulated_gel import RING

GROUPS = np.stack([RING.colours, RING.colours // 2])
WRAPPERS: dict[type[CameraWrapper], Callable[[Camera], CameraWrapper]] = {
    SharedCamera: lambda camera: SharedCamera(camera, Mailbox()),
    SequencedCamera: lambda camera: SequencedCamera(camera, GROUPS, mode=LightMode.HOLD, timing=CameraTiming()),
    SeriesCamera: lambda camera: SeriesCamera(
        SequencedCamera(camera, GROUPS, mode=LightMode.HOLD, timing=CameraTiming()), GROUPS, exposure_us=None
    ),
    PreparedCamera: lambda camera: PreparedCamera(camera, PictureSteps(image_width_px=48, image_height_px=32)),
    SwitchedCamera: SwitchedCamera,
}
ITS_OWN = {
    "read": set(WRAPPERS),
    "timing": {SequencedCamera, SeriesCamera},  # what its labels go by
    "status": {SequencedCamera, SeriesCamera},  # what became of the frames of the sequence, too
    "bundle_files": {PreparedCamera},  # what it does to the pictures
    "close": {SharedCamera},  # the daemon closes its camera
}
"""what a wrapper does not pass on, and which wrappers do not"""
PROMISE = sorted(name for name in {*vars(Camera), *Camera.__annotations__} if not name.startswith("_"))


class Inside(ScriptedCamera):
    """Answers every question with an answer of its own, another one after each change."""

    def __init__(self) -> None:
        super().__init__()
        self.change("first")

    def change(self, mark: str) -> None:
        self.url, self.image_shape, self.mark = f"inside://{mark}", (32, 48), mark
        self.stage: Any = f"stage {mark}"
        self.ring, self.controls = ScriptedRing(), ScriptedControls()

    @property
    def timing(self) -> CameraTiming | None:
        return CameraTiming(readout_s=0.001 * len(self.mark))

    def read(self) -> Any:
        raise AssertionError("nobody reads here")

    def status(self) -> dict[str, object]:
        return {"name": self.mark}


ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "status": (), "adopt": ({"gain": 2.0}, None), "close": (), "hurry": (),
}  # fmt: skip


def subclasses(kind: type) -> set[type]:
    return {kind for child in kind.__subclasses__() for kind in (child, *subclasses(child))}


def test_every_wrapper_is_looked_at() -> None:
    assert {kind for kind in subclasses(CameraWrapper) if kind.__module__.startswith("gellight.")} == set(WRAPPERS)
    assert {"url", "image_shape", "stage", "ring", "controls", "timing", "status", "adopt", "close"} < set(PROMISE)


@pytest.mark.parametrize(
    ("kind", "member"),
    [(kind, member) for member in PROMISE for kind in WRAPPERS if kind not in ITS_OWN.get(member, ())],
)
def test_a_wrapper_answers_as_the_camera_inside_does_now(kind: type[CameraWrapper], member: str) -> None:
    inside = Inside()
    wrapper = WRAPPERS[kind](inside)
    inside.change("second")
    if member not in ARGUMENTS:
        assert getattr(wrapper, member) == getattr(inside, member)
        return
    answer = getattr(wrapper, member)(*ARGUMENTS[member])
    assert inside.adopted == ([ARGUMENTS[member]] if member == "adopt" else [])
    assert inside.closed == (member == "close")
    assert answer == getattr(inside, member)(*ARGUMENTS[member])
