"""Tactile frames as WebDataset shards: tar files whose samples are files of one name, read from front to back.

A sample is `NUMBER.image.png`, `NUMBER.depth.png` (uint16) and `NUMBER.figures.json`. Python's tarfile writes them: the
library itself would bring PyTorch.
"""

import io
import json
import tarfile
from collections.abc import Callable, Iterable, Sequence
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import whole
from gellight.frames.frames import TactileFrame
from gellight.recording.array_files import Actions, figures_of, with_actions

STEP_MM, LEAST_MM = 1e-4, -1.5
"""depth = value STEP_MM + LEAST_MM, so from -1.5 to 5.05 mm, off by 0.05 um at most"""
CARD = """# {task}

{frames} frames of a GelLight tactile sensor, in WebDataset shards of up to {per_shard}.

| file of a sample | |
|---|---|
| `image.png` | the picture, (H, W, 3) uint8 RGB |
| `depth.png` | (H, W) uint16; depth in mm, positive into the sensor, is value x {step:g} {least:+g} |
| `figures.json` | `indentation_mm`, `force_n` and more, null where unknown; `action`: what was done then |

x is right, y is down.{known}
"""
Encode = Callable[[NDArray[Any]], bytes]


def write_shards(
    frames: Iterable[TactileFrame], folder: Path, *, task: str, png: Encode, per_shard: int = 1000,
    actions: Actions | None = None, **known: object,
) -> int:  # fmt: skip
    """Write frames into a new `folder`, all or nothing, and return their number.

    task: what was done, in words. png: encodes a picture (H, W, 3) or (H, W) uint16. actions: as `write_arrays`. known:
    what the card says of the data. Raises InputError where the folder exists, without frames, and for a depth beyond
    what a sample holds.
    """
    if folder.exists():
        raise InputError(f"{folder} exists: choose another folder, or remove it")
    samples = (
        _sample(number, frame, action, png) for number, (frame, action) in enumerate(with_actions(frames, actions))
    )
    with whole(folder) as draft:
        draft.mkdir(exist_ok=True)
        written = 0
        for shard in count():
            some = list(islice(samples, per_shard))
            if not some:
                break
            _write(draft / f"{shard:06}.tar", some)
            written += len(some)
        if not written:
            raise InputError("the recording has no frames")
        lines = "".join(f"\n{name.replace('_', ' ')}: {value}." for name, value in known.items())
        (draft / "README.md").write_text(
            CARD.format(task=task, frames=written, per_shard=per_shard, step=STEP_MM, least=LEAST_MM, known=lines)
        )
    return written


def _sample(number: int, frame: TactileFrame, action: Sequence[float] | None, png: Encode) -> dict[str, bytes]:
    values = np.round((frame.depth_mm - LEAST_MM) / STEP_MM)
    if not (values.min() >= 0 and values.max() <= np.iinfo(np.uint16).max):
        raise InputError(
            f"frame {number} has depths of {frame.depth_mm.min():.2f} to {frame.depth_mm.max():.2f} mm: shards hold "
            f"{LEAST_MM} to 5 mm; export to HDF5 or Zarr instead"
        )
    figures = figures_of(frame) | ({} if action is None else {"action": action})
    parts = {
        "image.png": png(frame.camera_frame.image),
        "depth.png": png(values.astype(np.uint16)),
        "figures.json": json.dumps(
            {name: _known(np.asarray(value).tolist()) for name, value in figures.items()}
        ).encode(),
    }
    return {f"{number:09}.{name}": content for name, content in parts.items()}


def _known(value: Any) -> Any:
    """Turn NaN, which JSON does not have, into null."""
    if isinstance(value, list):
        return [_known(one) for one in value]
    return None if value != value else value


def _write(path: Path, samples: Iterable[dict[str, bytes]]) -> None:
    """Write a shard; its bytes do not depend on when or by whom."""
    with tarfile.open(path, "x:") as tar:
        for name, content in (part for sample in samples for part in sample.items()):
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
