"""A depth map as points, and as a surface in the formats that every 3D program opens: PLY, and STL for printers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def points_of(
    depth_mm: NDArray[np.float32], pixel_size_mm: tuple[float, float], camera_height_mm: float = 0.0
) -> NDArray[np.float32]:
    """Return (H, W, 3) x, y, z of the gel surface, mm, from the image centre: x right, y up, z towards the camera.

    A camera so high above the gel sees what is d deep farther out by d / H of its distance; 0: far away.

    y points up, unlike that of images, so that the axes are right-handed: 3D programs would show a mirrored gel.
    """
    height, width = depth_mm.shape
    points = np.empty((height, width, 3), np.float32)
    points[..., 0] = (np.arange(width) - (width - 1) / 2) * pixel_size_mm[0]
    points[..., 1] = (((height - 1) / 2 - np.arange(height)) * pixel_size_mm[1])[:, None]
    points[..., 2] = depth_mm
    if camera_height_mm:
        points[..., :2] *= 1 - depth_mm[..., None] / np.float32(camera_height_mm)
    return points


def ply(
    depth_mm: NDArray[np.float32],
    pixel_size_mm: tuple[float, float],
    image: NDArray[np.uint8],
    camera_height_mm: float = 0.0,
) -> bytes:
    """Return a PLY file of the gel surface, mm, as triangles, coloured by the (H, W, 3) camera image.

    camera_height_mm: as in `points_of`. Pixels without depth are left out.
    """
    known = np.isfinite(depth_mm)
    vertices = np.empty(np.count_nonzero(known), VERTEX)
    vertices["xyz"], vertices["rgb"] = points_of(depth_mm, pixel_size_mm, camera_height_mm)[known], image[known]
    return ply_file(vertices, ["uchar red", "uchar green", "uchar blue"], _triangles(known))


def ply_file(vertices: NDArray[np.void], properties: list[str], triangles: NDArray[np.integer]) -> bytes:
    """Return a PLY file of vertices, which have x, y, z and other properties, and (T, 3) triangles."""
    faces = np.empty(len(triangles), FACE)
    faces["count"], faces["corners"] = 3, triangles
    named = "".join(f"property {one}\n" for one in ("float x", "float y", "float z", *properties))
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment mm, x right, y up, z towards the camera\n"
        f"element vertex {len(vertices)}\n{named}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode() + vertices.tobytes() + faces.tobytes()


def _triangles(known: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return two triangles for each four neighbours in (H, W) that are known, (T, 3) numbers of what is known.

    They are anticlockwise seen from the camera.
    """
    number = np.cumsum(known, dtype=np.int32).reshape(known.shape) - 1
    corners = slice(None, -1), slice(1, None)
    whole = np.logical_and.reduce([known[rows, columns] for rows in corners for columns in corners])
    a, b, c, d = (number[rows, columns][whole] for rows in corners for columns in corners)
    return np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])


def solid_stl(height_mm: NDArray[np.floating], pixel_mm: float, floor_mm: float) -> bytes:
    """Return a closed solid in binary STL: what is known of a height map (H, W) on a foot that stands at `floor_mm`.

    x is right, y up, z the height, from the middle of the map.
    """
    known = np.isfinite(height_mm)
    top = points_of(np.asarray(height_mm, np.float32), (pixel_mm, pixel_mm))[known]
    faces = _triangles(known)
    corners = np.concatenate([top, np.column_stack([top[:, :2], np.full(len(top), floor_mm, np.float32)])])
    below = len(top)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    a, b = edges[~np.isin(edges @ [below, 1], edges @ [1, below])].T
    walls = [np.stack([b, a, a + below], axis=1), np.stack([b, a + below, b + below], axis=1)]
    return mesh_stl(corners, np.concatenate([faces, faces[:, ::-1] + below, *walls]))


def mesh_stl(points_mm: NDArray[np.floating], triangles: NDArray[np.integer]) -> bytes:
    """Return a binary STL file of (T, 3) triangles between points (V, 3), mm."""
    placed = points_mm[triangles]
    across = np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0])
    records = np.zeros(len(placed), STL_RECORD)
    records["corners"] = placed
    records["normal"] = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return b"GelLight, mm".ljust(80) + np.uint32(len(placed)).tobytes() + records.tobytes()


def normals(gradient_map: NDArray[np.floating]) -> NDArray[np.float32]:
    """Turn a (H, W, 2) gradient map into (H, W, 3) float32 unit normals (-gx, -gy, 1) / norm, towards the camera.

    Raises ValueError for another shape.
    """
    if gradient_map.ndim != 3 or gradient_map.shape[2] != 2:
        raise ValueError(f"gradient map has shape {gradient_map.shape}: give (H, W, 2)")
    gx, gy = gradient_map[..., 0], gradient_map[..., 1]
    length = np.sqrt(gx * gx + gy * gy + np.float32(1))
    scale = np.reciprocal(length, out=length)
    result = np.empty((*gx.shape, 3), np.float32)
    np.multiply(gx, -scale, out=result[..., 0], casting="same_kind")
    np.multiply(gy, -scale, out=result[..., 1], casting="same_kind")
    result[..., 2] = scale
    return result
