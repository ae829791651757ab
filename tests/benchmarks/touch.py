"""How true touch in a robot simulator is: `python -m tests.benchmarks.touch [PART ...]`.

lift: a gripper holds balls, boxes, cylinders; hold: over 10^5 steps. energy: bodies are thrown at a gel; by how much
kinetic and potential energy grow from one flight to the next; fresh: others are thrown. tasks: in what share of 50
episodes rules with touch and without do what the environments ask for. hold and fresh take an hour and more, and run
only where they are named.
"""

import argparse
import itertools
import time
from collections.abc import Iterator, Sequence
from functools import partial

import mujoco
import numpy as np

from gellight_touch import GRIPPER, TouchSensor
from gellight_touch.mujoco_carry import Carrying
from gellight_touch.mujoco_gels import MujocoGels
from tests.benchmarks import touch_tasks

STEP_S = 0.002
SHAPES = {"ball": 'type="sphere" size=".008"', "box": 'type="box" size=".008 .006 .006"',
          "cylinder": 'type="cylinder" size=".008 .006"'}  # fmt: skip


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


PARTS = {"lift": lift, "hold": partial(lift, 100_000), "energy": energy, "tasks": tasks,
         "fresh": partial(energy, range(2000, 4000))}  # fmt: skip


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
