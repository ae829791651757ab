"""Traction along the gels of a MuJoCo model: it carries what rests, and Coulomb's limit is its end."""

import mujoco
import numpy as np
import pytest

from gellight_touch import GRIPPER, Sheared, TouchSensor
from gellight_touch.mujoco_carry import Carrying
from gellight_touch.mujoco_drag import Dragging
from gellight_touch.mujoco_gels import MujocoGel, MujocoGels

WEIGHT_N = 0.05 * 9.81


def small() -> TouchSensor:
    return TouchSensor(size=96, extent_mm=48.0)


def on_a_slope(degrees: float, seconds: float = 0.6) -> tuple[MujocoGel, mujoco.MjData]:
    """Return a gel whose x axis points down the slope, and what lies on it."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" integrator="implicitfast" cone="elliptic" impratio="10"/><worldbody>
        <body name="finger" euler="0 {degrees} 0"><geom type="box" size=".03 .02 .002" pos="0 0 -.002"/>
            <site name="gel"/></body>
        <body name="block" euler="0 {degrees} 0" pos="{0.003 * np.sin(np.radians(degrees))} 0
            {0.003 * np.cos(np.radians(degrees))}"><freejoint/>
            <geom type="box" size=".004 .004 .003" mass=".05" friction=".5"/></body></worldbody></mujoco>"""
    )
    model.geom_friction[0, 0] = 0.1  # of two geoms MuJoCo takes the larger coefficient
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, int(seconds / model.opt.timestep))
    return MujocoGels(model, ["gel"], touching=["block"], sensor=small)["gel"], data


def test_a_block_that_rests_on_a_slope_pulls_with_its_weight() -> None:
    gel, data = on_a_slope(20.0)
    felt = gel.look(data)
    sheared = gel.shear(data, felt)
    assert felt.force_n == pytest.approx(WEIGHT_N * np.cos(np.radians(20)), rel=0.01)
    assert sheared.force_n == pytest.approx((WEIGHT_N * np.sin(np.radians(20)), 0.0), rel=0.01, abs=0.01 * WEIGHT_N)
    assert sheared.sticks[felt.contact].mean() > 0.5
    assert (np.linalg.norm(sheared.traction_mpa, axis=2) <= 0.5 * felt.pressure_mpa * (1 + 1e-6)).all()


def test_a_block_that_slides_pulls_with_coulombs_force() -> None:
    gel, data = on_a_slope(40.0, seconds=0.05)
    felt = gel.look(data)
    sheared = gel.shear(data, felt)
    assert data.body("block").cvel[3] > 0.05
    assert sheared.force_n[0] == pytest.approx(0.5 * felt.force_n, rel=0.02)
    assert sheared.sticks[felt.contact].mean() < 0.1


def test_what_two_gels_hold_pulls_them_down_with_its_weight() -> None:
    model = mujoco.MjModel.from_xml_path(str(GRIPPER))
    carry = Carrying(MujocoGels(model, ["left", "right"], touching=["object"], sensor=small))
    data = mujoco.MjData(model)
    for step in range(500):
        data.ctrl[:] = [np.clip((step * 0.002 - 0.4) * 0.05, 0, 0.02), *[2.0 * min(step / 150, 1)] * 2]
        held = carry.step(data)
    pulled = np.zeros(3)
    for name, gel in carry.gels.items():
        felt = gel.feel(data)
        sheared = carry.shear(data, name, felt, held)
        assert sheared.sticks.any()
        pulled += gel.gap.rotation(data)[:, :2] @ sheared.force_n
    assert pulled == pytest.approx((0.0, 0.0, -0.02 * 9.81), abs=2e-3)


def by_hand(friction: float = 0.6) -> tuple[Dragging, MujocoGel, mujoco.MjModel, mujoco.MjData]:
    """Return a gel and a ball that is moved by hand, .9 mm deep."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="finger" euler="30 20 10"><site name="gel"/>
        <body name="ball" pos="0 0 .0031"><joint name="x" type="slide" axis="1 0 0"/>
        <joint name="y" type="slide" axis="0 1 0"/><joint name="z" type="slide" axis="0 0 1"/>
        <joint name="roll" type="hinge" axis="0 1 0"/>
        <joint name="spin" type="hinge"/><geom type="sphere" size=".004" mass=".01"/></body></body>
        </worldbody></mujoco>"""
    )
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    return Dragging(gel, friction=friction), gel, model, mujoco.MjData(model)


def moved(dragging: Dragging, gel: MujocoGel, model: mujoco.MjModel, data: mujoco.MjData, **places: float) -> Sheared:
    for joint, place in places.items():
        data.joint(joint).qpos = place
    mujoco.mj_kinematics(model, data)
    return dragging.follow(data, gel.feel(data))


@pytest.mark.parametrize("friction", [0.05, 0.6])
def test_what_is_moved_by_hand_drags_as_told(friction: float) -> None:
    dragging, *world = by_hand(friction)
    moved(dragging, *world)
    felt = world[0].feel(world[2])
    for share in (0.5, 1.0):
        sheared = moved(dragging, *world, x=1e-4 * share, y=-5e-5 * share)
    told = world[0].sensor.drag(felt, (0.1, -0.05, 0.0), friction=friction)
    assert sheared.force_n == pytest.approx(told.force_n, rel=0.05)
    begun = moved(Dragging(world[0], friction=0.6), *world, spin=0.0)
    assert begun.force_n == pytest.approx((0.0, 0.0), abs=1e-9), "what begins to touch pulls nowhere"


def test_a_spin_turns_and_what_rolls_pulls_little() -> None:
    dragging, *world = by_hand()
    moved(dragging, *world)
    sheared = moved(dragging, *world, spin=0.02)
    assert sheared.torque_nmm > 0
    assert np.hypot(*sheared.force_n) < 0.02 * world[0].feel(world[2]).force_n
    rolling, *world = by_hand()
    moved(rolling, *world)
    rolled = moved(rolling, *world, x=1e-4, roll=1e-4 / 0.004)
    slid, *world = by_hand()
    moved(slid, *world)
    assert abs(rolled.force_n[0]) < 0.35 * moved(slid, *world, x=1e-4).force_n[0]


def test_what_leaves_and_comes_back_pulls_no_more() -> None:
    dragging, *world = by_hand()
    moved(dragging, *world)
    assert moved(dragging, *world, x=1e-4).force_n[0] != 0
    left = moved(dragging, *world, z=0.004)
    assert left.force_n == (0, 0)
    assert not left.sticks.any()
    force_n = world[0].feel(world[2]).force_n
    assert force_n == 0
    assert moved(dragging, *world, x=3e-4, z=0.0).force_n == pytest.approx((0, 0), abs=1e-2)


def test_two_objects_that_part_pull_apart() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="finger" euler="30 20 10"><site name="gel"/>
        <body name="a" pos="-.006 0 .0031"><joint name="a" type="slide" axis="1 0 0"/>
        <geom type="sphere" size=".004" mass=".01"/></body>
        <body name="b" pos=".006 0 .0031"><joint name="b" type="slide" axis="1 0 0"/>
        <geom type="sphere" size=".004" mass=".01"/></body></body></worldbody></mujoco>"""  # both move with the finger
    )
    data, gel = mujoco.MjData(model), MujocoGels(model, ["gel"], touching=["a", "b"], sensor=small)["gel"]
    dragging = Dragging(gel)
    moved(dragging, gel, model, data)
    pulled = moved(dragging, gel, model, data, a=-1e-4, b=1e-4)
    left = pulled.traction_mpa[:, :32, 0].sum()
    assert left < 0
    assert pulled.traction_mpa[:, 32:, 0].sum() == pytest.approx(-left, rel=0.02)
