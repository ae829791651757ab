"""The gap between a gel and the geoms that may touch it, in a MuJoCo model.

A site of the model is the gel: its origin is the middle of the surface at rest, its z axis points out of the gel
towards what touches it, x is to the right in the picture and y down. Rays along z begin far behind the gel, so that an
object that lies deep in the gel is still seen from the gel's side. Other bodies there would hide it, so the rays see
the listed geoms alone.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from gellight.base.errors import InputError
from gellight_touch.layer import NOTHING

Floats = NDArray[np.float64]
BEHIND_M = 100.0
"""where the rays begin: within a view of 40 mm they are parallel to 2e-4 rad, 1 um at the bottom of a gel"""
OURS = 5
"""group of geoms that the listed ones are put into while rays are traced"""
MM = 1e-3


class GelGap:
    """The gap of one gel; it keeps working memory, so it serves one thread."""

    def __init__(self, model: mujoco.MjModel, site: str, geoms: list[int], at_mm: Floats) -> None:
        """Take the points `at_mm` (n,) of the rows and columns of the grid, and the geoms that may touch.

        Raises InputError for a site that is not there, and a geom whose surface rays do not find as collisions do.
        """
        self.site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)
        if self.site < 0:
            raise InputError(f"the model has no site {site!r}: it has {_names(model, mujoco.mjtObj.mjOBJ_SITE)}")
        for geom in geoms:
            _check(model, geom)
        self._model, self._geoms = model, np.array(geoms)
        x, y = np.meshgrid(at_mm * MM, at_mm * MM)
        self._points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        self._shape = x.shape
        towards = self._points + np.array([0.0, 0.0, BEHIND_M])
        self._length = np.linalg.norm(towards, axis=1)
        self._towards = towards / self._length[:, None]
        self._geom = np.zeros(len(self._points), np.int32)
        self._distance = np.zeros(len(self._points))

    def bodies(self) -> NDArray[np.int32]:
        """(n, n): the body that the last `gap_mm` found at each point, 0 for the world; -1 where nothing is."""
        body = self._model.geom_bodyid[np.maximum(self._geom, 0)]
        return np.where(self._geom < 0, -1, body).astype(np.int32).reshape(self._shape)

    def rotation(self, data: mujoco.MjData) -> Floats:
        """(3, 3): the axes of the gel as columns, in the world."""
        return np.asarray(data.site_xmat[self.site]).reshape(3, 3)

    def gap_mm(self, data: mujoco.MjData) -> NDArray[np.float32]:
        """Return the gap (n, n), mm: negative where an object lies in the gel, `NOTHING` where none is before it.

        `data` holds the present places (after `mj_kinematics` or any step).
        """
        axes = self.rotation(data)
        origin = data.site_xpos[self.site] - BEHIND_M * axes[:, 2]
        rays = (self._towards @ axes.T).ravel()
        with self._only_ours():
            mujoco.mj_multiRay(
                self._model, data, origin, rays, _GROUP, True, -1, self._geom, self._distance, None, len(self._geom),
                mujoco.mjMAXVAL,
            )  # fmt: skip
        gap = np.where(self._distance < 0, NOTHING, (self._distance - self._length) / MM)
        return np.minimum(gap, NOTHING).astype(np.float32).reshape(self._shape)

    @contextmanager
    def _only_ours(self) -> Iterator[None]:
        """Let rays see the listed geoms alone, transparent ones too; the model is then as it was."""
        groups, opaque = self._model.geom_group.copy(), self._model.geom_rgba[self._geoms, 3].copy()
        self._model.geom_group[groups == OURS] = 0
        self._model.geom_group[self._geoms] = OURS
        self._model.geom_rgba[self._geoms, 3] = 1.0
        try:
            yield
        finally:
            self._model.geom_group[:] = groups
            self._model.geom_rgba[self._geoms, 3] = opaque


_GROUP = np.zeros(mujoco.mjNGROUP, np.uint8)
_GROUP[OURS] = 1


def geoms_of(model: mujoco.MjModel, names: list[str]) -> list[int]:
    """Return the geoms of these names, and those of bodies of these names and below; InputError for unknown ones."""
    found: list[int] = []
    for name in names:
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if geom >= 0:
            found.append(geom)
        elif body >= 0:
            found.extend(g for g in range(model.ngeom) if _is_below(model, int(model.geom_bodyid[g]), body))
        else:
            known = [*_names(model, mujoco.mjtObj.mjOBJ_GEOM), *_names(model, mujoco.mjtObj.mjOBJ_BODY)]
            raise InputError(f"the model has no geom or body {name!r}: it has {known}")
    return sorted(set(found))


def _is_below(model: mujoco.MjModel, body: int, above: int) -> bool:
    while body not in (0, above):
        body = int(model.body_parentid[body])
    return body == above


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj) -> list[str]:
    count = {mujoco.mjtObj.mjOBJ_SITE: model.nsite, mujoco.mjtObj.mjOBJ_GEOM: model.ngeom}.get(kind, model.nbody)
    return [name for index in range(count) if (name := mujoco.mj_id2name(model, kind, index))]


def _check(model: mujoco.MjModel, geom: int) -> None:
    """Refuse a mesh that collides as its hull but is seen as it is."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return
    mesh = int(model.geom_dataid[geom])
    share = _hull_share(model, mesh)
    if share < CONVEX:
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"number {geom}"
        raise InputError(
            f"geom {name}: its mesh fills {share:.0%} of its hull, and MuJoCo lets the hull collide where the gel "
            "would feel the hollow: put it together of convex parts, or give it as a height field"
        )


CONVEX = 0.98
"""share of its hull that a mesh fills at least"""


def _hull_share(model: mujoco.MjModel, mesh: int) -> float:
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    begin, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    corners = model.mesh_vert[first : first + count].astype(np.float64)[model.mesh_face[begin : begin + faces]]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    return float(abs(volume) / ConvexHull(corners.reshape(-1, 3)).volume)
