"""The layer's forces in place of MuJoCo's contact: gels that hold, lift and let slip.

A body in a gel has six springs at the centre of pressure, in the gel's frame. Those along the normal and of the two
tilts come from the layer: its force a little deeper, and the spread of its pressure. Those of the two ways along the
gel and of the spin are a bristle that sticks until Coulomb's limit. Tangential over normal stiffness is
2 (1 - nu) / (2 - nu), as for a sphere on a half space (Mindlin, J. Appl. Mech. 16, 1949).

Explicit forces of such stiff springs throw light bodies out, and forces of where a body was give it energy. So they
are taken where the bodies would be at the end of the step without gels, with velocities v0, and solved for, all gels
together:

    f = f0 + dt K J v0 - (dt + tau) K J v',   v' = v0 + dt M^-1 J' f

with the layer's force f0 there, and tau the gel's loss time. Where MuJoCo's own contacts act too (a table under what a
gel presses), they answer the gels' forces within the step: M then is M + Jc' D Jc with the rows Jc that act and their
stiffness D, as MuJoCo's solver has them (Todorov, ICRA 2014), v0 is with them, and both are found anew until the gels
give what was solved for.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight_touch.mujoco_gap import MM
from gellight_touch.mujoco_gels import MujocoGel, MujocoGels
from gellight_touch.springs import SLIDING, Spring, solve
from gellight_touch.touch_sensor import Felt
from gellight_touch.traction import Sheared

Floats = NDArray[np.float64]
MOST_LOOKS, AS_EXPECTED = 20, 1e-9
"""at MuJoCo's contacts, until no velocity is off by more, m/s and rad/s"""
HALVED = (1, 1 / 2, 1 / 4, 1 / 8, 1 / 16)
"""shares of a step of Newton's that are tried"""
DEEPER_MM = 0.05
"""over which the stiffness is found; over less the layer's tolerance shows"""


@dataclass(frozen=True, eq=False)
class Held:
    """What one gel does to one body in a step."""

    gel: str
    body: int
    force_n: Floats
    """(3,) on the body, in the gel's frame: along x, along y, out of the gel"""
    torque_nmm: Floats
    """(3,) on the body about `point_m`, in the gel's frame"""
    layer_force_n: float
    """of the layer as the body lies in it, or would without it"""
    sticks: bool
    point_m: Floats
    """(3,) where the force acts, in the world"""


class Carrying:
    """Steps a model whose gels carry what touches them."""

    def __init__(
        self, gels: MujocoGels, *, friction: float = 0.8, loss_time_s: float = 2e-3, sliding_ratio: float | None = None
    ) -> None:
        """Take the gels; friction: Coulomb's coefficient. sliding_ratio: tangential over normal stiffness.

        Raises InputError for an integrator that cannot be stepped in two halves, where MuJoCo's own contact acts
        between a gel and what it carries, and for figures that are negative or not finite.
        """
        figures = {"friction": friction, "loss_time_s": loss_time_s, "sliding_ratio": sliding_ratio or 0.0}
        for figure, value in figures.items():
            if not 0 <= value < np.inf:
                raise InputError(f"{figure} {value:g}: give 0 or more")
        model = gels.model
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            raise InputError('gels cannot carry under integrator="RK4": use "implicitfast"')
        for name, gel in gels.items():
            _check_excluded(model, name, gel)
        self.gels, self._model, self._friction, self._loss_time_s = gels, model, friction, loss_time_s
        self._sliding_ratio = sliding_ratio
        self._bristles: dict[tuple[str, int], Floats] = {}
        """by gel and body: how far the body has moved since it stuck, x and y in m, spin in rad"""
        self._before_s = -np.inf
        """when the last step began"""

    def step(self, data: mujoco.MjData) -> list[Held]:
        """Step the model with the gels' forces, and return them; raises as `TouchSensor.feel`.

        Nothing sticks yet in data whose time has gone back, as of `mj_resetData`.
        """
        if data.time <= self._before_s:
            self._bristles = {}
        self._before_s = data.time
        mujoco.mj_step1(self._model, data)
        others = data.xfrc_applied.copy()
        held = self._apply(data)
        mujoco.mj_step2(self._model, data)
        data.xfrc_applied[:] = others
        return held

    def shear(self, data: mujoco.MjData, gel: str, felt: Felt, held: list[Held]) -> Sheared:
        """Return the traction along a gel that carries what it `held` in the last step; raises as `TouchSensor.pull`.

        felt: of the gel's `feel`.
        """
        one = self.gels[gel]
        load, axes, origin = np.zeros(3), one.gap.rotation(data), data.site_xpos[one.gap.site]
        for force in (part for part in held if part.gel == gel):
            x, y = (axes.T @ (force.point_m - origin))[:2] / MM
            along_x, along_y, _ = -force.force_n
            load += along_x, along_y, x * along_y - y * along_x - force.torque_nmm[2]
        return one.sensor.pull(felt, (load[0], load[1]), load[2], friction=self._friction)

    def _apply(self, data: mujoco.MjData) -> list[Held]:
        mujoco.mj_fwdActuation(self._model, data)
        free = self._ahead(data)
        springs = [spring for name, gel in self.gels.items() for spring in self._springs(name, gel, data, free)]
        there = {(spring.gel, spring.body) for spring in springs}
        self._bristles = {key: bristle for key, bristle in self._bristles.items() if key in there}
        if not springs:
            return []
        forces = (self._answered if data.nefc else self._alone)(data, springs, free)
        _push(data, springs, forces)
        return [self._held(spring, force) for spring, force in zip(springs, forces, strict=True)]

    def _ahead(self, data: mujoco.MjData) -> Floats:
        """Return the velocities at the end of the step, with MuJoCo's contacts and the forces that are applied now."""
        mujoco.mj_fwdAcceleration(self._model, data)
        if data.nefc:
            mujoco.mj_fwdConstraint(self._model, data)
        return np.asarray(data.qvel + self._model.opt.timestep * (data.qacc if data.nefc else data.qacc_smooth))

    def _alone(self, data: mujoco.MjData, springs: list[Spring], free: Floats) -> Floats:
        """Return the forces (n, 6) of the gels where nothing else touches."""
        jacobian = np.vstack([spring.jacobian for spring in springs])
        return self._solve(springs, jacobian, self._by_inertia(data, jacobian), free)

    def _answered(self, data: mujoco.MjData, springs: list[Spring], free: Floats) -> Floats:
        """Return the forces (n, 6) of the gels, which MuJoCo's contacts answer.

        Newton's method. Contacts come and go with the forces, so a step is halved until it brings the forces nearer to
        what the gels give at the velocities that come of them.
        """
        others, dt = data.xfrc_applied.copy(), self._model.opt.timestep
        jacobian = np.vstack([spring.jacobian for spring in springs])
        unmet = dt * self._by_inertia(data, jacobian)

        def off(forces: Floats) -> tuple[float, Floats]:
            """Return how far forces are off, as a velocity, and the velocities that come of them."""
            data.xfrc_applied[:] = others
            _push(data, springs, forces)
            came = self._ahead(data)
            given = self._solve(springs, jacobian, np.zeros_like(jacobian), came)
            return float(np.abs((given - forces).ravel() @ unmet).max()), came

        forces, came, left = np.zeros((len(springs), 6)), free, np.inf
        for _ in range(MOST_LOOKS):
            moved = self._moved(data, jacobian)
            wanted = self._solve(springs, jacobian, moved, came - dt * forces.ravel() @ moved)
            for share in HALVED:
                tried = forces + share * (wanted - forces)
                found, met = off(tried)
                if found < left:
                    break
            forces, came, left = tried, met, found
            if left <= AS_EXPECTED:
                break
        data.xfrc_applied[:] = others
        return forces

    def _solve(self, springs: list[Spring], jacobian: Floats, moved: Floats, free: Floats) -> Floats:
        return solve(springs, jacobian, moved, free, self._model.opt.timestep, self._loss_time_s)

    def _moved(self, data: mujoco.MjData, jacobian: Floats) -> Floats:
        """Return the accelerations (n, nv) by a unit of each force, with the contacts of MuJoCo's that act now."""
        moved, rows = self._by_inertia(data, jacobian), _acting(self._model, data)
        answer = self._by_inertia(data, rows)  # the identity of Woodbury, for the inertia's inverse alone is at hand
        return moved - moved @ rows.T @ np.linalg.solve(np.eye(len(rows)) + rows @ answer.T, answer)

    def _by_inertia(self, data: mujoco.MjData, forces: Floats) -> Floats:
        moved = np.zeros_like(forces)
        mujoco.mj_solveM(self._model, data, moved, forces)
        return moved

    def _springs(self, name: str, gel: MujocoGel, data: mujoco.MjData, free: Floats) -> list[Spring]:
        now, layer, bodies = gel.gap.gap_mm(data), gel.sensor.layer, gel.gap.bodies()
        layer.check(now)
        gap = np.maximum(now + self._moved_mm(gel, data, bodies, free), DEEPER_MM - layer.deepest_mm).astype(np.float32)
        if gap.min() >= 0:
            return []
        pressure, deeper = layer.pressure_mpa(gap), layer.pressure_mpa(gap - np.float32(DEEPER_MM))
        found = np.unique(bodies[pressure > 0])
        return [self._spring(name, gel, data, free, int(body), np.where(bodies == body, pressure, 0),
                             float(deeper[bodies == body].sum(dtype=np.float64)))
                for body in found]  # fmt: skip

    def _moved_mm(
        self, gel: MujocoGel, data: mujoco.MjData, bodies: NDArray[np.int32], free: Floats
    ) -> NDArray[np.float64]:
        """(n, n) by how much the gap grows in a step if bodies and gel move on with velocities `free`."""
        at_mm, axes, grows = gel.sensor.layer.at_mm, gel.gap.rotation(data), np.zeros(bodies.shape)
        origin = data.site_xpos[gel.gap.site]
        for body in np.unique(bodies[bodies >= 0]):
            motion = self._relative(data, axes, origin, int(body), gel.body) @ free
            speed_mm = motion[2] / MM + motion[3] * at_mm[:, None] - motion[4] * at_mm[None, :]
            grows += np.where(bodies == body, self._model.opt.timestep * speed_mm, 0)
        return grows

    def _spring(
        self, name: str, gel: MujocoGel, data: mujoco.MjData, free: Floats, body: int,
        pressure: NDArray[np.float32], deeper: float,
    ) -> Spring:  # fmt: skip
        layer = gel.sensor.layer
        at, cell = layer.at_mm * MM, layer.spacing_mm * MM
        force = layer.force_n(pressure)
        total = float(pressure.sum(dtype=np.float64))
        x, y = pressure.sum(axis=0) @ at / total, pressure.sum(axis=1) @ at / total
        rows, columns = np.nonzero(pressure)
        from_x, from_y = at[columns] - x, at[rows] - y
        axes = gel.gap.rotation(data)
        point = data.site_xpos[gel.gap.site] + axes @ [x, y, 0.0]
        normal = max((deeper * layer.spacing_mm**2 - force) / (DEEPER_MM * MM), 0.0)
        along = self._ratio(gel) * normal
        tilts = normal * (np.array([np.mean(from_y**2), np.mean(from_x**2)]) + cell**2 / 12)
        stiffness = np.array([along, along, normal, *tilts, self._ratio(gel) * tilts.sum()])
        jacobian = self._relative(data, axes, point, body, gel.body)
        bristle = self._bristles.setdefault((name, body), np.zeros(3))
        bristle += self._model.opt.timestep * (jacobian @ data.qvel)[SLIDING]
        at_rest = self._model.opt.timestep * stiffness * (jacobian @ free)
        at_rest[2] += force
        at_rest[SLIDING] = -stiffness[SLIDING] * bristle
        reach = np.array([np.abs(from_y).max(), np.abs(from_x).max()]) + cell / 2
        far = np.hypot(np.hypot(from_x, from_y), cell / 3)  # a single cell has a lever too
        lever = float(pressure[rows, columns] @ far) / total
        return Spring(name, body, gel.body, axes, point, jacobian, stiffness, at_rest, self._friction, reach, lever)

    def _ratio(self, gel: MujocoGel) -> float:
        """Return tangential over normal stiffness."""
        poisson = gel.sensor.geometry.poisson_ratio
        return 2 * (1 - poisson) / (2 - poisson) if self._sliding_ratio is None else self._sliding_ratio

    def _relative(self, data: mujoco.MjData, axes: Floats, point: Floats, body: int, holder: int) -> Floats:
        """Return the Jacobian (6, nv) of body against gel at a point, in the gel's frame: translation, rotation."""
        parts = []
        for one in (body, holder):
            move, turn = np.zeros((3, self._model.nv)), np.zeros((3, self._model.nv))
            mujoco.mj_jac(self._model, data, move, turn, point, one)
            parts.append(np.vstack([axes.T @ move, axes.T @ turn]))
        return np.asarray(parts[0] - parts[1])

    def _held(self, spring: Spring, force: Floats) -> Held:
        """Let the bristle slip as far as friction does not hold it, and tell what the gel does."""
        spring.slip(self._bristles[spring.gel, spring.body], force)
        pressed_n, sticks = float(spring.at_rest[2]), spring.sticks(force)
        return Held(spring.gel, spring.body, force[:3].copy(), force[3:] / MM, pressed_n, sticks, spring.point)


def _push(data: mujoco.MjData, springs: list[Spring], forces: Floats) -> None:
    """Give forces (n, 6) to the bodies and to the gels'."""
    for spring, force in zip(springs, forces, strict=True):
        push, turn = spring.axes @ force[:3], spring.axes @ force[3:]
        for body, sign in ((spring.body, 1), (spring.holder, -1)):
            data.xfrc_applied[body, :3] += sign * push
            data.xfrc_applied[body, 3:] += sign * (np.cross(spring.point - data.xipos[body], push) + turn)


def _acting(model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
    """Return the rows (k, nv) of MuJoCo's constraints that act, each times the root of its stiffness.

    A contact that slides in an elliptic cone is as stiff as ever along its normal, and not at all along its surface.
    """
    count, rows = data.nefc, np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        rows[:] = data.efc_J.reshape(count, model.nv)
    states = data.efc_state[:count]
    acts = states == mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC
    normals = [contact.efc_address for contact in data.contact if contact.efc_address >= 0]
    acts[normals] |= states[normals] == mujoco.mjtConstraintState.mjCNSTRSTATE_CONE
    return np.asarray(rows[acts] * np.sqrt(data.efc_D[:count][acts])[:, None])


def _check_excluded(model: mujoco.MjModel, name: str, gel: MujocoGel) -> None:
    excluded = [{int(pair) >> 16, int(pair) & 0xFFFF} for pair in model.exclude_signature]
    paired = [set(pair) for pair in zip(model.pair_geom1, model.pair_geom2, strict=True)]
    own = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == gel.body]
    for geom in gel.geoms:
        pair = gel.body, int(model.geom_bodyid[geom])
        first, second = (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, one) for one in pair)
        if any({geom, mine} in paired for mine in own):
            raise InputError(
                f"gel {name} is to carry body {second}, but a <pair> of the model's <contact> does so too: take it out"
            )
        if set(pair) not in excluded and any(_collide(model, geom, mine) for mine in own):
            raise InputError(
                f"gel {name} is to carry body {second}, but MuJoCo's contact does so too: add "
                f'<contact><exclude body1="{first}" body2="{second}"/></contact> to the model'
            )


def _collide(model: mujoco.MjModel, one: int, other: int) -> bool:
    kinds, affinities = model.geom_contype, model.geom_conaffinity
    return bool(kinds[one] & affinities[other] or kinds[other] & affinities[one])
