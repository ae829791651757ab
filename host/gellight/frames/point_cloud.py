"""A depth map as a cloud of points, in the PLY format that every 3D program opens."""

import numpy as np
from numpy.typing import NDArray

VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])


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
    """Return a PLY file of the gel surface, mm, coloured by the (H, W, 3) camera image."""
    vertices = np.empty(depth_mm.size, VERTEX)
    vertices["xyz"] = points_of(depth_mm, pixel_size_mm).reshape(-1, 3)
    vertices["rgb"] = image.reshape(-1, 3)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment mm, x right, y up; z is the indentation\n"
        f"element vertex {depth_mm.size}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    )
    return header.encode() + vertices.tobytes()
