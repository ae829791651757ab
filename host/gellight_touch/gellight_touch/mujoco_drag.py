"""Along a gel while objects that it *feels* move: where they take it with them, and where they slip."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from gellight_touch.mujoco_gap import MM
from gellight_touch.mujoco_gels import MujocoGel
from gellight_touch.touch_sensor import Felt
from gellight_touch.traction import Sheared, check_friction

Floats = NDArray[np.float64]


class Dragging:
    """Follows the objects from call to call; the gel remembers their path."""

    def __init__(self, gel: MujocoGel, *, friction: float = 0.8) -> None:
        """Take a gel; friction: Coulomb's coefficient. Raises InputError where it is negative or not finite."""
        check_friction(friction)
        self._gel, self._friction = gel, friction
        self._places: dict[int, Floats] = {}
        self._before: Sheared | None = None

    def follow(self, data: mujoco.MjData, felt: Felt) -> Sheared:
        """Return the traction now; felt: what `feel` returned for this data. Raises as `TouchSensor.go_on`.

        Each object's surface in the gel takes the gel along by what it moved since the last call; one that was not
        there then begins here. Call it as often as the object moves by a tenth of its contact.
        """
        bodies, moved_mm = self._gel.gap.bodies(), np.zeros((*felt.depth_mm.shape, 2))
        x, y = np.meshgrid(felt.at_mm, felt.at_mm)
        points = np.stack([x, y, -felt.depth_mm.astype(np.float64)], axis=-1)
        places = {int(body): self._place(data, int(body)) for body in np.unique(bodies[felt.contact & (bodies >= 0)])}
        for body in places.keys() & self._places.keys():
            motion = places[body] @ np.linalg.inv(self._places[body])
            carried = points @ motion[:3, :3].T + motion[:3, 3] - points
            moved_mm[bodies == body] = carried[bodies == body, :2]
        self._places = places
        self._before = self._gel.sensor.go_on(felt, moved_mm, friction=self._friction, before=self._before)
        return self._before

    def _place(self, data: mujoco.MjData, body: int) -> Floats:
        """(4, 4): a body in the gel's frame, mm."""
        axes, place = self._gel.gap.rotation(data), np.eye(4)
        place[:3, :3] = axes.T @ data.xmat[body].reshape(3, 3)
        place[:3, 3] = axes.T @ (data.xpos[body] - data.site_xpos[self._gel.gap.site]) / MM
        return place
