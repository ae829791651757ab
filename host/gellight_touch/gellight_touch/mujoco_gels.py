"""The gels of a MuJoCo model: how they look while MuJoCo computes the contact, and what they would feel.

*look* moves the objects along the gel's normal until the layer carries the force that MuJoCo's contact has: how deep
MuJoCo lets bodies penetrate depends on their mass and its solver, and says nothing of a gel. Nor does what rests on a
gel move along it in MuJoCo: *shear* moves it until the gel carries MuJoCo's friction. *feel* takes the places as they
are, for objects that are moved by hand or that `mujoco_carry` holds; `mujoco_drag` follows them along the gel.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_touch.mujoco_gap import MM, GelGap, geoms_of
from gellight_touch.touch_sensor import Felt, TouchSensor
from gellight_touch.traction import Sheared

OUTWARDS = 0.1
"""cosine between the normals of a contact and of the gel, at least"""


class MujocoGel:
    """One gel of a model."""

    def __init__(self, model: mujoco.MjModel, site: str, geoms: list[int], sensor: TouchSensor) -> None:
        """Take the geoms that may touch it; InputError for what is not in the model."""
        self.sensor = sensor
        self.gap = GelGap(model, site, geoms, sensor.layer.at_mm)
        self.body = int(model.site_bodyid[self.gap.site])
        self._model, self.geoms = model, frozenset(geoms)

    def feel(self, data: mujoco.MjData) -> Felt:
        """Return the gel under the objects where they are; raises as `TouchSensor.feel`."""
        return self.sensor.feel(self.gap.gap_mm(data))

    def look(self, data: mujoco.MjData) -> Felt:
        """Return the gel under the objects, as deep as carries MuJoCo's contact force; raises as `TouchSensor.sink`."""
        return self.sensor.sink(self.gap.gap_mm(data), self.contact_force_n(data))

    def shear(self, data: mujoco.MjData, felt: Felt, *, friction: float | None = None) -> Sheared:
        """Return the traction along the gel that carries MuJoCo's friction; felt: of `look`.

        friction: Coulomb's coefficient, default: the largest of MuJoCo's contacts. Raises as `TouchSensor.pull`.
        """
        x, y, _, torque_nmm = self._load(data)
        coefficients = [float(data.contact[index].friction[0]) for index, _ in self._contacts(data)]
        return self.sensor.pull(
            felt, (x, y), torque_nmm, friction=max(coefficients, default=0.0) if friction is None else friction
        )

    def contact_force_n(self, data: mujoco.MjData) -> float:
        """Return how hard MuJoCo's contacts press the objects against the body of the gel, along its normal, N."""
        return max(-float(self._load(data)[2]), 0.0)

    def _contacts(self, data: mujoco.MjData) -> Iterator[tuple[int, int]]:
        """Yield the contacts of objects with the gel's body, and 1 where that is the first of the two, else -1.

        A finger may be touched beside its gel and on its back too: those are left out.
        """
        axes, radius_m = self.gap.rotation(data), self.sensor.geometry.gel_diameter_mm / 2 * MM
        for index in range(data.ncon):
            contact = data.contact[index]
            pair = [int(geom) for geom in contact.geom]
            ours = [self._model.geom_bodyid[geom] == self.body for geom in pair]
            if not any(ours) or pair[ours.index(True) ^ 1] not in self.geoms:
                continue
            sign = 1 if ours[0] else -1
            x, y, _ = axes.T @ (contact.pos - data.site_xpos[self.gap.site])
            if np.hypot(x, y) <= radius_m and sign * contact.frame[:3] @ axes[:, 2] > OUTWARDS:
                yield index, sign

    def _load(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """(4,): MuJoCo's contact force on the gel along its axes, N, and the torque about its normal, N mm."""
        axes, load, force = self.gap.rotation(data), np.zeros(4), np.zeros(6)
        for index, sign in self._contacts(data):
            mujoco.mj_contactForce(self._model, data, index, force)
            contact = data.contact[index]
            pushed, turned = (-sign * axes.T @ contact.frame.reshape(3, 3).T @ part for part in (force[:3], force[3:]))
            arm = axes.T @ (contact.pos - data.site_xpos[self.gap.site])
            load += *pushed, (turned + np.cross(arm, pushed))[2] / MM
        return load


class MujocoGels(Mapping[str, MujocoGel]):
    """The gels of a model, by the names of their sites."""

    def __init__(
        self,
        model: mujoco.MjModel,
        sites: Sequence[str],
        *,
        touching: Sequence[str],
        sensor: Callable[[], TouchSensor] = TouchSensor,
    ) -> None:
        """Find the gels; touching: geoms, or bodies with all below, that may touch them. `sensor` makes one for each.

        Raises InputError for names that are not in the model or twice in the list, objects that belong to the gel's
        own body, and meshes that MuJoCo lets collide otherwise than they are.
        """
        self.model = model
        geoms = geoms_of(model, list(touching))
        if not geoms:
            raise InputError(f"touching={list(touching)} has no geom, so nothing would be felt: name what may touch")
        if len(set(sites)) < len(sites) or not sites:
            raise InputError(f"gels {list(sites)}: give each site once, and one at least")
        self._gels = {site: MujocoGel(model, site, geoms, sensor()) for site in sites}
        for site, gel in self._gels.items():
            if any(model.geom_bodyid[geom] == gel.body for geom in geoms):
                raise InputError(f"gel {site}: the body that holds it is among what may touch it: {list(touching)}")

    def __getitem__(self, site: str) -> MujocoGel:
        """Return the gel of a site."""
        return self._gels[site]

    def __iter__(self) -> Iterator[str]:
        """Go through the names of the sites."""
        return iter(self._gels)

    def __len__(self) -> int:
        """Count the gels."""
        return len(self._gels)
