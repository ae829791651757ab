"""A depth map as points, and as a surface in the PLY format that every 3D program opens."""

import numpy as np
from numpy.typing import NDArray

VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def points_of(depth_mm: NDArray[np.float32], pixel_size_mm: tuple[float, float]) -> NDArray[np.float32]:
    """Return (H, W, 3) x, y, z of the gel surface, mm, from the image centre: x right, y up, z towards the camera.

    y points up, unlike that of images, so that the axes are right-handed: 3D programs would show a mirrored gel.
    """
    height, width = depth_mm.shape
    points = np.empty((height, width, 3), np.float32)
    points[..., 0] = (np.arange(width) - (width - 1) / 2) * pixel_size_mm[0]
    points[..., 1] = (((height - 1) / 2 - np.arange(height)) * pixel_size_mm[1])[:, None]
    points[..., 2] = depth_mm
    return points


def ply(depth_mm: NDArray[np.float32], pixel_size_mm: tuple[float, float], image: NDArray[np.uint8]) -> bytes:
    """Return a PLY file of the gel surface, mm, as triangles, coloured by the (H, W, 3) camera image.

    Pixels without depth are left out.
    """
    known = np.isfinite(depth_mm)
    vertices = np.empty(np.count_nonzero(known), VERTEX)
    vertices["xyz"], vertices["rgb"] = points_of(depth_mm, pixel_size_mm)[known], image[known]
    faces = _triangles(known)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment mm, x right, y up; z is the indentation\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode() + vertices.tobytes() + faces.tobytes()


def _triangles(known: NDArray[np.bool_]) -> NDArray[np.void]:
    """Return two triangles for each four neighbours in (H, W) that are known, anticlockwise seen from the camera."""
    number = np.cumsum(known, dtype=np.int32).reshape(known.shape) - 1
    corners = [slice(None, -1), slice(1, None)]
    whole = np.logical_and.reduce([known[rows, columns] for rows in corners for columns in corners])
    a, b, c, d = (number[rows, columns][whole] for rows in corners for columns in corners)
    faces = np.empty(2 * len(a), FACE)
    faces["count"], faces["corners"] = 3, np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return faces
