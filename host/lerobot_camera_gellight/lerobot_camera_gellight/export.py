"""Tactile frames as a LeRobot dataset of one episode, by LeRobot's own writer: `gellight export --as lerobot`.

LeRobot counts time in frames, so `timestamp` is the number of the frame over the frame rate; `observation.time_s` is
when it was taken, since the first one. The pose of the object is no observation: it is NaN where there is none, and a
policy that takes every observation must not meet that.
"""

from collections.abc import Iterable
from itertools import chain
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import whole
from gellight.frames.frames import TactileFrame
from gellight.recording.array_files import Actions, with_actions

IMAGE, DEPTH, STATE, TIME = (f"observation.{name}" for name in ("images.gel", "gel_depth", "state", "time_s"))
NUMBER, MOTION, COVARIANCE = (f"object.{name}" for name in ("number", "motion", "covariance"))
"""of `frames.pose.ObjectPose`; matrices row by row"""
ACTION = "action"


def write_episode(
    frames: Iterable[TactileFrame],
    folder: Path,
    *,
    fps: float,
    task: str,
    tracked: bool = False,
    actions: Actions | None = None,
) -> int:
    """Write frames as one episode into a new `folder`, all or nothing, and return their number.

    task: what was done, in words. tracked: the pose of the object is written too. actions: a row of numbers for each
    frame, what was done in it. Raises InputError where the folder exists, without frames, and where actions do not fit.
    """
    if folder.exists():
        raise InputError(f"{folder} exists: choose another folder, or remove it")
    rows = with_actions(frames, actions)
    begun = next(rows, None)
    if begun is None:
        raise InputError("the recording has no frames")
    first, done = begun
    with whole(folder) as draft:
        dataset = LeRobotDataset.create(
            repo_id=f"local/{folder.name}",
            fps=max(round(fps), 1),
            root=draft,
            use_videos=False,
            features=features_of(first, tracked=tracked, actions=len(done or ())),
        )
        count = 0
        for frame, action in chain([begun], rows):
            since_s = frame.camera_frame.time_s - first.camera_frame.time_s
            row = observed(frame, since_s) | (pose_of(frame) if tracked else {})
            row |= {} if action is None else {ACTION: np.array(action, np.float32)}
            dataset.add_frame(row | {"task": task})
            count += 1
        dataset.save_episode()
        dataset.finalize()
    return count


def features_of(frame: TactileFrame, *, tracked: bool, actions: int = 0) -> dict[str, dict[str, Any]]:
    """Return what LeRobot is told of each column; depth is an image of float32 metres."""
    size, axes = frame.depth_mm.shape, ["height", "width", "channels"]
    sizes = {TIME: 1} | ({MOTION: 16, COVARIANCE: 36} if tracked else {}) | ({ACTION: actions} if actions else {})
    names = list(state_of(frame))
    return {
        IMAGE: {"dtype": "image", "shape": (*size, 3), "names": axes},
        DEPTH: {"dtype": "image", "shape": (*size, 1), "names": axes, "info": {"is_depth_map": True}},
        STATE: {"dtype": "float32", "shape": (len(names),), "names": names},
        **{name: {"dtype": "float32", "shape": (count,), "names": None} for name, count in sizes.items()},
        **({NUMBER: {"dtype": "int64", "shape": (1,), "names": None}} if tracked else {}),
    }


def observed(frame: TactileFrame, since_s: float) -> dict[str, NDArray[Any]]:
    """Return what is observed in a frame."""
    return {
        IMAGE: frame.camera_frame.image,
        DEPTH: frame.depth_mm[..., None] * np.float32(1e-3),
        STATE: np.array(list(state_of(frame).values()), np.float32),
        TIME: np.array([since_s], np.float32),
    }


def state_of(frame: TactileFrame) -> dict[str, float]:
    """Return `observation.state` by name: the force where the bundle has its constant, along the gel where it has dots.

    NaN where a force is unknown.
    """
    state = {"indentation_mm": frame.contact.indentation_mm, "area_mm2": frame.contact.area_mm2}
    if frame.force:
        state["force_n"] = frame.force.normal_n
    if frame.shear:
        x, y = frame.shear.force_n or (nan, nan)
        torque = frame.shear.torque_nmm
        state |= {"force_x_n": x, "force_y_n": y, "torque_nmm": nan if torque is None else torque}
    return state


def pose_of(frame: TactileFrame) -> dict[str, NDArray[Any]]:
    """Return the number of the object, 0 without one, and its pose, NaN without one or where it is lost."""
    pose = frame.pose
    motion, covariance = (pose.motion, pose.covariance) if pose else (np.full((4, 4), nan), np.full((6, 6), nan))
    return {
        NUMBER: np.array([pose.number if pose else 0]),
        MOTION: motion.ravel().astype(np.float32),
        COVARIANCE: covariance.ravel().astype(np.float32),
    }
