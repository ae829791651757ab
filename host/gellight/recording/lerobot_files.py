"""Tactile frames as a LeRobot dataset of version 3.0, written by pyarrow: LeRobot itself would bring PyTorch.

One recording is one episode. LeRobot counts time in frames, so `timestamp` is the number of the frame over the frame
rate; `observation.time_s` is when it was taken, since the first one. Depth is in metres, as the camera plug-in gives
it, rounded by 0.03 um at most, so that it is packed. The pose of the object is no observation: it is NaN where there is
none, and a policy that takes every observation must not meet that. Neither has an entry in the statistics.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.packages import needed
from gellight.base.writing import whole
from gellight.frames.frames import TactileFrame
from gellight.recording.array_files import Actions, with_actions

IMAGE, DEPTH, STATE, TIME = (f"observation.{name}" for name in ("images.gel", "gel_depth", "state", "time_s"))
NUMBER, MOTION, COVARIANCE = (f"object.{name}" for name in ("number", "motion", "covariance"))
"""of `frames.pose.ObjectPose`; matrices row by row"""
POSE_SIZES = {MOTION: 16, COVARIANCE: 36}
INDICES = ("frame_index", "episode_index", "index", "task_index")
ACTION = "action"
STEP_M = 2.0**-24
REMEDY = "this needs a package: pip install pyarrow"
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIRST = "chunk-000/file-000.parquet"


def write_lerobot(
    frames: Iterable[TactileFrame],
    folder: Path,
    *,
    fps: float,
    task: str,
    png: Callable[[NDArray[np.uint8]], bytes],
    tracked: bool = False,
    actions: Actions | None = None,
) -> int:
    """Write frames as one episode into a new `folder`, all or nothing, and return their number.

    task: what was done, in words. png: encodes an image. tracked: the pose of the object is written too. actions: a row
    of numbers for each frame, what was done in it. Raises InputError where the folder exists, without pyarrow or
    frames, and where actions do not fit.
    """
    if folder.exists():
        raise InputError(f"{folder} exists: choose another folder, or remove it")
    rate, statistics, count = max(round(fps), 1), Statistics(), 0
    with whole(folder) as draft:
        rows = with_actions(frames, actions)
        begun = next(rows, None)
        if begun is None:
            raise InputError("the recording has no frames")
        first, done = begun
        names = state_names(first)
        features = features_of(first, names, tracked=tracked, actions=len(done or ()))
        with _table(draft / "data" / _FIRST, features) as append:
            for count, (frame, action) in enumerate(chain([begun], rows), start=1):
                state = np.array([_state(frame)[name] for name in names], np.float32)
                statistics.add(frame.camera_frame.image, state, action)
                image = {"bytes": png(frame.camera_frame.image), "path": None}
                since_s = frame.camera_frame.time_s - first.camera_frame.time_s
                row = _row(frame, count - 1, rate) | (_pose(frame) if tracked else {})
                row |= {} if action is None else {ACTION: action}
                append({IMAGE: image, STATE: state.tolist(), TIME: since_s, **row})
        _write_meta(draft, features, statistics, count, rate, task)
    return count


def state_names(frame: TactileFrame) -> list[str]:
    """Return what `observation.state` holds, in its order; the force where the bundle has its constant."""
    return list(_state(frame))


def _state(frame: TactileFrame) -> dict[str, float]:
    felt = {"indentation_mm": frame.contact.indentation_mm, "area_mm2": frame.contact.area_mm2}
    return felt | ({"force_n": frame.force.normal_n} if frame.force else {}) | _along(frame)


def _along(frame: TactileFrame) -> dict[str, float]:
    """Return the force along the gel, of a gel with marker dots; NaN where it is unknown."""
    if frame.shear is None:
        return {}
    x, y = frame.shear.force_n or (nan, nan)
    torque = frame.shear.torque_nmm
    return {"force_x_n": x, "force_y_n": y, "torque_nmm": nan if torque is None else torque}


def _pose(frame: TactileFrame) -> dict[str, Any]:
    """Return the number of the object, 0 without one, and its pose, NaN without one or where it is lost."""
    pose = frame.pose
    if pose is None:
        return {NUMBER: 0, **{name: [nan] * size for name, size in POSE_SIZES.items()}}
    return {NUMBER: pose.number, MOTION: pose.motion.ravel().tolist(), COVARIANCE: pose.covariance.ravel().tolist()}


def features_of(
    frame: TactileFrame, names: Sequence[str], *, tracked: bool, actions: int = 0
) -> dict[str, dict[str, Any]]:
    """Return the features as info.json lists them."""
    height, width = frame.depth_mm.shape
    axes = ["height", "width", "channels"]
    single = {"shape": [1], "names": None}
    poses = {name: {"dtype": "float32", "shape": [size], "names": None} for name, size in POSE_SIZES.items()}
    of_object = {NUMBER: {"dtype": "int64", **single}, **poses} if tracked else {}
    return {
        IMAGE: {"dtype": "image", "shape": [height, width, 3], "names": axes},
        DEPTH: {"dtype": "float32", "shape": [height, width, 1], "names": axes},
        STATE: {"dtype": "float32", "shape": [len(names)], "names": list(names)},
        TIME: {"dtype": "float32", **single},
        **of_object,
        **({ACTION: {"dtype": "float32", "shape": [actions], "names": None}} if actions else {}),
        "timestamp": {"dtype": "float32", **single},
        **{name: {"dtype": "int64", **single} for name in INDICES},
    }


class Statistics:
    """Least, largest, mean and standard deviation of images, of each channel and 0 to 1, and of states."""

    def __init__(self) -> None:
        """Begin without frames."""
        self._states: list[NDArray[np.float32]] = []
        self._actions: list[Sequence[float]] = []
        self._channels: list[NDArray[np.float64]] = []

    def add(self, image: NDArray[np.uint8], state: NDArray[np.float32], action: Sequence[float] | None = None) -> None:
        """Take in a frame."""
        self._actions += [] if action is None else [action]
        levels = image.reshape(-1, 3) / 255
        self._states.append(state)
        self._channels.append(np.array([levels.min(0), levels.max(0), levels.mean(0), (levels**2).mean(0)]))

    def record(self) -> dict[str, dict[str, Any]]:
        """Return what stats.json holds."""
        low, high, mean, square = (np.array(self._channels)[:, part] for part in range(4))
        spread = np.sqrt(np.maximum(square.mean(0) - mean.mean(0) ** 2, 0))
        count = [len(self._states)]
        vectors = {STATE: self._states} | ({ACTION: self._actions} if self._actions else {})
        channels = {"min": low.min(0), "max": high.max(0), "mean": mean.mean(0), "std": spread}
        return {
            IMAGE: {name: values[:, None, None].tolist() for name, values in channels.items()} | {"count": count},
            **{name: _spread(np.array(rows, np.float64)) | {"count": count} for name, rows in vectors.items()},
        }


def _spread(rows: NDArray[np.float64]) -> dict[str, Any]:
    """Return least, largest, mean and standard deviation of each column."""
    figures = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    return {name: values.tolist() for name, values in figures.items()}


def _row(frame: TactileFrame, number: int, rate: int) -> dict[str, Any]:
    """Return the depth of a frame and its indices."""
    return {
        DEPTH: (np.round(frame.depth_mm[..., None] / (1000 * STEP_M)) * STEP_M).tolist(),
        "timestamp": number / rate,
        **dict.fromkeys(INDICES, 0),
        "frame_index": number,
        "index": number,
    }


@contextmanager
def _table(path: Path, features: dict[str, dict[str, Any]]) -> Iterator[Any]:
    """Open the file of the frames; yields what appends a row."""
    with needed(REMEDY):
        import pyarrow as pa
        from pyarrow import parquet
    kinds = {"float32": pa.float32(), "int64": pa.int64()}
    fields: dict[str, Any] = {name: kinds.get(one["dtype"]) for name, one in features.items()}
    fields[IMAGE] = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    fields[DEPTH] = pa.list_(pa.list_(pa.list_(pa.float32())))
    for name in _vectors(features):
        fields[name] = pa.list_(pa.float32(), features[name]["shape"][0])
    schema = pa.schema(list(fields.items()), metadata={"huggingface": json.dumps(_kinds_of_datasets(features))})
    path.parent.mkdir(parents=True)
    with parquet.ParquetWriter(path, schema, compression="zstd", use_dictionary=False) as writer:
        yield lambda row: writer.write_table(pa.Table.from_pylist([row], schema))


def _vectors(features: dict[str, dict[str, Any]]) -> list[str]:
    """Return which features are rows of numbers."""
    return [name for name in features if name in (STATE, ACTION, *POSE_SIZES)]


def _kinds_of_datasets(features: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return how the library `datasets` is told of the columns."""
    kinds: dict[str, Any] = {name: {"dtype": one["dtype"], "_type": "Value"} for name, one in features.items()}
    kinds[IMAGE] = {"_type": "Image"}
    kinds[DEPTH] = {"shape": features[DEPTH]["shape"], "dtype": "float32", "_type": "Array3D"}
    for name in _vectors(features):
        kinds[name] = {"feature": kinds[name], "length": features[name]["shape"][0], "_type": "List"}
    return {"info": {"features": kinds}}


def _write_meta(
    folder: Path, features: dict[str, dict[str, Any]], statistics: Statistics, count: int, rate: int, task: str
) -> None:
    """Write what describes the frames: info.json, stats.json, the tasks and the episodes."""
    import pyarrow as pa
    from pyarrow import parquet

    info = {
        "codebase_version": "v3.0", "robot_type": None, "fps": rate, "features": features, "total_episodes": 1,
        "total_frames": count, "total_tasks": 1, "chunks_size": 1000, "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200, "data_path": _DATA, "video_path": None, "splits": {"train": "0:1"},
    }  # fmt: skip
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info, indent=4))
    (folder / "meta/stats.json").write_text(json.dumps(statistics.record(), indent=4))
    places = {f"{kind}/{part}_index": 0 for kind in ("data", "meta/episodes") for part in ("chunk", "file")}
    episode = {"episode_index": 0, "tasks": [task], "length": count, "dataset_from_index": 0, "dataset_to_index": count}
    parquet.write_table(pa.Table.from_pylist([{**episode, **places}]), folder / "meta/episodes" / _FIRST)
    columns = [_column("task_index", "int64", "int64"), _column("task", "unicode", "object")]
    index = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    tasks = pa.Table.from_pylist([{"task_index": 0, "task": task}]).replace_schema_metadata(
        {"pandas": json.dumps(index)}
    )
    parquet.write_table(tasks, folder / "meta/tasks.parquet")


def _column(name: str, kind: str, held_as: str) -> dict[str, Any]:
    """Describe a column to pandas."""
    return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": held_as, "metadata": None}
