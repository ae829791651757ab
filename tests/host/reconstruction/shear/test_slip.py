"""Slip on simulated drags, whose truth is known, with the noise of places; and where nothing can be said."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.shear import DotsSeen, Slip, SlipState
from gellight.lab.simulator.known_force import known_force
from gellight.lab.simulator.printed_dots import PrintedDots
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight.reconstruction.following import ContactFollower
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.shear.slip import SlipFollower
from gellight.reconstruction.stages import Stages, tactile_frame
from sim_reference.camera import CameraResponse
from sim_reference.geometry import SensorGeometry
from sim_reference.surface import sample

GEOMETRY = SensorGeometry()
FRAME_S = 1 / 30
STEP_MM = 0.06
"""1.8 mm/s"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(GEOMETRY, CameraResponse(), printed=Printed(dots=PrintedDots(columns=9, rows=7), friction=0.5))


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return load_bundle("synthetic").with_files(known_force(GEOMETRY))


def frames(
    scene: Scene, bundle: Bundle, motions: list[float], at: tuple[float, float]
) -> Iterator[tuple[TactileFrame, float]]:
    """Yield each frame, and the share of the contact that sticks, as a ball goes to x of `motions`."""
    rng, measures = np.random.default_rng(1), BundleMeasures(bundle)
    rest = scene._dots(None)[0]
    image = np.zeros((*GEOMETRY.image_shape, 3), np.uint8)
    path: tuple[tuple[float, float, float], ...] = ()
    for number, x in enumerate(motions):
        if x != (path[-1][0] if path else 0.0):
            path = (*path, (x, 0.0, 0.0))
        press = Press("BALL", 1.0, *at, path)
        surface = sample(scene.deformation(press), GEOMETRY, *press.place)
        places = scene._dots(press)[0] + rng.normal(0, 0.04, (63, 2))
        dots = DotsSeen(rest_px=rest, places_px=places, reasons=np.zeros(63, np.uint8))
        camera = CameraFrame(image=image, time_s=number * FRAME_S, sequence=number, dots=dots)
        depth = (surface.depth_mm + rng.normal(0, 1e-3, surface.depth_mm.shape)).astype(np.float32)
        slopes = surface.gradient_map.astype(np.float32)
        felt = tactile_frame(camera, image.astype(np.float32), slopes, depth, bundle.pixel_size_mm, Stages(),
                             measures=measures)  # fmt: skip
        yield felt, scene._sheared(press).sticking_share


def judged(
    scene: Scene, bundle: Bundle, motions: list[float], at: tuple[float, float] = (1.0, 0.5)
) -> list[tuple[Slip, float]]:
    contacts, slips = ContactFollower(), SlipFollower()
    told = []
    for frame, sticks in frames(scene, bundle, motions, at):
        slip = slips.follow(contacts.follow(frame)).slip
        assert slip is not None
        told.append((slip, sticks))
    return told


def test_a_drag_sticks_then_slips_and_a_held_object_does_not(scene: Scene, bundle: Bundle) -> None:
    drag = [STEP_MM * step for step in range(1, 25)]
    told = judged(scene, bundle, [0.0] * 6 + drag + [drag[-1]] * 6)
    assert {slip.state for slip, _ in told[:2]} == {SlipState.UNKNOWN}
    assert {slip.state for slip, _ in told[3:8]} == {SlipState.STICK}
    full = next(number for number, (_, sticks) in enumerate(told) if sticks == 0)
    assert full > 12
    states = [slip.state for slip, _ in told]
    assert set(states[full + 3 : 30]) == {SlipState.FULL}
    assert SlipState.FULL not in states[: full - 2]
    assert SlipState.PARTIAL in states[8 : full + 1]
    assert set(states[33:]) == {SlipState.STICK}
    velocity = told[28][0].velocity_mm_s
    assert velocity is not None
    assert velocity[0] == pytest.approx(STEP_MM / FRAME_S, rel=0.35)


def test_a_slow_drag_slips_in_part_where_most_of_the_contact_does_and_only_while_it_goes_on(
    scene: Scene, bundle: Bundle
) -> None:
    """At 0.75 mm/s what slips in 0.06 s is no more than the noise of places."""
    drag = [0.05 * step for step in range(1, 12)] + [0.55 + 0.025 * step for step in range(1, 11)]
    told = judged(scene, bundle, [0.0] * 4 + drag + [drag[-1]] * 6)
    while_moved = told[2:25]
    partial = [slip.state for slip, sticks in while_moved if sticks < 0.3]
    assert len(partial) > 4
    assert set(partial) == {SlipState.PARTIAL}
    assert {slip.state for slip, sticks in while_moved if sticks > 0.5} == {SlipState.STICK}
    assert {slip.state for slip, _ in told[27:]} == {SlipState.STICK}


def test_what_begins_again_is_judged_as_the_first_time(scene: Scene, bundle: Bundle) -> None:
    """The times of its frames are earlier then; nothing from before is compared with them."""
    drag = [0.05 * step for step in range(1, 12)] + [0.55 + 0.025 * step for step in range(1, 11)]
    played, slips = [frame for frame, _ in frames(scene, bundle, drag, (1.0, 0.5))], SlipFollower()
    first, again = ([slips.follow(frame).slip for frame in played] for _ in range(2))
    assert first[-1] is not None
    assert first[-1].state is SlipState.PARTIAL
    assert again == first


def test_nothing_is_said_where_no_dot_is_under_the_contact(scene: Scene, bundle: Bundle) -> None:
    told = judged(scene, bundle, [0.0, 0.06, 0.12, 0.18], at=(15.0, 0.0))
    assert {(slip.state, slip.why) for slip, _ in told} == {(SlipState.UNKNOWN, "no dot is under the contact")}


def test_a_gel_without_dots_has_no_slip_and_another_gel_says_why(scene: Scene, bundle: Bundle) -> None:
    ((frame, _),) = frames(scene, bundle, [0.0], (1.0, 0.5))
    dots = frame.camera_frame.dots
    assert dots is not None
    contacts, slips = ContactFollower(), SlipFollower()
    plain = replace(frame, camera_frame=replace(frame.camera_frame, dots=None))
    assert slips.follow(contacts.follow(plain)).slip is None
    other = replace(frame, camera_frame=replace(frame.camera_frame, dots=replace(dots, problem="another gel")))
    slip = slips.follow(contacts.follow(other)).slip
    assert slip is not None
    assert (slip.state, slip.why, slip.confidence) == (SlipState.UNKNOWN, "another gel", 0)
