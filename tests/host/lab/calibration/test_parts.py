"""The parts of the calibration routine, each by itself: light, gel, coverage, live error, ball."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import ConfigError, InputError
from gellight.bundle.limits import Limits
from gellight.frames.frames import CameraFrame
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.coverage import advice, coverage
from gellight.lab.calibration.display import Display
from gellight.lab.calibration.live_error import LiveError
from gellight.lab.calibration.preparing import led_settings, of_image, uniformity
from gellight.lab.calibration.sensing import TouchDetector, wait_free, wait_press
from gellight.lab.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient
from gellight.photometric.ring_geometry import RingGeometry

BALL = Ball(radius_mm=4.0, pixel_size_mm=0.1176)
SHAPE = (240, 320)


def at(x: float, y: float, radius: float = 20.0) -> Press:
    return Press(image=Path(), center_x_px=x, center_y_px=y, contact_radius_px=radius)


def frame(image: np.ndarray) -> CameraFrame:
    return CameraFrame(image=image, time_s=0.0, sequence=0)


def photograph(press: Press, ball: Ball, reference: np.ndarray, seed: int) -> np.ndarray:
    """A matt ball in the contact circle, under a light for each channel that comes from its own side."""
    gradient = np.nan_to_num(sphere_gradient(press, ball, SHAPE))
    lights = np.array([[0.9, 0.0], [-0.45, 0.8], [-0.45, -0.8]])
    upright = 1 / np.sqrt(1 + (gradient**2).sum(axis=2, keepdims=True))
    lit = reference * (1 + gradient @ lights.T * 0.5) * upright
    image = np.where(contact_circle(press, SHAPE)[..., None], lit, reference)
    noise = np.random.default_rng(seed).normal(0, 1, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


REFERENCE = np.full((*SHAPE, 3), 120.0, np.float32)


def test_the_light_of_a_normal_distribution_has_its_figures() -> None:
    found = uniformity(np.random.default_rng(0).normal(159.02, 6.67, (400, 500)).astype(np.float32))
    assert (found.mean_grey, found.sigma_grey) == pytest.approx((159.02, 6.67), rel=0.01)
    assert found.brightest_grey == pytest.approx(159.02 + 2.326 * 6.67, rel=0.01)


def test_the_average_of_opposite_colours_is_evener_than_each() -> None:
    ramp = np.linspace(50, 150, 320, dtype=np.float32)[None, :].repeat(240, axis=0)
    figures = of_image(np.stack([ramp, 200 - ramp, ramp * 0 + 100], axis=2))
    assert figures["average"].sigma_grey < 0.01
    assert figures["red"].sigma_grey == pytest.approx(100 / np.sqrt(12), rel=0.01)


def test_a_touch_is_seen_and_a_change_of_all_the_light_is_not() -> None:
    reference = np.full((*SHAPE, 3), 100, np.float32)
    detector = TouchDetector(reference, 1.0)
    brighter = np.full((*SHAPE, 3), 104, np.uint8)
    assert detector.look(frame(brighter)).free
    brighter[100:130, 100:130] += 10
    assert not detector.look(frame(brighter)).free


def test_the_missing_edge_is_named_with_how_many_presses_it_needs() -> None:
    presses = [at(x, y, 30) for x in range(110, 320, 30) for y in range(10, 240, 30)]
    found = coverage(presses, BALL, SHAPE)
    words = advice(found, len(presses), 100, settled=False)
    empty = sum(count == 0 for row in found.places for count in row[:2])
    assert words.startswith(f"{empty} places are empty on the left edge: about "), "as many as the map shows"
    assert 2 <= int(words.split()[-3]) <= min(empty, 12)


def test_enough_is_enough_when_every_place_is_covered_and_the_error_rests() -> None:
    presses = [at(x, y, 30) for x in range(10, 320, 30) for y in range(10, 240, 30)]
    found = coverage(presses, BALL, SHAPE)
    assert advice(found, 50, 80, settled=True) == "enough"
    assert advice(found, 50, 80, settled=False) == "30 more presses anywhere"


def test_the_live_error_of_a_matt_ball_is_small_and_a_slipped_circle_stands_out() -> None:
    live = LiveError(REFERENCE, BALL)
    places = [(60 + 20 * (i % 10), 60 + 30 * (i // 10)) for i in range(20)]
    for number, (x, y) in enumerate(places):
        press = at(x, y, 18 + number % 5)
        live.add(number, photograph(press, BALL, REFERENCE, number), press)
    live.update()
    assert live.history[-1][1] < 1.5
    assert live.outliers() == []
    wrong = at(places[7][0] + 12, places[7][1], 20)
    live.add(7, photograph(at(*places[7]), BALL, REFERENCE, 7), wrong)
    live.update()
    assert live.outliers() == [7]


def test_the_second_press_says_how_well_the_sensor_feels_and_more_presses_say_when_it_is_enough() -> None:
    live = LiveError(REFERENCE, BALL)
    for number in range(12):
        press = at(80 + 50 * (number % 4), 60 + 50 * (number // 4), 18 + number % 5)
        live.add(number, photograph(press, BALL, REFERENCE, number), press)
        live.update()
    assert [presses for presses, _ in live.history] == list(range(2, 13))
    assert live.history[0][1] < 6, "under a flat answer it would be 22 degrees"
    assert live.history[-1][1] < live.history[0][1]
    worst_um = max(live.depth_um[-3:])
    assert live.reached(worst_um)
    assert not live.reached(0.99 * worst_um), "three presses in a row have to be as good"


@pytest.mark.parametrize("bend", [0.02, 0.05])
def test_the_depth_of_a_press_is_judged_as_its_slopes_say(bend: float) -> None:
    """Slopes that are all too steep by a share make the cap too high by that share: a mean error that is known."""
    press, live = at(160, 120, 24), LiveError(REFERENCE, BALL)
    live.add(0, photograph(press, BALL, REFERENCE, 0), press)
    (one,) = live._learnt.values()
    exact = replace(one, terms=one.slopes)
    _, depth_mm = exact.errors((1 + bend) * np.eye(2), np.arange(2))
    cap_mm = cap_depth_mm(press, BALL, SHAPE)[contact_circle(press, SHAPE)]
    assert depth_mm == pytest.approx(bend * np.abs(cap_mm - cap_mm.mean()).mean(), rel=0.1)


class DarkAtFirst:
    """Stands for a run whose LEDs are dark for some frames, and lit again by the ring itself."""

    hand = None

    def __init__(self, dark: int, *, pressed: bool = False) -> None:
        self.display = Display()
        self.dark, self.taken = dark, 0
        self.lit = np.full((*SHAPE, 3), 100, np.uint8)
        if pressed:
            self.lit[: SHAPE[0] // 3, : SHAPE[1] // 3] = 60

    def frame(self) -> CameraFrame:
        self.taken += 1
        return frame(self.lit if self.taken > self.dark else np.zeros_like(self.lit))


def test_leds_that_are_dark_for_a_while_are_waited_for() -> None:
    run = DarkAtFirst(9)
    wait_free(run, TouchDetector(np.full((*SHAPE, 3), 100, np.float32), 1.0), patience=9)  # type: ignore[arg-type]
    assert run.taken == 9 + 2
    assert run.display.shown.problem == ""


def test_leds_that_stay_dark_are_told() -> None:
    run = DarkAtFirst(10)
    with pytest.raises(InputError, match="the gel is dark: check the LEDs"):
        wait_free(run, TouchDetector(np.full((*SHAPE, 3), 100, np.float32), 1.0), patience=9)  # type: ignore[arg-type]


def test_the_dark_is_no_press() -> None:
    run = DarkAtFirst(20, pressed=True)
    untouched = np.full((*SHAPE, 3), 100, np.float32)
    capture = wait_press(run, TouchDetector(untouched, 1.0), lambda: False)  # type: ignore[arg-type]
    assert capture.image.min() == 60
    assert run.taken == 20 + 1 + 3 + 4, "dark; it moved; three still ones, and four whose mean is taken"


@pytest.mark.parametrize("limit", [float("nan"), -0.01, 0.0])
def test_a_limit_that_no_calibration_could_reach_is_refused(limit: float) -> None:
    with pytest.raises(InputError, match="give a limit greater than 0"):
        Limits(depth_mm=limit)


@pytest.mark.parametrize("colours", ["RGBRGBRGBRGB", "BBBBGGGGRRRR", "RGB", "RGBBBBGR", "RGB" * 8])
def test_a_ring_is_lit_in_the_colours_of_its_design(colours: str) -> None:
    lit = np.rint(RingGeometry(led_colours=colours).colours * (1.0, 0.5, 0.2)).astype(np.uint8)
    assert [led.colour for led in led_settings(lit.tolist())] == list(colours)
    assert {tuple(rgb) for rgb in lit.tolist()} == {(255, 0, 0), (0, 128, 0), (0, 0, 51)}


@pytest.mark.parametrize(
    ("colours", "message"),
    [
        ("RG", "a letter for each LED"),
        ("RRRRRRRRRRRR", "each at least once"),
        ("RRRRGGGGBBBW", "R, G or B"),
        ("RGB" * 9, "a board drives 24 LEDs at most"),
    ],
)
def test_a_ring_that_cannot_be_is_refused(colours: str, message: str) -> None:
    with pytest.raises((InputError, ConfigError), match=message):
        RoutineOptions(out=Path("b"), ring=RingGeometry(led_colours=colours))


def test_the_pictures_that_are_shown_are_a_copy_that_nobody_changes_later() -> None:
    display, picture = Display(), np.zeros((2, 2, 3), np.uint8)
    display.show(gel=picture)
    before, version = display.pictures(), display.shown.version
    display.show(press=picture)
    assert list(before) == ["gel"]
    assert list(display.pictures()) == ["gel", "press"]
    assert display.shown.version == version + 1
