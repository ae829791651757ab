"""What the files of a bundle hold: a reference picture, tables of arrays; and how much memory a stranger's may take."""

import io
import stat
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError
from gellight.base.png import is_whole
from gellight.bundle.manifest import AGAIN, REFERENCE, plain_name

UNZIPPING = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, RuntimeError, MemoryError)
"""what zipfile and NumPy raise for a damaged archive, or one of a kind that they do not know"""
MOST_BYTES = 512 * 1024 * 1024
"""of a bundle, and of what a file of it unpacks to"""
_PNG_HEADER = 24
"""bytes: signature, length and name of the first chunk, width, height (ISO/IEC 15948, 5.2 and 11.2.2)"""


def read_file(path: Path) -> bytes:
    """Return the content of a file in the folder of a bundle; ValueError for a pipe, a device, or one far too large."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise ValueError("it is no regular file")
    if found.st_size > MOST_BYTES:
        raise ValueError(f"it has {found.st_size / 1e6:.0f} MB, allowed are {MOST_BYTES / 1e6:.0f}")
    return path.read_bytes()


def check_archive(archive: zipfile.ZipFile, source: str) -> None:
    """Raise BundleError for names that leave the bundle and for archives that would fill the memory."""
    for entry in archive.infolist():
        try:
            plain_name(entry.filename)
        except ValueError as error:
            raise BundleError(f"{source}: {error}; do not use this file, get it again from its source") from error
    total = sum(entry.file_size for entry in archive.infolist())
    if total > MOST_BYTES:
        raise BundleError(f"{source} unpacks to {total / 1e6:.0f} MB: no bundle is that large; get it again")


def arrays_of(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays of an .npz file by name; raises one of `UNZIPPING`, before the memory is full."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        total = sum(entry.file_size for entry in archive.infolist())
    if total > MOST_BYTES:
        raise ValueError(f"it unpacks to {total / 1e6:.0f} MB, allowed are {MOST_BYTES / 1e6:.0f}")
    with np.load(io.BytesIO(content), allow_pickle=False) as table:
        arrays = {name: table[name] for name in table.files}
    if others := [name for name, array in arrays.items() if not isinstance(array, np.ndarray)]:
        raise ValueError(f"{others[0]} is no array")
    return arrays


def npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return arrays as the content of an .npz file, packed at the quickest level: noise packs no better at another."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)
    return content.getvalue()


def encoded_reference(reference: NDArray[np.floating]) -> bytes:
    """Return `reference.png` of an (H, W, 3) RGB picture; BundleError for grey levels outside 0 to 255."""
    if reference.ndim != 3 or reference.shape[2] != 3:
        raise ValueError(f"reference image has shape {reference.shape}: give (H, W, 3)")
    if not (np.isfinite(reference).all() and reference.min() >= 0 and reference.max() <= 255):
        raise BundleError(
            "the reference image has NaN or values outside 0 to 255 grey levels: capture the reference again"
        )
    levels = np.round(reference.astype(np.float64) * 256).astype(np.uint16)
    return cv2.imencode(".png", levels[..., ::-1])[1].tobytes()


def decoded_reference(content: bytes, image_shape: tuple[int, int], source: str) -> NDArray[np.float32]:
    """Return the (H, W, 3) RGB picture of `reference.png`; BundleError where it is none of that size.

    The size is read before the picture is unpacked: a small file may be a picture of gigabytes.
    """
    head = content[:_PNG_HEADER]
    width, height = (int.from_bytes(head[at : at + 4]) for at in (16, 20))
    if head[1:4] == b"PNG" and (height, width) != image_shape:
        raise BundleError(
            f"{source}: {REFERENCE} is {width} x {height} px, the manifest says {image_shape[1]} x {image_shape[0]}: "
            f"{AGAIN}"
        )
    levels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if is_whole(content) else None
    if levels is None or levels.dtype != np.uint16 or levels.ndim != 3 or levels.shape[2] != 3:
        raise BundleError(f"{source}: {REFERENCE} is not a 16-bit RGB PNG: {AGAIN}")
    return np.ascontiguousarray(levels[..., ::-1], dtype=np.float32) / np.float32(256)
