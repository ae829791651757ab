"""Contacts from frame to frame: numbers that stay, and velocities known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.frames.frames import Patch, TactileFrame
from gellight.reconstruction.following import ContactFollower
from tests.helpers.dashboard_source import bump

PERIOD_S = 1 / 30
NOTHING = bump(0.0, 0.0, 0.0, shape=(24, 32))
BESIDE, FAR = (0.5, 0.0), (9.0, 0.0)


def at(number: float, *places_mm: tuple[float, float], area_mm2: float = 3.0) -> TactileFrame:
    """A frame with contacts of these places, taken `number` periods after the first."""
    contacts = tuple(
        Patch(centroid_mm=place, depth_mm=1.0, area_mm2=area_mm2, volume_mm3=1.0, slope_rad=0.3) for place in places_mm
    )
    taken = replace(NOTHING.camera_frame, time_s=100 + number * PERIOD_S)
    return replace(NOTHING, camera_frame=taken, contacts=contacts)


def numbers(*frames: TactileFrame) -> list[list[int]]:
    follower = ContactFollower()
    return [[patch.number for patch in follower.follow(frame).contacts] for frame in frames]


@pytest.mark.parametrize("speed_mm_s", [0.0, 5.0, 150.0])
def test_a_contact_that_moves_keeps_its_number_and_tells_velocity_and_age(speed_mm_s: float) -> None:
    follower = ContactFollower()
    step_mm = speed_mm_s * PERIOD_S * np.array([0.6, -0.8])
    seen = [follower.follow(at(k, *map(tuple, [(step_mm * k).tolist()]), area_mm2=80.0)).contacts for k in range(12)]
    assert {patch.number for (patch,) in seen} == {1}
    assert seen[0][0].velocity_mm_s is None
    for k, (patch,) in enumerate(seen[1:], start=1):
        assert patch.velocity_mm_s == pytest.approx((0.6 * speed_mm_s, -0.8 * speed_mm_s), abs=1e-9)
        assert patch.age_s == pytest.approx(k * PERIOD_S)


@pytest.mark.parametrize("fps", [2, 5, 8])
def test_few_frames_a_second_tell_the_same_contact_and_its_velocity(fps: int) -> None:
    follower, apart = ContactFollower(), 30 / fps
    seen = [follower.follow(at(apart * k, (0.5 / fps * k, 0.0))).contacts[0] for k in range(5)]
    assert [patch.number for patch in seen] == [1] * 5
    assert seen[-1].age_s == pytest.approx(4 / fps)
    for patch in seen[1:]:
        assert patch.velocity_mm_s == pytest.approx((0.5, 0.0), abs=1e-9)


def test_what_moves_faster_than_its_size_is_found_where_it_is_expected() -> None:
    frames = [at(k, (k * k * 0.15, 0.0)) for k in range(20)]  # at the end 5.6 mm a frame, circles of 1 mm
    assert numbers(*frames) == [[1]] * 20


def test_noise_of_the_place_is_averaged() -> None:
    noise, follower, random = 0.02, ContactFollower(), np.random.default_rng(0)
    places = random.normal(0, noise, (300, 2)).tolist()
    speeds = [follower.follow(at(k, tuple(place))).contacts[0].velocity_mm_s for k, place in enumerate(places)]
    assert np.std(np.array(speeds[5:])) < 0.35 * noise / PERIOD_S, "between two frames it would be 1.41"


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        ([at(0, (0, 0), FAR), at(1, FAR, (0, 0))], [[1, 2], [2, 1]]),
        ([at(0, (0, 0)), at(1, FAR)], [[1], [2]]),
        ([at(0, (0, 0), (1.5, 0)), at(1, BESIDE)], [[1, 2], [1]]),
        ([at(0, (0, 0)), at(1, (1.5, 0), BESIDE)], [[1], [2, 1]]),
        ([at(0, (0, 0)), at(1), at(2, (0, 0))], [[1], [], [1]]),
        ([at(0, (0, 0)), at(1), at(2.9, (0, 0))], [[1], [], [1]]),
        ([at(0, (0, 0)), at(1), at(3.1, (0, 0))], [[1], [], [2]]),
        ([at(0, (0, 0)), at(29.9, (0, 0))], [[1], [1]]),
        ([at(0, (0, 0)), at(30.1, (0, 0))], [[1], [2]]),
        ([at(0, (0, 0)), at(0, (0, 0)), at(1, (0, 0))], [[1], [1], [1]]),
    ],
    ids=[
        "deeper in turn",
        "elsewhere",
        "grown together",
        "parted",
        "missed once",
        "missed for less than 0.1 s",
        "touched again",
        "few frames",
        "a break",
        "twice the same",
    ],
)
def test_which_contact_is_which(frames: list[TactileFrame], expected: list[list[int]]) -> None:
    assert numbers(*frames) == expected


def test_a_frame_that_feels_nothing_says_nothing_of_them() -> None:
    dark = replace(at(1), contact=replace(NOTHING.contact, indentation_mm=float("nan")))
    assert numbers(at(0, (0, 0)), dark, at(2, (0, 0))) == [[1], [], [1]]
