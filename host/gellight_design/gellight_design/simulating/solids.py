"""A closed triangle mesh (STL) as a height map: a rigid body pressed along z meets the gel with its upper side alone.

In the file z points towards the gel and y up, as printed; rows of the height map run the other way, so y changes sign.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.lab.simulator.bodies import highest

Array = NDArray[np.float64]
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
HEADER = 84
SMALLEST_MM, LARGEST_MM = 0.5, 60.0
"""across: what can be an object in mm"""


def read_stl(content: bytes) -> Array:
    """Return the triangles (T, 3, 3) of an STL file, binary or text.

    Raises ValueError for what is no STL, is not closed, or cannot be in mm.
    """
    triangles = _triangles(content)
    _check_closed(triangles)
    across = float(np.ptp(triangles.reshape(-1, 3), axis=0)[:2].max())
    if not SMALLEST_MM <= across <= LARGEST_MM:
        raise ValueError(
            f"it is {across:g} across, and an STL has no unit: scale it to mm, {SMALLEST_MM:g} to {LARGEST_MM:g} "
            "across (metres times 1000, inches times 25.4)"
        )
    if not np.ptp(triangles[..., 2]) > 0:
        raise ValueError(f"it is flat: all of it is at z = {triangles[0, 0, 2]:g}; give a body with a height")
    return triangles


def _triangles(content: bytes) -> Array:
    corners = _binary_corners(content) if _is_binary(content) else _text_corners(content)
    if not len(corners):
        raise ValueError("it holds no triangles: give a whole STL file, binary or text")
    unknown = np.argwhere(~np.isfinite(corners).all(axis=2))
    if len(unknown):
        triangle, corner = unknown[0].tolist()
        place = ", ".join(f"{value:g}" for value in corners[triangle, corner].tolist())
        raise ValueError(f"corner {corner + 1} of triangle {triangle + 1} is at ({place}): give finite numbers in mm")
    return corners


def _is_binary(content: bytes) -> bool:
    # Some programs begin binary files with "solid" too.
    return len(content) >= HEADER and not (content.startswith(b"solid") and b"facet" in content)


def _binary_size(content: bytes) -> int:
    """Return how long a binary file is, in bytes, by the number of triangles that its header says."""
    return HEADER + int.from_bytes(content[80:HEADER], "little") * RECORD.itemsize


def _binary_corners(content: bytes) -> Array:
    if _binary_size(content) != len(content):
        raise ValueError(
            f"it has {len(content)} bytes, and by its header's number of triangles {_binary_size(content)}: it is cut "
            "off, or no STL; give a whole STL file, binary or text"
        )
    with np.errstate(invalid="ignore"):  # what is no number is refused by its place
        return np.asarray(np.frombuffer(content, RECORD, offset=HEADER)["corners"], np.float64)


def _text_corners(content: bytes) -> Array:
    words = content.decode("ascii", "replace").split()
    numbers = [words[at + 1 : at + 4] for at, word in enumerate(words) if word == "vertex"]
    if len(numbers) % 3:
        raise ValueError(f"it has {len(numbers)} corners, which are no triangles: it is cut off; give a whole STL file")
    try:
        return np.array(numbers, np.float64).reshape(-1, 3, 3)
    except ValueError:
        raise ValueError("after a word 'vertex' are no three numbers: give a whole STL file, binary or text") from None


def _check_closed(triangles: Array) -> None:
    """Every edge has to belong to an even number of triangles; for a height it does not matter which way they turn."""
    _, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    corners = numbers.reshape(-1, 3)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    ends, uses = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    single = ends[uses % 2 == 1]
    if len(single):
        place = triangles.reshape(-1, 3)[np.flatnonzero(numbers.ravel() == single[0, 0])[0]]
        raise ValueError(
            f"it is not closed: {len(single)} edges belong to one triangle alone, the first at "
            f"({place[0]:g}, {place[1]:g}, {place[2]:g}); repair it, for a body has an inside"
        )


def height_map(triangles: Array, size: int, spacing_mm: float) -> Array:
    """Return the height (size, size) in mm of a body in the middle: 0 at its highest point, NO_OBJECT beside it.

    Each point of the grid has the highest triangle above it.
    """
    low, high = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    return highest((triangles - [*((low + high) / 2)[:2], high[2]]) * [1, -1, 1], size, spacing_mm)
