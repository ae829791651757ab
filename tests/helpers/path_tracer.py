"""The pressed gel behind its window, drawn by Mitsuba (https://www.mitsuba-renderer.org), which shares nothing with us.

A height field under a flat face of index 1.41, a disc that shines straight down beside it, and a pinhole above. The
disc is wide: a path tracer finds a lamp behind a smooth face by chance alone.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from sim_reference.deformation import Deformation
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import GRID_EXTENT_MM, shape_at

mi.set_variant("scalar_rgb")
Array = NDArray[np.float64]
INDEX = 1.41
VERTICES = 1281
"""along a side of the height field"""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    geometry: SensorGeometry
    pressed: Deformation
    place_mm: tuple[float, float]
    lamp_mm: tuple[float, float, float]
    """middle of the disc"""
    lamp_radius_mm: float
    tan_pixel: float
    """by which the tangent of the angle in air grows from pixel to pixel"""
    albedo: float
    """of the coating; where it is small, light that is scattered twice does not count"""
    most_segments: int = -1
    """of a path of light; -1: all"""

    def scene(self) -> Any:
        camera, (height, width) = self.geometry.camera_height_mm, self.geometry.image_shape
        at, grey = mi.ScalarTransform4f, {"type": "rgb", "value": self.albedo}
        lamp = at().translate(list(self.lamp_mm)).rotate([1, 0, 0], 180).scale(self.lamp_radius_mm)
        face = at().translate([0, 0, self.geometry.window_mm]).scale(GRID_EXTENT_MM / 2)
        return mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": self.most_segments, "rr_depth": 50},
                "gel": self._gel({"type": "twosided", "nested": {"type": "diffuse", "reflectance": grey}}),
                "face": {"type": "rectangle", "to_world": face, "bsdf": {"type": "dielectric", "int_ior": INDEX}},
                "lamp": {
                    "type": "disk",
                    "to_world": lamp,
                    "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
                    "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
                },
                "sensor": {
                    "type": "perspective",
                    "to_world": at().look_at(origin=[0, 0, camera], target=[0, 0, 0], up=[0, -1, 0]),
                    "fov_axis": "x",
                    "fov": float(2 * np.degrees(np.arctan(width * self.tan_pixel / 2))),
                    "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
                },
            }
        )

    def _gel(self, coating: dict[str, Any]) -> Any:
        at = np.linspace(-GRID_EXTENT_MM / 2, GRID_EXTENT_MM / 2, VERTICES)
        x, y = np.meshgrid(at, at)
        z, across, down = shape_at(self.pressed, x, y, *self.place_mm)
        a = (np.arange(VERTICES - 1)[:, None] * VERTICES + np.arange(VERTICES - 1)).ravel()
        b, c, d = a + 1, a + VERTICES, a + VERTICES + 1
        faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(coating)
        mesh = mi.Mesh("gel", x.size, len(faces), has_vertex_normals=True, props=properties)
        values, normal = mi.traverse(mesh), np.stack([-across, -down, np.ones_like(z)], axis=2)
        values["vertex_positions"] = np.stack([x, y, z], axis=2).ravel().astype(np.float32)
        values["vertex_normals"] = (normal / np.linalg.norm(normal, axis=2, keepdims=True)).ravel().astype(np.float32)
        values["faces"] = faces.ravel().astype(np.uint32)
        values.update()
        return mesh

    def picture(self, samples: int, seed: int = 0) -> Array:
        """Return the (H, W) radiance of its pixels: the mean of so many paths each."""
        # Our axes are left-handed, those of Mitsuba right-handed: its pictures are mirrored.
        return np.asarray(mi.render(self.scene(), spp=samples, seed=seed), np.float64)[:, ::-1, 0]

    def tangents(self, shares: int = 1) -> tuple[Array, Array]:
        """Return the tangents along x and y of rays in air, (H, W) each, or those of `shares` x `shares` a pixel."""
        height, width = self.geometry.image_shape
        across, down = (((np.arange(n * shares) + 0.5) / shares - n / 2) * self.tan_pixel for n in (width, height))
        x, y = np.broadcast_arrays(across[None, :], down[:, None])
        return x, y

    def seen(self) -> Array:
        """Return the (H, W, 3) points of the gel that the middles of the pixels see."""
        scene, origin = self.scene(), mi.Point3f(0, 0, self.geometry.camera_height_mm)
        tangents = np.stack(self.tangents(), axis=2)
        rays = (mi.Ray3f(origin, dr.normalize(mi.Vector3f(*aim, -1))) for aim in tangents.reshape(-1, 2).tolist())
        return np.array([_met(scene, ray) for ray in rays]).reshape(*tangents.shape[:2], 3)


def _met(scene: Any, ray: Any) -> list[float]:
    face = scene.ray_intersect(ray)
    _, cosine, _, into = mi.fresnel(mi.Frame3f.cos_theta(face.wi), INDEX)
    return list(scene.ray_intersect(face.spawn_ray(face.to_world(mi.refract(face.wi, cosine, into)))).p)
