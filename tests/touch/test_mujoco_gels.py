"""Gels in a MuJoCo model: what lies before them, and how it looks and feels."""

import mujoco
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight_touch import TouchSensor
from gellight_touch.layer import NOTHING
from gellight_touch.mujoco_gels import MujocoGels

BALL = '<geom name="ball" type="sphere" size=".004" {}/>'


def built(object_geom: str, at_m: str, *, more: str = "", finger: str = "") -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a finger whose gel looks along z, and an object."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" integrator="implicitfast" gravity="0 0 -9.81"/><asset>{more}</asset>
        <worldbody><body name="finger" {finger}>
            <geom name="pad" type="box" size=".02 .02 .002" pos="0 0 -.002"/><site name="gel"/>
            <body name="cover"><geom type="box" size=".03 .03 .001" pos="0 0 -.02"/></body></body>
        <body name="object" pos="{at_m}"><freejoint/>{object_geom}</body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def small() -> TouchSensor:
    return TouchSensor(size=64, extent_mm=32.0)


def ball_gap(at: np.ndarray, x_mm: float, y_mm: float, depth_mm: float) -> np.ndarray:
    r2 = (at[None, :] - x_mm) ** 2 + (at[:, None] - y_mm) ** 2
    return np.where(r2 < 16, 4 - np.sqrt(np.maximum(16 - r2, 0)) - depth_mm, NOTHING)


@pytest.mark.parametrize("look", ["", 'rgba="1 1 1 0"', 'group="3"'])
@pytest.mark.parametrize("depth_mm", [-0.5, 1.0, 2.9])
def test_a_ball_lies_where_it_is(depth_mm: float, look: str) -> None:
    """Also deep in the gel, invisible, of another group, and though the finger has parts behind the gel."""
    model, data = built(BALL.format(look), f".001 -.002 {0.004 - depth_mm / 1e3}")
    groups, opaque = model.geom_group.copy(), model.geom_rgba.copy()
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    gap = gel.gap.gap_mm(data)
    truth = ball_gap(gel.sensor.layer.at_mm, 1.0, -2.0, depth_mm)
    assert gap == pytest.approx(truth, abs=3e-3), "rays are parallel to 2e-4, which the steep rim shows"
    assert gap[truth < 1] == pytest.approx(truth[truth < 1], abs=1e-3)
    assert (gel.gap.bodies() == np.where(gap < NOTHING, model.body("object").id, -1)).all()
    assert (model.geom_group == groups).all()
    assert (model.geom_rgba == opaque).all()


def test_the_gap_moves_and_turns_with_the_gel() -> None:
    turned = 'pos=".1 .2 .3" euler="40 -25 70"'
    model, data = built(BALL.format(""), "0 0 1", finger=turned)
    axes, origin = data.site("gel").xmat.reshape(3, 3), data.site("gel").xpos
    data.joint(0).qpos[:3] = origin + axes @ [0.001, -0.002, 0.003]
    mujoco.mj_kinematics(model, data)
    gel = MujocoGels(model, ["gel"], touching=["object"], sensor=small)["gel"]
    assert gel.gap.gap_mm(data) == pytest.approx(ball_gap(gel.sensor.layer.at_mm, 1.0, -2.0, 1.0), abs=1e-3)
    assert gel.feel(data).centre_mm == pytest.approx((1.0, -2.0), abs=0.02)


def test_a_box_and_a_convex_mesh_are_flat() -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (-0.004, 0.004) for y in (-0.003, 0.003) for z in (-0.002, 0.002))
    mesh = f'<mesh name="brick" vertex="{corners}"/>'
    for geom in ('<geom type="box" size=".004 .003 .002"/>', '<geom type="mesh" mesh="brick"/>'):
        model, data = built(geom, "0 0 .0013", more=mesh)
        gap = MujocoGels(model, ["gel"], touching=["object"], sensor=small)["gel"].gap.gap_mm(data)
        at = np.linspace(-15.75, 15.75, 64)
        inside = (np.abs(at[None, :]) < 4) & (np.abs(at[:, None]) < 3)
        assert gap == pytest.approx(np.where(inside, -0.7, NOTHING), abs=1e-3)


@pytest.mark.parametrize("mass_kg", [0.002, 0.02, 0.2])
def test_a_ball_at_rest_looks_as_deep_as_its_weight_presses(mass_kg: float) -> None:
    """However deep MuJoCo lets it sink."""
    model, data = built(BALL.format(f'mass="{mass_kg}"'), "0 0 .0041")
    mujoco.mj_step(model, data, 1500)
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    weight_n = mass_kg * 9.81
    assert gel.contact_force_n(data) == pytest.approx(weight_n, rel=1e-3)
    looked = gel.look(data)
    assert looked.force_n == pytest.approx(weight_n, rel=2e-3)
    at = gel.sensor.layer.at_mm
    np.testing.assert_allclose(
        looked.depth_mm, gel.sensor.sink(ball_gap(at, 0, 0, 0), weight_n).depth_mm, rtol=0, atol=1e-3
    )


def test_what_does_not_touch_looks_untouched() -> None:
    model, data = built(BALL.format(""), "0 0 .006")
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    assert gel.contact_force_n(data) == 0
    assert gel.look(data).force_n == 0


HOLLOW = "".join(
    f"{np.cos(a) * r:.6f} {np.sin(a) * r:.6f} {z} "
    for a in np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for r, z in ((0.003, -0.002), (0.008, -0.002), (0.008, 0.002), (0.003, 0.002))
)
RING_FACES = "".join(
    f"{4 * i + a} {4 * i + b} {4 * j + b} {4 * i + a} {4 * j + b} {4 * j + a} "
    for i, j in zip(range(24), [*range(1, 24), 0], strict=True)
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))
)


@pytest.mark.parametrize(
    ("sites", "touching", "says"),
    [
        (["gel"], ["bal"], "no geom or body 'bal': it has"),
        (["gels"], ["ball"], r"no site 'gels': it has \['gel'\]"),
        (["gel", "gel"], ["ball"], "give each site once"),
        ([], ["ball"], "one at least"),
        (["gel"], [], r"touching=\[\] has no geom, so nothing would be felt"),
        (["gel"], ["pad"], "gel gel: the body that holds it is among what may touch it"),
        (["gel"], ["ring"], "geom ring: its mesh fills 8[0-9]% of its hull, and MuJoCo lets the hull collide"),
    ],
)
def test_what_cannot_be_is_said(sites: list[str], touching: list[str], says: str) -> None:
    ring = f'<mesh name="ring" vertex="{HOLLOW}" face="{RING_FACES}"/>'
    model, _ = built(BALL.format("") + '<geom name="ring" type="mesh" mesh="ring"/>', "0 0 .01", more=ring)
    with pytest.raises(InputError, match=says):
        MujocoGels(model, sites, touching=touching, sensor=small)


def test_a_step_through_the_gel_is_said() -> None:
    model, data = built(BALL.format(""), "0 0 -.002")
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    with pytest.raises(ValueError, match=r"lies 5\.98 mm deep in a gel that is simulated to 3 mm: make the step"):
        gel.feel(data)


@pytest.mark.parametrize("place", [".0135 0 -.002", "0 0 -.0078"])
def test_what_touches_the_finger_beside_the_gel_or_on_its_back_is_not_felt(place: str) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="finger" euler="0 0 30">
        <geom type="box" size=".01 .01 .002" pos="0 0 -.002"/><site name="gel"/></body>
        <body name="around" euler="0 0 30"><body name="ball" pos="{place}"><geom type="sphere" size=".004" mass=".05"/>
        <joint type="slide"/></body></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    gel = MujocoGels(model, ["gel"], touching=["ball"], sensor=small)["gel"]
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    assert force[0] > 0
    assert gel.contact_force_n(data) == 0
    assert gel.look(data).force_n == 0
