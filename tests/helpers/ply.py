"""Readers of PLY and STL files, written from the formats' descriptions, for what page and export write."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

TYPES = {"float": "<f4", "int": "<i4", "uchar": "u1"}


def read_ply(path: Path) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.int32], list[str]]:
    """Return the properties of the vertices by name, the (n, 3) triangles, and the comments."""
    content = path.read_bytes()
    header, _, rest = content.partition(b"end_header\n")
    lines = [line.split() for line in header.decode("ascii").splitlines()]
    assert lines[0] == ["ply"]
    assert lines[1] == ["format", "binary_little_endian", "1.0"]
    counts = {line[1]: int(line[2]) for line in lines if line[0] == "element"}
    properties = [(line[2], TYPES[line[1]]) for line in lines if line[0] == "property" and line[1] != "list"]
    assert ["property", "list", "uchar", "int", "vertex_indices"] in lines
    vertices = np.frombuffer(rest, np.dtype(properties), counts["vertex"])
    faces = np.frombuffer(rest, np.dtype([("count", "u1"), ("corners", "<i4", 3)]), counts["face"], vertices.nbytes)
    assert vertices.nbytes + faces.nbytes == len(rest), "nothing is left over"
    assert (faces["count"] == 3).all()
    comments = [" ".join(line[1:]) for line in lines if line[0] == "comment"]
    return {name: vertices[name] for name, _ in properties}, faces["corners"], comments


def read_stl(content: bytes) -> NDArray[np.float32]:
    """Return the (n, 3, 3) corners of the triangles of a binary STL; AssertionError where a normal is another's."""
    count = int.from_bytes(content[80:84], "little")
    read = np.frombuffer(content[84:], np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("bits", "<u2")]))
    assert len(read) == count
    corners = read["corners"]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", across, read["normal"]) >= 0).all()
    return corners


def open_edges(triangles: NDArray[np.integer]) -> int:
    """Count the edges of (n, 3) triangles that no other triangle has the other way round: 0 of a closed solid."""
    ways = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).tolist()
    there = {tuple(way) for way in ways}
    assert len(there) == len(ways), "two triangles lie the same way round on an edge"
    return sum((end, begin) not in there for begin, end in there)
