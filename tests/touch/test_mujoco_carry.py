"""Gels that carry: weight, grip and slip, and no energy from nothing."""

from functools import partial
from typing import Any

import mujoco
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_touch import GRIPPER, TouchSensor
from gellight_touch.mujoco_carry import Carrying, Held, _push
from gellight_touch.mujoco_drag import Dragging
from gellight_touch.mujoco_gels import MujocoGels
from sim_reference.geometry import SensorGeometry
from tests.benchmarks.touch import grows

MODEL = GRIPPER.read_text()
SHAPES = {"ball": 'type="sphere" size=".008"', "box": 'type="box" size=".008 .006 .006"',
          "cylinder": 'type="cylinder" size=".008 .006"'}  # fmt: skip


def gripper(shape: str, mass_kg: float) -> mujoco.MjModel:
    geom = f'{SHAPES[shape]} mass="{mass_kg}"'
    return mujoco.MjModel.from_xml_string(MODEL.replace('type="sphere" size=".008" mass=".02"', geom))


def small() -> TouchSensor:
    return TouchSensor(size=48, extent_mm=48.0)


def carrying(
    model: mujoco.MjModel, friction: float = 0.8, sites: tuple[str, ...] = ("left", "right"), sensor: Any = small
) -> Carrying:
    return Carrying(MujocoGels(model, list(sites), touching=["object"], sensor=sensor), friction=friction)


def lifted(
    carry: Carrying, model: mujoco.MjModel, grip_n: float, seconds: float
) -> tuple[mujoco.MjData, list[list[Held]]]:
    """Close, lift by 20 mm from .4 s to .8 s, hold; return the forces of every step."""
    data, steps = mujoco.MjData(model), []
    for step in range(int(seconds / model.opt.timestep)):
        now_s = step * model.opt.timestep
        data.ctrl[:] = [np.clip((now_s - 0.4) * 0.05, 0, 0.02), *[grip_n * min(now_s / 0.3, 1)] * 2]
        steps.append(carry.step(data))
    return data, steps


@pytest.mark.parametrize(("shape", "mass_kg"), [("ball", 0.002), ("box", 0.02), ("cylinder", 0.1)])
@pytest.mark.nightly
def test_a_gripper_lifts_and_holds(shape: str, mass_kg: float) -> None:
    model = gripper(shape, mass_kg)
    carry = carrying(model)
    data, steps = lifted(carry, model, 2.0, 2.0)
    held = {one.gel: one for one in steps[-1]}
    up_n = sum((carry.gels[one.gel].gap.rotation(data) @ one.force_n)[2] for one in held.values())
    assert up_n == pytest.approx(mass_kg * 9.81, rel=1e-3)
    assert held["left"].force_n[2] == pytest.approx(2.0, rel=1e-2)
    assert held["left"].layer_force_n == pytest.approx(2.0, rel=1e-2), "the layer carries what the gripper presses"
    assert all(one.sticks for one in held.values())
    assert data.body("object").xpos[2] > 0.01
    velocity = data.body("object").cvel[3:]
    assert mass_kg * velocity @ velocity / 2 < 1e-12


def test_what_is_too_heavy_slips() -> None:
    model = gripper("ball", 0.1)
    whole = partial(TouchSensor, size=72, extent_mm=72.0)
    data, steps = lifted(carrying(model, friction=0.2, sensor=whole), model, 1.0, 0.7)
    assert len(steps[-1]) == 2, "13 mm beside the middle, still in the gels"
    assert data.body("object").xpos[2] < 0.002, "0.4 N of friction do not lift 1 N"
    for one in steps[-1]:
        assert not one.sticks
        assert np.linalg.norm(one.force_n[:2]) == pytest.approx(0.2 * one.force_n[2], rel=1e-6)


def test_the_forces_of_others_stay() -> None:
    model = gripper("ball", 0.02)
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body("object").id, 2] = 0.05
    carrying(model).step(data)
    assert data.xfrc_applied[model.body("object").id, 2] == 0.05


DROP = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
    <body name="finger"><geom type="box" size=".02 .02 .002" pos="0 0 -.002" contype="0" conaffinity="0"/>
        <site name="gel"/></body>
    <body name="object" pos="0 0 .012"><freejoint/><geom type="box" size=".005 .004 .003" mass=".01"/></body>
    </worldbody></mujoco>"""


@pytest.mark.parametrize(
    "seed", [196, 1677, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (79, 430, 510))]
)
def test_a_body_that_is_thrown_gains_no_energy(seed: int) -> None:
    """From one flight to the next: light boxes that gained up to 33 times of it while a force was cut by itself."""
    grown = grows(seed)
    assert grown < 1e-9


@pytest.mark.parametrize("slides", [False, True])
def test_what_lies_on_a_slope_rests_or_slides_as_coulomb_says(slides: bool) -> None:
    friction, tilt = 0.3, np.radians(30.0 if slides else 15.0)
    model = mujoco.MjModel.from_xml_string(DROP.replace(".012", ".003"))
    model.opt.gravity[:] = 9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)
    data, carry, speeds = mujoco.MjData(model), carrying(model, friction, ("gel",)), []
    for _ in range(80 if slides else 200):
        (held,) = carry.step(data)
        speeds.append(data.qvel[0] / 9.81)
    gains = np.polyfit(np.arange(40) * model.opt.timestep, speeds[-40:], 1)[0]
    assert gains == pytest.approx(np.sin(tilt) - friction * np.cos(tilt) if slides else 0.0, rel=2e-3, abs=1e-5)
    assert -held.force_n[0] == pytest.approx(friction * held.force_n[2] if slides else 0.0981 * np.sin(tilt), rel=1e-3)
    assert held.sticks != slides


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize(("mass_kg", "step_s", "off"), [(0.1, 0.002, 1e-3), (0.02, 0.002, 1e-3), (0.002, 0.001, 2e-3)])
def test_what_a_gel_presses_onto_a_table_is_pressed_as_the_layer_says(
    mass_kg: float, step_s: float, off: float, cone: str
) -> None:
    model = mujoco.MjModel.from_xml_string(
        f'''<mujoco><option timestep="{step_s}" integrator="implicitfast" cone="{cone}"/><worldbody>
        <geom type="plane" size="1 1 .1" solref="-30000 -100"/>
        <body name="finger" pos="0 0 .0075" euler="180 0 0"><site name="gel"/></body>
        <body name="object" pos="0 0 .004"><freejoint/>
        <geom type="sphere" size=".004" mass="{mass_kg}" solref="-30000 -100"/></body></worldbody></mujoco>'''
    )
    data, table = mujoco.MjData(model), np.zeros(6)
    gels = MujocoGels(model, ["gel"], touching=["object"], sensor=lambda: TouchSensor(size=64, extent_mm=32.0))
    carry = Carrying(gels)
    for _ in range(int(0.3 / step_s)):
        (held,) = carry.step(data)
    mujoco.mj_contactForce(model, data, 0, table)
    assert held.force_n[2] == pytest.approx(gels["gel"].feel(data).force_n, rel=off)
    assert table[0] == pytest.approx(held.force_n[2] + mass_kg * 9.81, rel=1e-4)


def test_an_integrator_that_cannot_be_halved_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL.replace('"implicitfast"', '"RK4"'))
    with pytest.raises(InputError, match='gels cannot carry under integrator="RK4": use "implicitfast"'):
        carrying(model)


def test_mujoco_and_the_gel_do_not_both_carry() -> None:
    model = mujoco.MjModel.from_xml_string(DROP.replace('contype="0" conaffinity="0"', ""))
    with pytest.raises(InputError, match='<exclude body1="finger" body2="object"/>'):
        carrying(model, sites=("gel",))


def test_no_pair_of_the_model_carries_what_the_gel_does() -> None:
    """MuJoCo lets a <pair> touch whatever else says that it does not."""
    text = DROP.replace('type="box" size=".02', 'name="back" type="box" size=".02').replace(
        '<geom type="box" size=".005', '<geom name="box" type="box" size=".005'
    )
    paired = '<contact><exclude body1="finger" body2="object"/><pair geom1="back" geom2="box"/></contact></mujoco>'
    with pytest.raises(InputError, match="body object, but a <pair> of the model's <contact> does so too: take it"):
        carrying(mujoco.MjModel.from_xml_string(text.replace("</mujoco>", paired)), sites=("gel",))


def test_what_begins_again_is_held_as_the_first_time() -> None:
    """A body that is pulled along the gel has moved a little; of that nothing is left in data that were reset."""
    model = mujoco.MjModel.from_xml_string(DROP.replace(".012", ".0028"))
    model.opt.gravity[:] = 4.0, 0.0, -9.0
    data, carry = mujoco.MjData(model), carrying(model, sites=("gel",))
    (first,) = carry.step(data)
    for _ in range(100):
        (held,) = carry.step(data)
    assert held.force_n[0] < 1.5 * first.force_n[0] < 0
    mujoco.mj_resetData(model, data)
    (again,) = carry.step(data)
    np.testing.assert_array_equal(again.force_n, first.force_n)


def in_the_gel() -> tuple[mujoco.MjModel, mujoco.MjData, Carrying]:
    """A box of 10 x 8 mm, 0.2 mm deep in a gel, that moves and turns."""
    model = mujoco.MjModel.from_xml_string(DROP.replace(".012", ".0028"))
    data = mujoco.MjData(model)
    data.qvel[:] = [0.01, -0.02, 0.03, 0.8, -0.5, 0.3]
    mujoco.mj_step1(model, data)
    return model, data, carrying(model, sites=("gel",))


def test_the_gap_is_expected_where_the_next_step_has_it() -> None:
    model, data, carry = in_the_gel()
    gel = carry.gels["gel"]
    now, bodies = gel.gap.gap_mm(data), gel.gap.bodies()
    expected = now + carry._moved_mm(gel, data, bodies, data.qvel)
    mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)
    mujoco.mj_kinematics(model, data)
    there = gel.gap.gap_mm(data)
    on = (bodies > 0) & (gel.gap.bodies() > 0)
    assert np.ptp(there[on] - now[on]) > 2e-3, "it turns"
    np.testing.assert_allclose(expected[on], there[on], atol=2e-5)


def test_a_body_is_pushed_where_and_as_the_spring_says() -> None:
    model, data, carry = in_the_gel()
    (spring,) = carry._springs("gel", carry.gels["gel"], data, data.qvel)
    force, came = np.array([0.1, -0.2, 0.3, 1e-3, 2e-3, -3e-3]), []
    for forces in (np.zeros((1, 6)), force[None]):
        _push(data, [spring], forces)
        mujoco.mj_fwdAcceleration(model, data)
        came.append(data.qfrc_smooth.copy())
    np.testing.assert_allclose(came[1] - came[0], spring.jacobian.T @ force, atol=1e-12)
    assert spring.stiffness[4] > 1.2 * spring.stiffness[3], "it is longer along x, so it tilts about y less easily"
    assert spring.stiffness[5] == pytest.approx(spring.stiffness[0] * (10e-3**2 + 8e-3**2) / 12, rel=0.15)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_rod_spins_out_where_friction_times_pressure_and_lever_end(share: float) -> None:
    """A quarter of its length is the mean lever of the line under it; that of a disc of its area is half of it."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/><worldbody>
        <body name="finger"><site name="gel"/></body>
        <body name="object" pos="0 0 .0018" euler="90 0 0"><freejoint/>
        <geom type="cylinder" size=".002 .010" mass=".2"/></body></worldbody></mujoco>"""
    )
    data, carry = mujoco.MjData(model), carrying(model, 0.8, ("gel",))
    for _ in range(200):
        carry.step(data)
    felt = carry.gels["gel"].feel(data)
    lever_mm = np.hypot(felt.at_mm[None, :], felt.at_mm[:, None])
    most_nmm = 0.8 * float((felt.pressure_mpa * lever_mm).sum()) * (felt.at_mm[1] - felt.at_mm[0]) ** 2
    assert most_nmm > 0.8 * felt.force_n * 4.5
    for torque in np.linspace(0, share * most_nmm, 200):
        data.xfrc_applied[model.body("object").id, 5] = torque * 1e-3
        (held,) = carry.step(data)
    assert held.sticks == (share < 1)


def test_a_gel_is_pulled_and_turned_against_what_it_does_to_the_body() -> None:
    """Of 0.05 N at (1, 2) mm, and a spin of 0.05 N mm, about the gel's centre: 2 x 0.05 - 0.05 N mm."""
    _, data, carry = in_the_gel()
    force, torque = np.array([0.05, 0.0, 1.0]), np.array([0.0, 0.0, 0.05])
    point = data.site("gel").xpos + carry.gels["gel"].gap.rotation(data) @ [1e-3, 2e-3, 0.0]
    held = [Held("gel", 2, force, torque, 1.0, True, point), Held("other", 2, force, torque, 1.0, True, point)]
    sheared = carry.shear(data, "gel", carry.gels["gel"].feel(data), held)
    assert sheared.force_n == pytest.approx((-0.05, 0.0), abs=2e-4)
    assert sheared.torque_nmm == pytest.approx(0.05, abs=2e-3)


def test_each_gel_is_as_stiff_sideways_as_its_own_poissons_ratio_says() -> None:
    """2 (1 - nu) / (2 - nu) of what it has along its normal."""
    twin = '<body name="other"><site name="twin"/></body><body name="object" pos'
    model = mujoco.MjModel.from_xml_string(DROP.replace('<body name="object" pos', twin).replace(".012", ".0028"))
    made = iter([SensorGeometry(poisson_ratio=nu) for nu in (0.49, 0.2)])
    gels = MujocoGels(model, ["gel", "twin"], touching=["object"],
                      sensor=lambda: TouchSensor(next(made), size=32, extent_mm=32.0))  # fmt: skip
    carry, data = Carrying(gels, friction=1e9), mujoco.MjData(model)
    mujoco.mj_step1(model, data)
    free = np.zeros(model.nv)
    springs = [carry._springs(name, gel, data, free)[0] for name, gel in gels.items()]
    assert [one.stiffness[0] / one.stiffness[2] for one in springs] == pytest.approx([1.02 / 1.51, 1.6 / 1.8])


def test_what_stands_in_the_world_carries_as_a_body_does() -> None:
    came = []
    for opened, closed in (("", ""), ("<body>", "</body>")):
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><option integrator="implicitfast" gravity="0 0 9.81"/><worldbody>
            {opened}<geom name="rock" type="sphere" size=".004" pos="0 0 .0042"/>{closed}
            <body name="finger"><joint name="down" type="slide" axis="0 0 1"/><site name="gel"/>
            <geom type="box" size=".01 .01 .002" pos="0 0 -.002" mass=".1" contype="0" conaffinity="0"/></body>
            </worldbody></mujoco>"""
        )
        data, gels = mujoco.MjData(model), MujocoGels(model, ["gel"], touching=["rock"], sensor=small)
        carry = Carrying(gels)
        for _ in range(40):
            held = carry.step(data)
        came.append((data.qpos[0], held[0].force_n[2]))
    assert came[0] == came[1]
    assert came[0][1] > 0


def test_a_friction_that_is_none_is_refused() -> None:
    gels = MujocoGels(mujoco.MjModel.from_xml_path(str(GRIPPER)), ["left"], touching=["object"], sensor=small)
    with pytest.raises(InputError, match="friction nan: give 0 or more"):
        Carrying(gels, friction=np.nan)
    with pytest.raises(InputError, match="loss_time_s -1: give 0 or more"):
        Carrying(gels, loss_time_s=-1.0)
    with pytest.raises(InputError, match="Coulomb's coefficient"):
        Dragging(gels["left"], friction=-0.1)
