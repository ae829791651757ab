"""The gels of a MuJoCo model: how they look while MuJoCo computes the contact, and what they would feel.

*look* moves the objects along the gel's normal until the layer carries the force that MuJoCo's contact has: how deep
MuJoCo lets bodies penetrate depends on their mass and its solver, and says nothing of a gel. *feel* takes the places as
they are, for objects that are moved by hand or that `mujoco_carry` holds.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import mujoco
import numpy as np

from gellight.base.errors import InputError
from gellight.lab.touch.mujoco_gap import GelGap, geoms_of
from gellight.lab.touch.touch_sensor import Felt, TouchSensor


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

    def contact_force_n(self, data: mujoco.MjData) -> float:
        """Return how hard MuJoCo's contacts press the objects against the body of the gel, along its normal, N."""
        normal, total, force = self.gap.rotation(data)[:, 2], 0.0, np.zeros(6)
        for index in range(data.ncon):
            pair = [int(geom) for geom in data.contact[index].geom]
            ours = [self._model.geom_bodyid[geom] == self.body for geom in pair]
            if not any(ours) or pair[ours.index(True) ^ 1] not in self.geoms:
                continue
            mujoco.mj_contactForce(self._model, data, index, force)
            on_second = data.contact[index].frame.reshape(3, 3).T @ force[:3]
            total += float(normal @ on_second) * (1 if ours[0] else -1)
        return max(total, 0.0)


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
