"""Make housing.webp, the exploded picture of docs/build.md: the solids of `gellight optimize make housing`, cut open.

    .venv/bin/python docs/pictures/housing.py

Triangles are drawn into a depth buffer, looked at from the side and from above, each as bright as it faces the lamp.
"""

import io
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray

from gellight_design.housing.parts import assembly, stand_ins
from gellight_design.housing.solids import box, cut, stl_bytes
from sim_reference.geometry import SensorGeometry

LIFT = {
    "gel pad": -22, "acrylic": -11, "gel": 0, "ring": 16, "camera": 36, "lens": 52, "board": 52, "plug": 36, "lid": 76,
}  # fmt: skip
"""mm by which each part is lifted out of its place"""
COLOURS = {"gel pad": (170, 205, 235), "acrylic": (190, 220, 245), "lens": (60, 60, 60), "board": (70, 140, 90)}
PRINTED = (150, 150, 158)
SCALE, SIZE = 5.0, (640, 920)
"""pixels a mm; columns and rows"""
TURN, RISE = radians(-35), radians(22)


def triangles() -> dict[str, NDArray[np.float64]]:
    """Return the triangles of each part, (N, 3, 3), without the quarter in front."""
    geometry = SensorGeometry()
    parts: dict[str, Any] = {name: solid for name, solid in assembly(geometry).items() if name != "mould"}
    parts |= stand_ins(geometry)
    quarter = box((50, -50, 50), (100, 100, 300))
    found = {}
    for name, lift in LIFT.items():
        solid = parts[name] if name in ("plug", "lens", "board") else cut(parts[name], quarter)
        mesh = trimesh.load(io.BytesIO(stl_bytes(solid)), file_type="stl")
        found[name] = np.add(mesh.triangles, [0, 0, lift])
    return found


def looked_at(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns, rows and nearness of points, for an eye far away in front and above."""
    x = cos(TURN) * points[..., 0] - sin(TURN) * points[..., 1]
    far = sin(TURN) * points[..., 0] + cos(TURN) * points[..., 1]
    up = cos(RISE) * points[..., 2] + sin(RISE) * far
    near = sin(RISE) * points[..., 2] - cos(RISE) * far
    return np.stack([SIZE[0] * 0.44 + SCALE * x, SIZE[1] * 0.84 - SCALE * up, near], axis=-1)


def draw(picture: NDArray[np.uint8], depth: NDArray[np.float64], part: NDArray[np.float64], colour: Any) -> None:
    """Draw the triangles of a part where they are nearer than what is there."""
    normals = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    bright = 0.45 + 0.55 * np.clip(normals @ (np.array([0.35, -0.6, 0.72])), 0, 1)
    for corners, light in zip(looked_at(part), bright, strict=True):
        low = np.clip(np.floor(corners[:, :2].min(axis=0)).astype(int), 0, None)
        high = np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1
        columns, rows = np.meshgrid(np.arange(low[0], min(high[0], SIZE[0])), np.arange(low[1], min(high[1], SIZE[1])))
        (ax, ay, an), (bx, by, bn), (cx, cy, cn) = corners
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(twice) < 1e-9 or not columns.size:
            continue
        v = ((columns - ax) * (cy - ay) - (rows - ay) * (cx - ax)) / twice
        w = ((bx - ax) * (rows - ay) - (by - ay) * (columns - ax)) / twice
        near = an + v * (bn - an) + w * (cn - an)
        here = (v >= 0) & (w >= 0) & (v + w <= 1) & (near > depth[rows, columns])
        depth[rows[here], columns[here]] = near[here]
        picture[rows[here], columns[here]] = np.multiply(colour, light)


def main() -> None:
    """Write the picture beside this file."""
    picture, depth = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8), np.full((SIZE[1], SIZE[0]), -np.inf)
    parts = triangles()
    for name, part in parts.items():
        draw(picture, depth, part, COLOURS.get(name, PRINTED))
    for name, part in parts.items():
        row = int(looked_at(part).reshape(-1, 3)[:, 1].mean())
        row += {"lens": 14, "plug": -14, "camera": 60}.get(name, 0)
        cv2.putText(picture, name, (SIZE[0] - 108, row), cv2.FONT_HERSHEY_SIMPLEX, 0.62, (40, 40, 40), 1, cv2.LINE_AA)
    path = Path(__file__).with_suffix(".webp")
    cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 80])
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
