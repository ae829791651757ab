"""Contacts on surfaces that are known in closed form: patch, area, indentation; and followed from frame to frame."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from gellight.frames.frames import Patch, TactileFrame
from gellight.reconstruction.contact import find_contact, measure_patches, without_untouched
from gellight.reconstruction.following import ContactFollower
from tests.helpers import fem_presses
from tests.helpers.analytic_surfaces import centred_grid, gaussian, smooth_cap
from tests.helpers.dashboard_source import bump


def hertz(shape: tuple[int, int], radius: float, indentation: float, centre: tuple[float, float]) -> np.ndarray:
    """Surface displacement under a Hertz contact of a radius (Johnson 1985, eq. 3.42), in px and mm."""
    x, y = centred_grid(shape)
    r = np.maximum(np.hypot(x - centre[0], y - centre[1]), 1e-9)
    a = radius
    inside = (2 * a * a - r * r) / 2
    outside = (
        (2 * a * a - r * r) * np.arcsin(np.minimum(a / r, 1)) + a * np.sqrt(np.maximum(r * r - a * a, 0))
    ) / np.pi
    return indentation / a**2 * np.where(r <= a, inside, outside)


FINER = 3
STEEP = 1.24
"""in standard deviations of a Gaussian: there it is 0.95 times as steep as at its steepest, 1 away"""


@pytest.mark.parametrize("radius", [8, 20, 60])
def test_the_patch_of_a_hertz_contact_is_its_contact_circle(radius: float) -> None:
    depth = hertz((240, 320), radius, 0.6, (12.3, -7.8)).astype(np.float32)
    contact = find_contact(depth, 0.05)
    assert contact.area_mm2 == pytest.approx(np.pi * (radius * 0.05) ** 2, rel=0.08)
    assert contact.indentation_mm == pytest.approx(0.6, rel=2 / radius**2)
    assert contact.centroid_mm == pytest.approx((12.3 * 0.05, -7.8 * 0.05), abs=0.01)
    x, y = centred_grid((240, 320))
    r = np.hypot(x - 12.3, y + 7.8)
    assert contact.mask[r < radius - 1].all()
    assert not contact.mask[r > radius + 1].any()


@pytest.mark.parametrize("name", ["ball2.5_0.9", "ball4_0.3", "ball4_1.0", "ball7_0.8"])
def test_the_patch_under_a_ball_is_where_finite_elements_touch_it(name: str) -> None:
    depth = ndimage.zoom(fem_presses.depth_mm(name), FINER, order=3)
    spacing = fem_presses.SPACING_MM * (len(fem_presses.depth_mm(name)) - 1) / (len(depth) - 1)
    radius = float(name.removeprefix("ball").split("_")[0])
    x, y = centred_grid(depth.shape)
    below = depth.max() - (radius - np.sqrt(np.maximum(radius**2 - (x**2 + y**2) * spacing**2, 0)))
    touched, mask = np.abs(depth - below) < 0.004, find_contact(depth, spacing).mask
    half = depth >= depth.max() / 2
    overlap, by_half = (np.count_nonzero(one & touched) / np.count_nonzero(one | touched) for one in (mask, half))
    assert overlap > max(by_half, 0.8)


def test_untouched_gel_has_no_contact() -> None:
    noise = np.random.default_rng(0).normal(0, 0.004, (240, 320)).astype(np.float32)
    contact = find_contact(noise, 0.05)
    assert (contact.area_mm2, contact.indentation_mm, contact.centroid_mm) == (0.0, 0.0, None)
    assert contact.mask.shape == (240, 320)
    assert contact.mask.dtype == np.bool_
    assert not contact.mask.any()


def test_each_region_is_measured_by_its_own_depth() -> None:
    deep = smooth_cap((240, 320), 60, (-80, 0), height=1.0).depth
    shallow = smooth_cap((240, 320), 60, (80, 0), height=0.1).depth
    contact = find_contact(deep + shallow, 0.05)
    left, right = contact.mask[:, :160], contact.mask[:, 160:]
    assert np.count_nonzero(left) == pytest.approx(np.count_nonzero(right), rel=0.01)
    assert contact.indentation_mm == pytest.approx(1.0, rel=0.01)
    assert contact.centroid_mm == pytest.approx((0, 0), abs=0.01)


def test_what_nothing_touches_is_no_contact_however_deep() -> None:
    deep, shallow = (smooth_cap((240, 320), 60, (x, 0), height=height).depth for x, height in ((-80, 1.0), (80, 0.1)))
    depth = deep + shallow
    contact, touched = find_contact(depth, 0.05), np.zeros(depth.shape, np.bool_)
    touched[120, 240] = True
    felt = without_untouched(contact, touched, depth, 0.05)
    assert not felt.mask[:, :160].any()
    np.testing.assert_array_equal(felt.mask[:, 160:], contact.mask[:, 160:])
    assert felt.indentation_mm == pytest.approx(0.1, rel=0.02)
    assert felt.area_mm2 == pytest.approx(contact.area_mm2 / 2, rel=0.01)
    assert felt.centroid_mm == pytest.approx((80 * 0.05, 0), abs=0.05)
    assert without_untouched(contact, contact.mask, depth, 0.05) is contact
    nowhere = without_untouched(contact, np.zeros_like(touched), depth, 0.05)
    assert (nowhere.area_mm2, nowhere.indentation_mm, nowhere.centroid_mm) == (0.0, 0.0, None)


def test_a_lone_pixel_is_neither_contact_nor_indentation() -> None:
    depth = smooth_cap((240, 320), 60, (0, 0), height=0.5).depth
    spiked = depth.copy()
    spiked[120, 160] = 5.0
    spiked[10, 11] = 5.0
    contact = find_contact(spiked, 0.05)
    clean = find_contact(depth, 0.05)
    assert contact.indentation_mm == pytest.approx(clean.indentation_mm, rel=0.001)
    assert not contact.mask[10, 11]
    assert abs(contact.area_mm2 - clean.area_mm2) <= 0.05**2


def test_the_indentation_of_a_ball_is_low_by_less_than_documented() -> None:
    size, radius = 0.06, 4.0
    for shift in np.linspace(0, 1, 7):
        x, y = centred_grid((80, 80))
        depth = 0.5 - ((x - shift) ** 2 + (y - shift / 2) ** 2) * size**2 / (2 * radius)
        assert 0 <= 0.5 - find_contact(depth, size).indentation_mm <= 1.2501 * size**2 / radius


def test_pixels_of_two_sizes_count_in_area_and_centroid() -> None:
    depth = gaussian((240, 320), 20, (30.0, 40.0), height=0.5).depth
    contact = find_contact(depth, (0.05, 0.1))
    assert contact.area_mm2 == pytest.approx(np.pi * STEEP**2 * 400 * 0.05 * 0.1, rel=0.04)
    assert contact.centroid_mm == pytest.approx((1.5, 4.0), abs=0.02)


def test_a_contact_cut_by_the_border_is_found() -> None:
    depth = gaussian((61, 81), 10, (40.0, 0.0), height=0.5).depth
    contact = find_contact(depth, 0.1)
    assert contact.mask[30, 80]
    assert contact.area_mm2 == pytest.approx(np.pi * STEEP**2 * 100 * 0.01 / 2, rel=0.08)


@pytest.mark.parametrize(("deep_mm", "touched"), [(0.019, False), (0.021, True)])
def test_a_contact_is_deeper_than_the_noise(deep_mm: float, touched: bool) -> None:
    depth = np.zeros((60, 80), np.float32)
    depth[20:40, 20:40] = deep_mm
    assert (find_contact(depth, 0.1).area_mm2 > 0) == touched


def test_of_very_many_patches_a_hundred_are_measured() -> None:
    mask = (np.indices((88, 88)) % 8 < 6).all(axis=0)
    assert len(measure_patches(mask, np.ones((88, 88)), np.zeros((88, 88, 2)), 0.1)) == 100


def test_nan_counts_as_untouched() -> None:
    depth = np.zeros((20, 30), np.float32)
    depth[3, 4] = np.nan
    assert find_contact(depth, 0.1).area_mm2 == 0


@pytest.mark.parametrize(
    ("depth", "size", "threshold", "message"),
    [
        (np.zeros(5), 0.1, 0.02, "shape"),
        (np.zeros((0, 5)), 0.1, 0.02, "shape"),
        (np.zeros((5, 5)), 0.0, 0.02, "pixel size"),
        (np.zeros((5, 5)), (0.1, -1.0), 0.02, "pixel size"),
        (np.zeros((5, 5)), 0.1, 0.0, "threshold_mm = 0.0"),
        (np.zeros((5, 5)), 0.1, float("nan"), "threshold_mm = nan"),
    ],
)
def test_bad_arguments_are_refused(depth: np.ndarray, size: object, threshold: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        find_contact(depth, size, threshold_mm=threshold)  # type: ignore[arg-type]


def test_each_patch_of_a_contact_is_measured_by_closed_forms() -> None:
    """A cone of height h and foot R has the volume pi R^2 h / 3 and the slope h / R everywhere."""
    x, y = centred_grid((240, 320))
    size = (0.05, 0.1)
    depth, gradient = np.zeros((240, 320)), np.zeros((240, 320, 2))
    for (at_x, at_y), foot, height in (((-3.0, 2.0), 2.0, 1.0), ((4.0, -6.0), 3.0, 0.5)):
        from_x, from_y = x * size[0] - at_x, y * size[1] - at_y
        r = np.hypot(from_x, from_y)
        inside = (r < foot) & (r > 0)
        depth[r < foot] = (height * (1 - r / foot))[r < foot]
        for axis, offset in enumerate((from_x, from_y)):
            gradient[..., axis][inside] = (-height / foot * offset / np.maximum(r, 1e-9))[inside]
    deep, shallow = measure_patches(depth > 0, depth, gradient, size)
    for patch, centre, foot, height in ((deep, (-3.0, 2.0), 2.0, 1.0), (shallow, (4.0, -6.0), 3.0, 0.5)):
        assert patch.centroid_mm == pytest.approx(centre, abs=0.01)
        assert patch.depth_mm == pytest.approx(height, rel=0.03)
        assert patch.area_mm2 == pytest.approx(np.pi * foot**2, rel=0.02)
        assert patch.volume_mm3 == pytest.approx(np.pi * foot**2 * height / 3, rel=0.02)
        assert patch.slope_rad == pytest.approx(np.arctan(height / foot))


def test_crumbs_are_no_patch_and_what_has_no_depth_is_left_out() -> None:
    mask = np.zeros((40, 40), np.bool_)
    mask[3:6, 3:8] = True  # 15 pixels
    assert measure_patches(mask, np.ones((40, 40)), np.zeros((40, 40, 2)), 0.1) == []
    mask[6, 3] = True
    assert len(measure_patches(mask, np.ones((40, 40)), np.zeros((40, 40, 2)), 0.1)) == 1
    mask[3:7] = False
    mask[20:30, 20:30] = True
    depth, gradient = np.ones((40, 40)), np.zeros((40, 40, 2))
    depth[20, 20], gradient[21, 21] = np.nan, np.nan
    (patch,) = measure_patches(mask, depth, gradient, 0.1)
    assert (patch.depth_mm, patch.slope_rad) == (1.0, 0.0)
    assert patch.area_mm2 == pytest.approx(1.0)
    assert patch.volume_mm3 == pytest.approx(0.99)


# ---- from frame to frame ----


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
