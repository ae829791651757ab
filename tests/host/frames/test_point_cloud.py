"""The surface as a mesh: a bump known in closed form, with a hole where nothing has a depth."""

from pathlib import Path

import numpy as np

from gellight.frames.point_cloud import ply
from tests.helpers.ply import read_ply


def test_the_surface_is_triangles_that_face_the_camera(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(40.0) - 19.5, np.arange(30.0) - 14.5)
    depth = np.exp(-((x - 5) ** 2 + (y + 4) ** 2) / 50).astype(np.float32)
    depth[20:24, 3:9] = np.nan
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    (tmp_path / "gel.ply").write_bytes(ply(depth, (0.5, 0.25), image))
    vertices, triangles, _ = read_ply(tmp_path / "gel.ply")
    assert len(vertices["z"]) == 40 * 30 - 4 * 6
    assert len(triangles) == 2 * (39 * 29 - 5 * 7)
    assert np.array_equal(np.stack([vertices[name] for name in ("red", "green", "blue")], 1), image[~np.isnan(depth)])
    at = np.stack([vertices[name] for name in "xyz"], 1)
    exact = np.exp(-((at[:, 0] / 0.5 - 5) ** 2 + (at[:, 1] / 0.25 - 4) ** 2) / 50)
    assert np.abs(at[:, 2] - exact).max() < 1e-6, "y points up"
    corners = at[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert np.allclose(normals[:, 2], 0.125), "each is half a pixel"
