"""Marker dots: found, filled with the gel around them, followed by name, and unknown where they are unknown."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frames.dot_following import DotFollower
from gellight.frames.dot_places import border_px, dots_at_rest, find_spots
from gellight.frames.dots import find_dots
from gellight.frames.image_files import read_image
from gellight.frames.shear import DotsSeen, Unseen
from tests.helpers.dotted import DOT_PX, with_dots
from tests.helpers.places import of_real, real, real_picture

WIDTH, HEIGHT, PITCH, DIAMETER = 320, 240, 24.0, 9.0
Lattice = np.ndarray


def gel(noise: float = 1.0) -> np.ndarray:
    """A smooth, coloured gel with the noise of a camera."""
    rows, columns = np.indices((120, 160))
    smooth = np.stack([100 + 0.5 * columns, 150 - 0.4 * rows, 90 + 0.3 * rows + 0.2 * columns], axis=2)
    return np.asarray(np.rint(smooth + np.random.default_rng(0).normal(0, noise, smooth.shape)), np.uint8)


def test_dots_are_found_and_filled_with_the_gel_around_them() -> None:
    untouched = with_dots(gel())
    dots = find_dots(untouched)
    assert dots.diameter_px == pytest.approx(DOT_PX, abs=1.2)
    assert dots.count >= 63  # 70 are whole
    # In another picture they lie elsewhere.
    moved = with_dots(gel(), shift=(5.0, 3.0))
    error = np.abs(dots.filled(moved).astype(float) - gel(0.0))
    assert np.abs(moved.astype(float) - gel(0.0)).max() > 100
    assert error.max() < 10
    hidden = dots.mask(moved)
    assert 0.04 < hidden.mean() < 0.25
    np.testing.assert_array_equal(dots.filled(moved)[~hidden], moved[~hidden])


@pytest.mark.parametrize("width", [640, 960, 1600, 3280])
def test_dots_are_found_at_every_size_of_a_camera(width: int) -> None:
    untouched = cv2.resize(gel(0.0), (width, width * 3 // 4))
    printed, scale = untouched.copy(), width / 640
    for x, y in np.stack(np.meshgrid(np.arange(48, 640, 68), np.arange(36, 480, 68)), axis=-1).reshape(-1, 2):
        cv2.circle(printed, (round(x * scale), round(y * scale)), round(7 * scale), (40, 40, 40), -1, cv2.LINE_AA)
    printed = cv2.GaussianBlur(printed, (0, 0), 0.8 * scale)
    dots = find_dots(printed)
    assert dots.diameter_px == pytest.approx(14 * scale, rel=0.15)
    assert len(dots.places_px) == dots.count == 63
    assert np.abs(dots.filled(printed).astype(float) - untouched).max() < 12


def test_a_gel_without_dots_has_none() -> None:
    assert find_dots(gel()) is None
    assert find_dots(load_bundle("synthetic").reference) is None
    dirty = gel()
    for x, y in ((20, 30), (90, 50), (130, 100)):
        cv2.circle(dirty, (x, y), 3, (20, 20, 20), -1)
    assert find_dots(dirty) is None


@pytest.mark.parametrize(
    "name",
    [
        "ninedtact/1_view.png",
        "ninedtact/2_upright_untouched.png",
        "three_lights/untouched.png",
        *map(of_real, ("gelsight_mini_ball/background.png", "digit_ball/background.png")),
    ],
)
def test_real_gels_without_dots_have_none(name: str) -> None:
    assert find_dots(read_image(real_picture(name))) is None


@pytest.mark.real_images("dots")
def test_the_dots_of_a_real_gel_are_found() -> None:
    dots = find_dots(read_image(real("dots") / "bg-0.jpg"))
    assert dots.count > 126  # 140 on the gel, some more in the mirror below it


def square(columns: int = 9, rows: int = 7) -> Lattice:
    x, y = ((np.arange(n) - (n - 1) / 2) * PITCH for n in (columns, rows))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) + np.array([WIDTH / 2 + 0.3, HEIGHT / 2 - 0.2])


def scattered() -> Lattice:
    rng, places = np.random.default_rng(3), np.zeros((0, 2))
    while len(places) < 55:
        tried = rng.uniform((25, 25), (WIDTH - 25, HEIGHT - 25))
        if not len(places) or np.hypot(*(places - tried).T).min() > 0.75 * PITCH:
            places = np.vstack([places, tried])
    return np.asarray(places)


def picture(places: Lattice, bright: float = 150.0, seed: int = 0) -> np.ndarray:
    """A gel that is brighter on the right, with dots, and the noise of a camera."""
    rows, columns = np.indices((HEIGHT, WIDTH))
    grey = np.repeat((bright * (0.7 + 0.3 * columns / WIDTH))[..., None], 3, axis=2) * [1.0, 0.8, 0.6]
    for x, y in places:
        (top, bottom), (left, right) = ([max(round(at + by), 0) for by in (-DIAMETER, DIAMETER)] for at in (y, x))
        around = np.s_[top : bottom + 1, left : right + 1]
        inside = np.clip(DIAMETER / 2 - np.hypot(columns[around] - x, rows[around] - y) + 0.5, 0, 1)
        grey[around] *= (1 - 0.65 * inside)[..., None]
    noisy = grey + np.random.default_rng(seed).normal(0, 1, grey.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def carried(places: Lattice, by: tuple[float, float], reach: float = 2.0) -> Lattice:
    """Where a gel has its dots whose middle is moved by so many pitches, less and less `reach` pitches around it."""
    away = (places - [WIDTH / 2 + 10, HEIGHT / 2 + 5]) / PITCH / reach
    return np.asarray(places + np.exp(-(np.square(np.hypot(*away.T)) ** 1.5))[:, None] * np.array(by) * PITCH)


def followed(rest: Lattice, *pictures: np.ndarray) -> tuple[list[DotsSeen], np.ndarray]:
    """What is seen in each picture, and the number of each dot of `rest` among the names."""
    untouched = picture(rest)
    places, darkness = dots_at_rest(untouched, DIAMETER)
    assert len(places) == len(rest)
    follower = DotFollower(places, DIAMETER, darkness)
    number = np.hypot(*np.moveaxis(rest[:, None] - places[None], 2, 0)).argmin(axis=1)
    assert sorted(number) == list(range(len(rest)))
    return [follower.follow(one) for one in (untouched, *pictures)], number


@pytest.mark.parametrize("lattice", [square, scattered, lambda: square(7, 5), lambda: square(11, 7)])
def test_dots_of_any_lattice_keep_their_names_as_the_gel_is_dragged(lattice: Callable[[], Lattice]) -> None:
    rest = lattice()
    true = [carried(rest, (share, -0.3 * share)) for share in np.linspace(0.1, 0.8, 5)]
    seen, number = followed(rest, *(picture(places, seed=9) for places in true))
    for found, places in zip(seen[1:], true, strict=True):
        assert found.seen.all()
        assert not found.problem
        error = np.hypot(*(found.places_px[number] - places).T)
        assert np.percentile(error, 95) < 0.1


@pytest.mark.parametrize("by", [(0.7, 0.0), (-0.6, 0.4), (0.1, -0.8), (0.55, 0.55), (0.95, 0.0)])
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_a_jump_of_more_than_half_a_pitch_swaps_no_names(by: tuple[float, float], missing: float) -> None:
    rest = square()
    there = np.random.default_rng(4).random(len(rest)) >= missing
    true = carried(rest, by, reach=2.5)
    (_, away, back), number = followed(rest, picture(true[there]), picture(rest[there]))
    for found, places in ((away, true), (back, rest)):
        np.testing.assert_array_equal(found.seen[number], there)
        assert np.hypot(*(found.places_px[number] - places)[there].T).max() < 0.2
        assert np.hypot(*(found.places_px[number] - places).T).max() < 0.35 * PITCH


def test_a_dot_that_goes_and_comes_back_has_its_name_and_two_that_touch_are_not_told_apart() -> None:
    rest, hidden = square(), np.arange(63) != 31
    (_, without, again), number = followed(rest, picture(rest[hidden]), picture(rest))
    assert without.reasons[number[31]] == Unseen.MISSING
    assert without.seen.sum() == 62
    assert again.seen.all()
    rest = square()
    true = rest.copy()
    true[31] = true[32] + [-0.45 * DIAMETER, 0]
    (_, found), number = followed(rest, picture(true))
    assert (~found.seen).sum() <= 2
    assert not found.seen[number[31]]


def test_a_dot_that_leaves_the_picture_is_beyond_the_view() -> None:
    rest = square(13, 7)
    rest[:, 0] += WIDTH / 2 - 10 - rest[:, 0].max() + WIDTH / 2 - 6
    true = rest + np.array([8.0, 0.0])
    (_, found), number = followed(rest, picture(true))
    last = number[rest[:, 0] == rest[:, 0].max()]
    assert set(found.reasons[last].tolist()) == {Unseen.BEYOND_VIEW}
    assert not found.problem


def test_dots_that_come_in_at_the_border_are_of_no_other_gel() -> None:
    """At rest they were too near to it, and they are a fifth of those that were seen."""
    whole = np.stack(np.meshgrid(np.arange(5.0, WIDTH, PITCH), np.arange(5.0, HEIGHT, PITCH)), axis=-1).reshape(-1, 2)
    inner = ((whole > PITCH / 2) & (whole < np.array([WIDTH, HEIGHT]) - PITCH / 2)).all(axis=1)
    (*_, found), number = followed(whole[inner], picture(whole + 4.0), picture(whole + 8.0))
    assert not found.problem
    there = found.seen[number]
    assert there.sum() > 0.8 * inner.sum()
    assert np.hypot(*(found.places_px[number] - whole[inner] - 8.0)[there].T).max() < 0.2


@pytest.mark.parametrize("diameter", [8.0, 9.0, 11.0, 13.0, 17.0])
def test_a_dot_that_is_no_nearer_to_the_border_than_that_is_found(
    diameter: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So what is not found there is missing, and what is nearer may be beyond."""
    monkeypatch.setitem(globals(), "DIAMETER", diameter)
    border, y = border_px(diameter), HEIGHT / 2
    found = {by: len(find_spots(picture(np.array([[by, y]])), diameter, 0.3).places_px) for by in range(WIDTH // 2)}
    assert all(found[by] for by in range(border, WIDTH // 2))
    assert not any(found[by] for by in range(border // 2))
    assert border < 1.3 * diameter


def test_a_dark_frame_says_so_and_the_next_one_goes_on() -> None:
    rest = square()
    true = carried(rest, (0.3, 0.0))
    (_, dark, again), number = followed(rest, picture(rest, bright=6.0), picture(true))
    assert "too dark" in dark.problem
    assert set(dark.reasons.tolist()) <= {Unseen.SEEN, Unseen.DARK}
    assert again.seen.all()
    assert np.hypot(*(again.places_px[number] - true).T).max() < 0.2


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (picture(np.zeros((0, 2))), "0 of 63 marker dots are seen"),
        (picture(square()[:31]), "31 of 63 marker dots are seen"),
        (picture(square(11, 9)), "another gel"),
        (picture(carried(square() * [0.8, 0.8] + [30, 22], (0, 0))), "another gel"),
        (picture(square(7, 9)), "the picture is turned"),
    ],
)
def test_another_gel_is_named_in_one_sentence(other: np.ndarray, reason: str) -> None:
    places, darkness = dots_at_rest(picture(square()), DIAMETER)
    follower = DotFollower(places, DIAMETER, darkness)
    for _ in range(3):
        found = follower.follow(other)
        assert reason in found.problem
    assert ". " not in found.problem


def problem(shown: np.ndarray, *, known: bool) -> str:
    """What is said of a picture; known: the dots were seen at rest before."""
    follower = DotFollower(*dots_at_rest(picture(square()), DIAMETER)[:1], DIAMETER, 0.6)
    if known:
        follower.follow(picture(square()))
    return follower.follow(shown).problem


def aside(share: float) -> Lattice:
    """The dots of `square`, moved by that share of their distance."""
    return square() + np.array([share * PITCH, 0.0])


def with_more(count: int) -> Lattice:
    """The dots of `square`, and more beside them."""
    rows = square()[::9, 1]
    more = [(x, y) for x in (40.0, 281.0) for y in rows]
    return np.vstack([square(), more[:count]])


@pytest.mark.parametrize(
    ("within", "beyond", "known", "reason"),
    [
        (picture(square()[:38]), picture(square()[:37]), True, "37 of 63 marker dots are seen"),
        (picture(with_more(3)), picture(with_more(4)), False, "67 marker dots are seen, of which 63"),
        (picture(with_more(9)), picture(with_more(10)), True, "73 marker dots are seen, of which 63"),
        (picture(aside(0.14)), picture(aside(0.16)), False, "in the median by 0.16"),
    ],
    ids=["three in five", "one in twenty more", "three in twenty more", "0.15 of their distance"],
)
def test_where_dots_cease_to_be_those_of_the_calibration(
    within: np.ndarray, beyond: np.ndarray, known: bool, reason: str
) -> None:
    assert problem(within, known=known) == ""
    assert reason in problem(beyond, known=known)


@pytest.mark.parametrize(("bright", "dark"), [(11, True), (12, False)])
def test_a_gel_darker_than_12_grey_levels_is_too_dark(bright: int, dark: bool) -> None:
    assert ("too dark" in problem(np.full((HEIGHT, WIDTH, 3), bright, np.uint8), known=True)) == dark


def test_nine_dots_are_enough_to_be_followed() -> None:
    assert len(dots_at_rest(picture(square()[:9]), DIAMETER)[0]) == 9
    with pytest.raises(InputError, match="8 marker dots are seen"):
        dots_at_rest(picture(square()[:8]), DIAMETER)


@pytest.mark.parametrize(("count", "darker", "found"), [(8, 60, 0), (9, 60, 9), (12, 10, 0), (12, 11, 12)])
def test_dots_are_nine_at_least_and_more_than_ten_grey_levels_darker(count: int, darker: int, found: int) -> None:
    flat = np.full((HEIGHT, WIDTH, 3), 150, np.uint8)
    for number in range(count):
        cv2.circle(flat, (40 + 60 * (number % 4), 40 + 60 * (number // 4)), 5, (150 - darker,) * 3, -1)
    dots = find_dots(flat)
    assert (dots.count if dots else 0) == found
