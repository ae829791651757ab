"""What touch in a robot simulator costs, and how true it is: `python -m tests.benchmarks.touch [PART ...]`.

speed: gap, layer and picture, ms of processor time, and how many a second on one core. truth: depth, force and picture
against the simulated sensor's own (512 points a side). lift: a gripper holds balls, boxes, cylinders; hold: over 10^5
steps. energy: bodies are thrown at a gel; by how much kinetic and potential energy grow from one flight to the next;
fresh: others are thrown. tasks: in what share of 50 episodes rules with touch and without do what the environments ask
for. tactile: depth and time beside MuJoCo's own
sensor. hold and fresh take an hour and more, and run only where they are named.
"""

import argparse
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import mujoco
import numpy as np
from scipy.interpolate import RectBivariateSpline

from gellight.lab.simulator.scene import Press, Scene
from gellight_touch import GRIPPER, Felt, TouchSensor
from gellight_touch.mujoco_carry import Carrying
from gellight_touch.mujoco_gels import MujocoGels
from sim_reference.camera import CameraResponse
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES, object_height
from tests.benchmarks import touch_tasks

DEPTH_MM = 0.9
STEP_S = 0.002
SHAPES = {"ball": 'type="sphere" size=".008"', "box": 'type="box" size=".008 .006 .006"',
          "cylinder": 'type="cylinder" size=".008 .006"'}  # fmt: skip


def sized(width: int) -> SensorGeometry:
    return SensorGeometry(image_width_px=width, image_height_px=width * 3 // 4, pixel_size_mm=0.0588 * 640 / width)


def least_ms(work: Callable[[], object], times: int = 9) -> float:
    """Return the least processor time of a call, ms."""
    taken = []
    for _ in range(times):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken) * 1e3


def sphere_mesh(rings: int = 96) -> str:
    """Return the corners of a ball of 4 mm, some 18,000 faces, as MuJoCo reads them; it makes the hull."""
    polar, turn = np.linspace(0, np.pi, rings)[:, None], np.linspace(0, 2 * np.pi, rings, endpoint=False)[None, :]
    corners = np.stack(np.broadcast_arrays(np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)))
    return " ".join(f"{value:.6f}" for value in (0.004 * corners).reshape(3, -1).T.ravel())


def speed() -> Iterator[str]:
    geoms = {"sphere": 'type="sphere" size=".004"', "box": 'type="box" size=".004 .004 .004"',
             "mesh": 'type="mesh" mesh="ball"'}  # fmt: skip
    for width in (320, 640):
        for name, geom in geoms.items():
            parts = parts_ms(width, geom)
            each = ", ".join(f"{ms:.1f}" for ms in parts)
            yield f"{width} px, {name:<7} gap, layer, picture {each} ms: {1e3 / sum(parts):.0f} a second"


def parts_ms(width: int, geom: str) -> list[float]:
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><asset><mesh name="ball" vertex="{sphere_mesh()}"/></asset><worldbody>
        <body name="finger"><geom type="box" size=".02 .02 .002" pos="0 0 -.002"/><site name="gel"/></body>
        <body name="object" pos=".001 0 {0.004 - DEPTH_MM / 1e3}"><freejoint/><geom {geom} mass=".01"/></body>
        </worldbody></mujoco>'''
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    gel = MujocoGels(model, ["gel"], touching=["object"], sensor=lambda: TouchSensor(sized(width)))["gel"]
    gap = gel.gap.gap_mm(data)
    felt = gel.sensor.feel(gap)
    gel.sensor.picture(felt)
    return [
        least_ms(lambda: gel.gap.gap_mm(data)),
        least_ms(lambda: gel.sensor.feel(gap)),
        least_ms(lambda: gel.sensor.picture(felt)),
    ]


def truth() -> Iterator[str]:
    geometry = sized(320)
    scene, touch, fine = Scene(geometry, CameraResponse()), TouchSensor(geometry), TouchSensor(geometry, size=512)
    for name in OBJECT_NAMES:
        shown, surface = scene.show(Press(name, DEPTH_MM))
        felt, felt_fine = pressed(touch, name), pressed(fine, name)
        depth_um = np.abs(touch.depth_map_mm(felt) - surface.depth_mm) * 1e3
        grey, grey_fine = np.abs(touch.grey(felt) - shown).mean(), np.abs(fine.grey(felt_fine) - shown).mean()
        yield (
            f"{name:<9} depth {depth_um.mean():5.1f} um (most {depth_um.max():4.0f}); "
            f"force {felt.force_n / felt_fine.force_n:.3f}; grey {grey:.2f}, on 512 points {grey_fine:.2f}"
        )


def pressed(touch: TouchSensor, name: str) -> Felt:
    at = touch.layer.at_mm
    return touch.feel(-(object_height(name, at[None, :], at[:, None]) + DEPTH_MM))


def lift(steps: int = 1500) -> Iterator[str]:
    for shape in SHAPES:
        for mass_kg in (0.002, 0.02, 0.1):
            log, taken_ms = lifted(shape, mass_kg, steps)
            end = log[-steps // 4 :]
            creep = (end[-1, 0] - end[0, 0]) / (len(end) * STEP_S)
            yield (
                f"{shape:<8} {mass_kg * 1e3:3.0f} g: force / weight {end[:, 1].mean() / mass_kg / 9.81:.5f}, "
                f"layer / grip {end[:, 3].mean() / end[:, 2].mean():.5f}, creep {creep:.2f} um/s, "
                f"kinetic {end[:, 4].max():.0e} J, {taken_ms:.1f} ms a step"
            )


def lifted(shape: str, mass_kg: float, steps: int) -> tuple[np.ndarray, float]:
    """Return the rows of `lifting`, (steps, 5), and how many ms a step takes."""
    begun_s = time.process_time()
    log = np.array(list(itertools.islice(lifting(shape, mass_kg), steps)))
    return log, (time.process_time() - begun_s) / steps * 1e3


def lifting(shape: str, mass_kg: float) -> Iterator[tuple[float, ...]]:
    """Yield height (um), force upwards, grip, layer's force (N) and kinetic energy (J) of each step, for ever."""
    text = GRIPPER.read_text()
    geom = f'{SHAPES[shape]} mass="{mass_kg}"'
    model = mujoco.MjModel.from_xml_string(text.replace('type="sphere" size=".008" mass=".02"', geom))
    data = mujoco.MjData(model)
    gels = MujocoGels(model, ["left", "right"], touching=["object"], sensor=lambda: TouchSensor(size=64, extent_mm=32))
    carry = Carrying(gels)
    for now_s in itertools.count(0.0, STEP_S):
        data.ctrl[:] = [np.clip((now_s - 0.8) * 0.05, 0, 0.05), *[2.0 * min(now_s / 0.5, 1)] * 2]
        held = carry.step(data)
        up_n = sum((gels[one.gel].gap.rotation(data) @ one.force_n)[2] for one in held)
        left = [(one.force_n[2], one.layer_force_n) for one in held if one.gel == "left"] or [(0, 0)]
        moving_j = mass_kg / 2 * float(np.sum(data.qvel[-6:-3] ** 2))
        yield data.body("object").xpos[2] * 1e6, up_n, *left[0], moving_j


def energy(seeds: Sequence[int] = range(2000)) -> Iterator[str]:
    grown = {seed: grows(seed) for seed in seeds}
    gained = {seed: growth for seed, growth in grown.items() if growth}
    again = [grows(seed, finer=2) or 0.0 for seed in gained]
    refused = sum(growth is None for growth in grown.values())
    yield (
        f"{len(seeds) - refused} bodies thrown: {len(gained)} gained energy between flights, at most "
        f"{max(gained.values(), default=0):.1e} of that at the start; thrown again in half the step "
        f"{np.count_nonzero(again)}, at most {max(again, default=0):.1e}; {refused} more went deeper than 60 % of the "
        "gel and were refused"
    )


def grows(seed: int, finer: int = 1) -> float | None:
    """Throw a body at a gel; return by what share its energy grew from one flight to a later one, None if refused.

    finer: by how much the step of the simulation is divided.
    """
    rng = np.random.default_rng(seed)
    kind, size = rng.choice(["box", "ellipsoid", "capsule"]), rng.uniform(0.003, 0.006, 3)
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><option timestep="{rng.choice([0.001, 0.002]) / finer}" integrator="implicitfast">
        <flag energy="enable"/></option><worldbody><body name="finger"><site name="gel"/></body>
        <body name="object" pos="0 0 .015"><freejoint/>
        <geom type="{kind}" size="{" ".join(map(str, size))}" mass="{rng.uniform(0.002, 0.1)}"/></body>
        </worldbody></mujoco>'''
    )
    data = mujoco.MjData(model)
    gels = MujocoGels(model, ["gel"], touching=["object"], sensor=lambda: TouchSensor(size=48, extent_mm=48.0))
    carry = Carrying(gels, friction=rng.uniform(0.1, 1.2))
    data.qpos[3:7], data.qvel[:] = rng.normal(size=4), rng.normal(size=6) * [0.05, 0.05, 0.05, 8, 8, 8]
    mujoco.mj_forward(model, data)
    begun, least, worst = float(data.energy.sum()), np.inf, 0.0
    for _ in range(400 * finer):
        try:
            held = carry.step(data)
        except ValueError:
            return None
        if not held:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_energyPos(model, data)
            mujoco.mj_energyVel(model, data)
            # What MuJoCo's integration keeps of a falling body, instead of its energy: its own error is no gain.
            now = float(data.energy.sum() - model.opt.timestep / 2 * model.body_mass[2] * 9.81 * data.qvel[2])
            worst, least = max(worst, (now - least) / begun), min(least, now)
    return worst


def tasks() -> Iterator[str]:
    for name in touch_tasks.TASKS:
        shares = [touch_tasks.share(name, touch=touch) for touch in (True, False)]
        yield f"{name:<11} done with touch in {shares[0]:.0%} of 50 episodes, without in {shares[1]:.0%}"


def tactile() -> Iterator[str]:
    for name, geom in {"sphere": 'type="sphere" size=".004"', "box": 'type="box" size=".004 .004 .004"'}.items():
        yield f"{name:<7} {beside_taxels(geom)}"


def beside_taxels(geom: str, points: int = 64, extent_mm: float = 32.0) -> str:
    """Return how far MuJoCo's taxels and ours are off the layer on 512 points, where it is moved by 10 um or more."""
    at = (np.arange(points) - (points - 1) / 2) * extent_mm / points
    model = with_taxels(geom, at / 1e3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    told = data.sensor("taxels").data.reshape(3, points, points)[0] * 1e3
    fine, ours = (
        MujocoGels(model, ["gel"], touching=["object"], sensor=sensor)["gel"]
        for sensor in (lambda: TouchSensor(size=512), lambda: TouchSensor(size=points, extent_mm=extent_mm))
    )
    truth = RectBivariateSpline(*[fine.sensor.layer.at_mm] * 2, fine.feel(data).depth_mm)(at, at)
    off = [np.abs(depth - truth)[np.abs(truth) > 0.01].mean() * 1e3 for depth in (told, ours.feel(data).depth_mm)]
    taken = [least_ms(lambda: mujoco.mj_forward(model, data)), least_ms(lambda: ours.feel(data))]
    return (
        f"MuJoCo's taxels {off[0]:.0f} um off (deepest {told.max():.2f} mm of {truth.max():.2f}), {taken[0]:.2f} ms "
        f"with its step; ours {off[1]:.0f} um, {taken[1]:.1f} ms"
    )


def with_taxels(geom: str, at_m: np.ndarray) -> mujoco.MjModel:
    """Return a pad with a tactile sensor of MuJoCo's, and an object in it.

    MuJoCo turns a mesh to its own axes and takes its corners as they then are, so they are put in afterwards.
    """
    count = len(at_m)
    corner = np.arange(count**2).reshape(count, count)
    faces = np.concatenate(
        [np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:]], -1).reshape(-1, 3),
         np.stack([corner[:-1, :-1], corner[1:, 1:], corner[1:, :-1]], -1).reshape(-1, 3)]
    )  # fmt: skip
    x, y = np.meshgrid(at_m, at_m)
    places = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.002)], 1)
    text = {"vertex": places, "normal": np.tile([0.0, 0.0, 1.0], (count**2, 1)), "face": faces}
    mesh = " ".join(f'{name}="{" ".join(map(str, values.ravel()))}"' for name, values in text.items())
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><asset><mesh name="taxels" {mesh} inertia="shell"/></asset><worldbody>
        <body name="finger"><geom name="pad" type="box" size=".02 .02 .002" pos="0 0 -.002"/><site name="gel"/></body>
        <body name="object" pos="0 0 {0.004 - DEPTH_MM / 1e3}"><freejoint/><geom {geom} mass=".01"/></body></worldbody>
        <sensor><tactile name="taxels" geom="pad" mesh="taxels"/></sensor></mujoco>"""
    )
    model.mesh_vert[: count**2], model.mesh_normal[: count**2] = places, (0, 0, 1)
    return model


PARTS = {"speed": speed, "truth": truth, "lift": lift, "hold": partial(lift, 100_000), "energy": energy, "tasks": tasks,
         "tactile": tactile, "fresh": partial(energy, range(2000, 4000))}  # fmt: skip


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.touch", description=__doc__)
    usual = [part for part in PARTS if part not in ("hold", "fresh")]
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    for part in parser.parse_args().parts or usual:
        for line in PARTS[part]():
            print(line, flush=True)


if __name__ == "__main__":
    main()
