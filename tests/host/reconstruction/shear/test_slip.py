"""Slip on simulated drags, whose truth is known, with the noise of places; and where nothing can be said."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.shear import DotsSeen, Slip, SlipState
from gellight.lab.simulator.printed_dots import PrintedDots, known_force
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight.reconstruction.following import ContactFollower
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.shear.slip import SlipFollower
from gellight.reconstruction.stages import Stages, tactile_frame
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT
from sim_reference.surface import sample
from tests.helpers.small_bundles import ordinary

GEOMETRY = replace(AS_BUILT, image_width_px=320, image_height_px=240, pixel_size_mm=2 * AS_BUILT.pixel_size_mm)
NOISE_PX = 0.02
"""of a dot's place"""
FRAME_S = 1 / 30
STEP_MM = 0.06
"""1.8 mm/s"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(GEOMETRY, CameraResponse(), printed=Printed(dots=PrintedDots(columns=9, rows=7), friction=0.5))


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return ordinary(2).with_files(known_force(GEOMETRY))


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
        places = scene._dots(press)[0] + rng.normal(0, NOISE_PX, (63, 2))
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


Step = tuple[float, float, float]
"""mm along x of imprint and gel, mm2"""
AGAIN = Slip(state=SlipState.UNKNOWN, why="it has only begun")
GROWS = Slip(state=SlipState.UNKNOWN, why="the contact grows or shrinks")
STICKS = Slip(state=SlipState.STICK, confidence=1.0)


@pytest.fixture(scope="module")
def pressed(scene: Scene, bundle: Bundle) -> TactileFrame:
    return next(frames(scene, bundle, [0.0], (1.0, 0.5)))[0]


@pytest.mark.parametrize(
    ("then", "after_s", "told"),
    [
        ((0.0, 0.0, 20.0), FRAME_S, STICKS),
        ((2.6, 0.0, 20.0), FRAME_S, AGAIN),
        ((0.0, 0.0, 20.0), 0.99, STICKS),
        ((0.0, 0.0, 20.0), 1.01, AGAIN),
        ((0.0, 0.0, 22.1), FRAME_S, STICKS),
        ((0.0, 0.0, 22.3), FRAME_S, GROWS),
    ],
    ids=["goes on", "is elsewhere", "is late", "is later", "grows by less than a tenth", "grows"],
)
def test_one_contact_is_compared_with_itself(pressed: TactileFrame, then: Step, after_s: float, told: Slip) -> None:
    """One that is farther away than the radius of 2.5 mm is another one."""
    assert told_of(pressed, [(0.0, 0.0, 20.0)] * 6 + [then], after_s)[-1] == told


CREEPING = [(0.013 * step, 0.4 * 0.013 * step, 20.0) for step in range(8)]
"""as little as noise in 0.06 s, and a PARTIAL slip in 0.24 s"""


@pytest.mark.parametrize(
    ("steps", "state"),
    [
        (CREEPING, SlipState.PARTIAL),
        ([(x, gel, 17.0 if x < 0.03 else 20.0) for x, gel, _ in CREEPING], SlipState.STICK),
        ([(0.0, 0.0, 20.0)] * 2 + [(0.2 * n, 0.0, 20.0) for n in range(1, 4)]
         + [(0.6 + 0.02 * n, 0.02 * n, 20.0) for n in range(1, 4)], SlipState.STICK),
    ],
    ids=["it creeps", "it has grown meanwhile", "it slid before, and sticks since"],
)  # fmt: skip
def test_creep_is_sought_as_far_back_as_the_contact_is_the_same(
    pressed: TactileFrame, steps: list[Step], state: SlipState
) -> None:
    assert told_of(pressed, steps)[-1].state is state


@pytest.mark.parametrize(
    ("imprint_mm", "gel_mm", "state"),
    [
        (0.019, 0.0, SlipState.STICK),
        (0.021, 0.0, SlipState.FULL),
        (1.0, 0.86, SlipState.STICK),
        (1.0, 0.84, SlipState.PARTIAL),
        (1.0, 0.31, SlipState.PARTIAL),
        (1.0, 0.29, SlipState.FULL),
        (0.29, 1.0, SlipState.FULL),
    ],
)
def test_what_the_gel_does_not_go_along_with_is_slip(
    pressed: TactileFrame, imprint_mm: float, gel_mm: float, state: SlipState
) -> None:
    slip = told_of(pressed, [(0.0, 0.0, 20.0)] * 2 + [(imprint_mm, gel_mm, 20.0)])[-1]
    assert slip.state is state
    if slip.velocity_mm_s is not None:
        assert slip.velocity_mm_s == pytest.approx(((imprint_mm - gel_mm) / (2 * FRAME_S), 0.0))


def told_of(frame: TactileFrame, steps: list[Step], last_s: float = FRAME_S) -> list[Slip]:
    """What is told of a contact that goes so, frame by frame; last_s: before the last one."""
    row, slips, told = np.stack([np.linspace(-8, 8, 63), np.zeros(63)], axis=1), SlipFollower(), []
    for number, (imprint_mm, gel_mm, area_mm2) in enumerate(steps):
        moved = row, np.tile([gel_mm, 0.0], (63, 1))
        measures: Any = SimpleNamespace(dot_motion=lambda depth_mm, dots, moved=moved: moved)
        patch = replace(frame.contacts[0], centroid_mm=(imprint_mm, 0.0), area_mm2=area_mm2)
        time_s = FRAME_S * number + (last_s - FRAME_S) * (number == len(steps) - 1)
        taken = replace(frame.camera_frame, time_s=time_s)
        slip = slips.follow(replace(frame, camera_frame=taken, contacts=(patch,), measures=measures)).slip
        told.append(slip)
    return told


def test_nothing_is_said_where_no_dot_is_under_the_contact(scene: Scene, bundle: Bundle) -> None:
    told = judged(scene, bundle, [0.0, 0.06, 0.12, 0.18], at=(15.0, 0.0))
    assert {(slip.state, slip.why) for slip, _ in told} == {(SlipState.UNKNOWN, "no dot is under the contact")}


def test_a_gel_without_dots_has_no_slip_and_another_gel_says_why(pressed: TactileFrame) -> None:
    dots = pressed.camera_frame.dots
    contacts, slips = ContactFollower(), SlipFollower()
    plain = replace(pressed, camera_frame=replace(pressed.camera_frame, dots=None))
    assert slips.follow(contacts.follow(plain)).slip is None
    other = replace(pressed, camera_frame=replace(pressed.camera_frame, dots=replace(dots, problem="another gel")))
    slip = slips.follow(contacts.follow(other)).slip
    assert (slip.state, slip.why, slip.confidence) == (SlipState.UNKNOWN, "another gel", 0)
