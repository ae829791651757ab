"""How true touch in a robot simulator is: `python -m tests.benchmarks.touch [PART ...]`.

energy: bodies are thrown at a gel; by how much kinetic and potential energy grow from one flight to the next; fresh:
others are thrown, for an hour and more, only where it is named. tasks: in what share of 50 episodes rules with touch
and without do what the environments ask for.
"""

import argparse
from collections.abc import Iterator, Sequence
from functools import partial

import mujoco
import numpy as np

from gellight_touch import TouchSensor
from gellight_touch.mujoco_carry import Carrying
from gellight_touch.mujoco_gels import MujocoGels
from tests.benchmarks import touch_tasks


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


PARTS = {"energy": energy, "tasks": tasks, "fresh": partial(energy, range(2000, 4000))}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.touch", description=__doc__)
    usual = [part for part in PARTS if part != "fresh"]
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    for part in parser.parse_args().parts or usual:
        for line in PARTS[part]():
            print(line, flush=True)


if __name__ == "__main__":
    main()
