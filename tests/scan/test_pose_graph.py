"""How presses of one surface lie: two found on each other without a guess, all from the joints, wrong ones left out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from gellight_scan import pairs
from gellight_scan.contact_view import ContactView
from gellight_scan.levelling import Laid, levelled
from gellight_scan.pairs import Fit, Joint, joined
from gellight_scan.pose_graph import connected, solve
from gellight_scan.tracking.rigid import inverse, pose_of, twist_of
from tests.helpers.reliefs import Plate

COVARIANCE = np.diag([0.01, 0.01, 0.005, 0.002, 0.002, 0.001]) ** 2
PIXEL_MM = (0.1176, 0.1176)
SHAPE = (240, 320)
X, Y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * PIXEL_MM[0] for n in SHAPE[::-1]))
PLATE = Plate(0.06, 21)
ONE = np.eye(4)


def beside(x: float, y: float, turn_deg: float = 0.0, tilt_deg: float = 0.0) -> np.ndarray:
    return pose_of(np.array([-x, -y, 0, np.radians(tilt_deg), 0, np.radians(turn_deg)]))


def seen(pose: np.ndarray, deep_mm: float = 0.1, surface=PLATE.seen) -> ContactView:
    """The part itself as the gel: all that is higher than its middle less `deep_mm`; the rest of the gel is level."""
    height = surface(pose, X, Y)
    return ContactView(np.maximum(height + deep_mm, 0).astype(np.float32), PIXEL_MM, "exact")


@pytest.mark.parametrize(
    ("pose", "guess"),
    [
        (beside(-20, 3, 6, 0.1), None),
        (beside(5, -16, -11, -0.2), None),
        (beside(12, 4, 3), beside(12.15, 3.9, 3.4)),
    ],
    ids=["left", "above", "near a guess"],
)
def test_a_press_beside_is_found_with_and_without_a_guess(pose: np.ndarray, guess: np.ndarray | None) -> None:
    joint = joined((0, seen(ONE)), (1, seen(pose)), guess)
    off = np.abs(twist_of(inverse(pose) @ joint.pose, joint.centre_mm))
    assert off[:2].max() < 0.01
    assert off[2] < 0.005
    assert np.degrees(off[5]) < 0.05
    assert (off < 3 * np.sqrt(np.diag(joint.covariance))).all()


def test_what_does_not_overlap_is_not_joined() -> None:
    assert joined((0, seen(ONE)), (1, seen(beside(30, 25)))) is None


def test_another_surface_is_not_joined() -> None:
    for seed in (31, 32):
        assert joined((0, seen(ONE)), (1, seen(ONE, surface=Plate(0.06, seed).seen))) is None


def test_a_regular_pattern_fits_in_many_places_and_is_refused() -> None:
    def waves(pose: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.06 * (np.sin(2 * np.pi * (x - pose[0, 3]) / 2) + np.sin(2 * np.pi * (y - pose[1, 3]) / 2))

    assert joined((0, seen(ONE, surface=waves)), (1, seen(beside(15, 3), surface=waves))) is None


def test_a_smooth_plate_tells_no_place() -> None:
    """What is left of it are errors of 2 um, which are other ones in each press."""

    def plate(seed: int) -> ContactView:
        noise = gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), 4)
        return ContactView((0.2 + 0.002 * noise / noise.std()).astype(np.float32), PIXEL_MM, "exact")

    assert joined((0, plate(1)), (1, plate(2))) is None
    assert joined((0, plate(1)), (1, plate(2)), ONE) is None
    nothing = ContactView(np.zeros(SHAPE, np.float32), PIXEL_MM, "exact")
    assert joined((0, nothing), (1, seen(ONE))) is None


def truth(count: int = 8) -> list[np.ndarray]:
    """Presses on a ring, turned and tilted."""
    random = np.random.default_rng(3)
    poses = []
    for number in range(count):
        angle = 2 * np.pi * number / count
        twist = np.array([20 * np.cos(angle), 15 * np.sin(angle), 0, *random.normal(size=3) * [0.01, 0.01, 0.08]])
        poses.append(pose_of(twist))
    return [inverse(poses[0]) @ pose for pose in poses]


def joint(one: int, other: int, *, noise: np.random.Generator | None = None) -> Joint:
    pose = inverse(truth()[other]) @ truth()[one]
    if noise is not None:
        pose = pose @ pose_of(noise.normal(size=6) * np.sqrt(np.diag(COVARIANCE)))
    return Joint(one, other, pose, np.zeros(3), COVARIANCE, 50.0, 0.98)


def ring(noise: np.random.Generator | None = None) -> list[Joint]:
    near = [(one, (one + step) % 8) for one in range(8) for step in (1, 2)]
    return [joint(*sorted(pair), noise=noise) for pair in near]


def off(poses: dict, number: int) -> np.ndarray:
    return np.abs(twist_of(inverse(truth()[number]) @ poses[number]))


def test_joints_that_agree_are_met_exactly() -> None:
    solved = solve(ring(), 0)
    assert max(off(solved.poses, number).max() for number in range(8)) < 1e-6
    assert solved.weights == (1.0,) * 16


def test_a_loop_takes_away_what_a_chain_adds_up() -> None:
    """Errors along a chain of seven add up; closed to a ring and braced, they are less than half."""
    chain, closed = [], []
    for seed in range(8):
        joints = ring(np.random.default_rng(seed))
        along = [one for one in joints if one.other == one.one + 1]
        chain.append(off(solve(along, 0).poses, 7)[:2])
        closed.append(off(solve(joints, 0).poses, 7)[:2])
    assert np.sqrt(np.mean(np.square(closed))) < 0.5 * np.sqrt(np.mean(np.square(chain)))


@pytest.mark.parametrize("which", [0, 5, 15])
@pytest.mark.parametrize("by_mm", [0.3, 1.0, 8.0])
def test_one_wrong_joint_is_left_out(which: int, by_mm: float) -> None:
    """The poses are as good as without it, though the chain that they begin with may go through it."""
    joints = ring(np.random.default_rng(1))
    wrong = joints[which].pose.copy()
    wrong[0, 3] += by_mm
    spoilt = [*joints]
    spoilt[which] = replace(joints[which], pose=wrong, common_mm2=1000.0)
    solved = solve(spoilt, 0)
    assert [number for number, weight in enumerate(solved.weights) if weight < 0.5] == [which]
    without = solve(joints[:which] + joints[which + 1 :], 0)
    for number in range(8):
        np.testing.assert_allclose(solved.poses[number], without.poses[number], atol=0.004)


def test_what_hangs_on_nothing_has_no_place() -> None:
    """Presses 4 and 5 hang together, and on no other one."""
    joints = [joint(0, 1), joint(1, 2), joint(4, 5)]
    assert set(solve(joints, 0).poses) == {0, 1, 2}
    assert set(connected(joints, 4)) == {4, 5}
    assert solve([], 3).poses.keys() == {3}


@pytest.mark.parametrize(("apart_mm", "weights"), [(0.0945, True), (0.0951, False)])
def test_joints_that_contradict_each_other_by_more_than_chance_lose_weight(apart_mm: float, weights: bool) -> None:
    """The pose lies between two of 0.01 mm: each is off by half; one in a thousand is by 22.46 = 4.74^2 sigma^2."""
    one = joint(0, 1)
    other = replace(one, pose=pose_of(np.array([apart_mm, 0, 0, 0, 0, 0])) @ one.pose)
    assert (solve([one, other], 0).weights == (1.0, 1.0)) is weights


@pytest.mark.parametrize(
    ("slope", "common_mm2", "tilt_deg", "right"),
    [(0.81, 5.1, 4.9, True), (0.79, 5.1, 4.9, False), (0.81, 4.9, 4.9, False), (0.81, 5.1, 5.1, False)],
)
def test_a_fit_is_believed_where_slopes_agree_over_enough_gel_of_two_level_presses(
    slope: float, common_mm2: float, tilt_deg: float, right: bool
) -> None:
    found, agreement = SimpleNamespace(pose=beside(0, 0, 0, tilt_deg)), SimpleNamespace(slope=slope)
    assert bool(Fit(None, found, agreement, common_mm2).right) is right  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("slope", "common_mm2", "beside_mm", "told"),
    [
        (0.889, 31.0, 0.51, True),
        (0.891, 31.0, 0.51, False),
        (0.891, 29.0, 0.51, True),
        (0.891, 31.0, 0.49, True),
    ],
    ids=["fits worse", "fits as well", "smaller", "same place"],
)
def test_another_place_that_is_nearly_as_good_leaves_it_open(
    slope: float, common_mm2: float, beside_mm: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The best leaves 0.03 and is common over 100 mm2: three times that and 0.02 make 0.11."""
    key = SimpleNamespace(centre_mm=np.zeros(3))
    fits = [
        Fit(key, SimpleNamespace(pose=beside(x, 0)), SimpleNamespace(slope=agreed), area)  # type: ignore[arg-type]
        for x, agreed, area in ((beside_mm, slope, common_mm2), (0.0, 0.97, 100.0))
    ]
    monkeypatch.setattr(pairs, "starts", lambda *views: [0, 1])
    monkeypatch.setattr(pairs, "fit", lambda one, other, start, *points, **steps: fits[start])
    assert (pairs._searched(None, None) is fits[1]) is told  # type: ignore[arg-type]


def laid(row: int, height_mm: float, unknown: int) -> Laid:
    """A press of 10 x 30 pixels on a grid, ten columns beside the last one; some pixels of its left are unknown."""
    height = np.full((10, 30), height_mm)
    height[0, :unknown] = np.nan
    return Laid(slice(0, 10), slice(10 * row, 10 * row + 30), height, np.full((10, 30), 0.001), np.ones((10, 30)),
                np.zeros((10, 30, 2)))  # fmt: skip


@pytest.mark.parametrize(("unknown", "step_mm"), [(0, 0.0), (1, 0.05)])
def test_presses_are_levelled_by_200_pixels_in_common(unknown: int, step_mm: float) -> None:
    one, other = levelled(np.arange(40) * 0.1, np.arange(10) * 0.1, [laid(0, 0.1, 0), laid(1, 0.15, unknown)])
    assert np.nanmean(other.height_mm[:, :20] - one.height_mm[:, 10:]) == pytest.approx(step_mm, abs=1e-6)
