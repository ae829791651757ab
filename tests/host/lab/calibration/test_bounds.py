"""The bounds by which a calibration decides: what lies just within and what lies just beyond."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import BoardError, BundleError, CameraError, GellightError, InputError
from gellight.frames.frames import CameraFrame
from gellight.lab.calibration import cylinder, lights, preparing
from gellight.lab.calibration.coverage import advice, coverage
from gellight.lab.calibration.cylinder import Imprint
from gellight.lab.calibration.force.fit import fit_force
from gellight.lab.calibration.force.record import ForceReadings
from gellight.lab.calibration.led_check import _refuse as refuse_leds
from gellight.lab.calibration.live_error import LiveError
from gellight.lab.calibration.pressing import corrected_circle
from gellight.lab.calibration.probing import pixel_size
from gellight.lab.calibration.records import LedAnswer, Uniformity
from gellight.lab.calibration.sensing import TouchDetector, check_light, is_dark
from gellight.lab.calibration.untouched import compare_with_reference, foreign_share, wait_steady
from gellight.lab.training.presses import Ball, Press
from gellight.photometric.ring_geometry import RingGeometry

SHAPE = (240, 320)
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.1)
GREY = np.full((*SHAPE, 3), 100, np.uint8)


def refusing(error: type[GellightError], words: str) -> AbstractContextManager[Any]:
    """Expect this error, or none where there are no words."""
    return pytest.raises(error, match=words) if words else nullcontext()


def frame(image: np.ndarray) -> CameraFrame:
    return CameraFrame(image=image, time_s=0.0, sequence=0)


@pytest.mark.parametrize(
    ("noise_grey", "change_grey", "blocks", "free"),
    [
        (0.5, 1.49, 8, True), (0.5, 1.51, 8, False), (0.5, -1.49, 8, True), (0.5, -1.51, 8, False),
        (4.0, 5.99, 8, True), (4.0, 6.01, 8, False), (0.5, 9.0, 7, True),
    ],
)  # fmt: skip
def test_a_touch_is_a_change_of_six_sigmas_on_a_share_of_15_in_ten_thousand(
    noise_grey: float, change_grey: float, blocks: int, free: bool
) -> None:
    """Of 4800 blocks 7.2; blocks of 16 pixels have a quarter of the noise, and less than 1.5 is never seen."""
    reference = GREY.astype(np.float32)
    reference[100:104, 100 : 100 + 4 * blocks] -= change_grey
    assert TouchDetector(reference, noise_grey).look(frame(GREY)).free is free


@pytest.mark.parametrize(("step_grey", "still"), [(5, True), (6, False)])
def test_what_moves_changes_by_half_as_much_again_as_a_touch(step_grey: int, still: bool) -> None:
    """6 x 2.6 / 4 x 1.5 = 5.85."""
    detector, later = TouchDetector(GREY.astype(np.float32), 2.6), GREY.copy()
    later[100:104, 100:132] += np.uint8(step_grey)
    detector.look(frame(GREY))
    assert detector.look(frame(later)).still is still


@pytest.mark.parametrize(("pixels", "refused"), [(153, False), (154, True)])
def test_two_thousandths_of_a_picture_may_be_clipped(pixels: int, refused: bool) -> None:
    image = GREY.copy()
    image.reshape(-1, 3)[:pixels, 1] = 255
    with refusing(InputError, "clipped at 255" if refused else ""):
        check_light(image, "the press")
    with refusing(InputError, "the press is dark"):
        check_light(np.full_like(image, 3), "the press")


@pytest.mark.parametrize(("rows", "grey", "dark"), [(30, 11, True), (30, 12, False), (20, 200, True)])
def test_a_picture_is_dark_whose_brightest_tenth_is_darker_than_12(rows: int, grey: int, dark: bool) -> None:
    image = np.full((*SHAPE, 3), 2, np.uint8)
    image[:rows, :, 2] = grey
    assert is_dark(image) is dark


@pytest.mark.parametrize(("grey", "foreign"), [(3.6, False), (4.4, True)])
def test_what_is_four_grey_levels_off_smooth_light_is_foreign(grey: float, foreign: bool) -> None:
    image = np.full((*SHAPE, 3), 120, np.float32)
    image[96:128, 160:192] += grey
    assert (foreign_share(image) > 0) is foreign


def run_on(images: Any, reference: np.ndarray = GREY) -> Any:
    """A run whose camera gives these pictures in turn, the last one again and again."""
    pictures = list(images)
    run = Mock()
    run.frame = lambda: frame(pictures.pop(0) if len(pictures) > 1 else pictures[0])
    run.folder.reference = lambda: reference.astype(np.float32)
    run.folder.figures = lambda kind: SimpleNamespace(noise_grey=1.0)
    return run


@pytest.mark.parametrize(("off_grey", "refused"), [(2.95, False), (3.05, True), (-3.05, True)])
def test_the_light_may_come_back_three_grey_levels_off(off_grey: float, refused: bool) -> None:
    with refusing(BundleError, r"3\.[01] grey levels away" if refused else ""):
        compare_with_reference(run_on([GREY], GREY - np.float32(off_grey)))


@pytest.mark.parametrize(("pixels", "frames"), [(24, 24), (26, 42)])
def test_light_is_steady_that_drifts_by_less_than_a_quarter_of_a_grey_level_in_12_frames(
    pixels: int, frames: int
) -> None:
    """Each of the first 30 frames is brighter by a grey level in so many of the 1200 pixels that are looked at."""
    bright = np.arange(1200).reshape(30, 40)
    images = [100 + ((bright < pixels * n).astype(np.uint8)) for n in range(31)]
    pictures = [np.repeat(np.repeat(one, 8, axis=0), 8, axis=1)[..., None].repeat(3, axis=2) for one in images]
    found = wait_steady(run_on(pictures))
    assert found.drift_grey < 0.25
    assert (found.warm_up_frames == 24) is (frames == 24)


def test_light_that_never_becomes_steady_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gellight.lab.calibration.untouched.LONGEST_WAIT_FRAMES", 30)
    with pytest.raises(CameraError, match="still drifts"):
        wait_steady(run_on([GREY + np.uint8(n) for n in range(40)]))


@pytest.mark.parametrize(
    ("seen_grey", "name", "value"),
    [
        (186.0, None, 0.0),
        (214.0, None, 0.0),
        (184.0, "gain", 200 / 184),
        (216.0, "exposure_us", 7000.0),
        (253.0, "exposure_us", 6000.0),
        (255.0, "exposure_us", 4000.0),
        (100.0, "exposure_us", 16_000.0),
        (10.0, "exposure_us", 20_000.0),
    ],
    ids=["dim enough", "bright enough", "dim", "bright", "not clipped", "clipped", "half", "as long as it can be"],
)
def test_the_exposure_is_set_in_whole_pulses_and_then_the_gain(
    seen_grey: float, name: str | None, value: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From 8 ms, 100 us to 20 ms being possible."""
    monkeypatch.setattr(preparing, "_brightest", lambda run: seen_grey)
    ranges, now = {"exposure_us": (100.0, 20_000.0, 1.0), "gain": (1.0, 8.0, 0.1)}, {"exposure_us": 8000.0, "gain": 1.0}
    controls = Mock(names=lambda: list(now), range=ranges.get, read=now.get)
    preparing._expose(Mock(), controls)
    set_first = controls.set.call_args_list[0].args if controls.set.called else (None, 0.0)
    assert set_first == (name, pytest.approx(value))


@pytest.mark.parametrize(
    ("brightest_grey", "words"), [(149.9, "the gel is dim"), (150.1, ""), (229.9, ""), (230.1, "the gel is bright")]
)
def test_the_brightest_colour_reaches_150_to_230(brightest_grey: float, words: str) -> None:
    dark, lit = (Uniformity(mean_grey=10, sigma_grey=1, brightest_grey=grey) for grey in (20.0, brightest_grey))
    assert preparing._advice({"red": dark, "green": lit, "blue": dark})[: len(words) or None] == words


def imprint(radius_x: float, radius_y: float, scatter: float = 0.1, x: float = 160.0) -> Imprint:
    return Imprint(center_x_px=x, center_y_px=120.0, radius_x_px=radius_x, radius_y_px=radius_y, scatter_px=scatter,
                   edge_px=np.zeros((1, 2)))  # fmt: skip


@pytest.mark.parametrize(
    ("found", "refusal"),
    [
        ([imprint(36, 36 * 1.0058)] * 2, ""),
        ([imprint(36, 36 * 1.0062)] * 2, r"0\.11111 mm wide and 0\.11043 mm high"),
        ([imprint(36 * 1.0062, 36)] * 2, "mm high"),
        ([imprint(36, 36), imprint(36.5, 36.5)], ""),
        ([imprint(36, 36), imprint(36.52, 36.52)], "a spread of 0.7 px between its presses"),
    ],
    ids=["square", "high", "wide", "alike", "spread"],
)
def test_pixels_may_be_six_thousandths_from_square_and_presses_a_hundredth_apart(
    found: list[Imprint], refusal: str
) -> None:
    with refusing(BundleError, refusal):
        pixel_size(found, 8.0)


@pytest.mark.parametrize(
    ("found", "refusal"),
    [
        (imprint(36, 36, 1.07), ""),
        (imprint(36, 36, 1.09), "the edge scatters by"),
        (imprint(36, 36, x=36.1), ""),
        (imprint(36, 36, x=35.9), "leaves the picture"),
        (imprint(36, 36, x=282.9), ""),
        (imprint(36, 36, x=283.1), "leaves the picture"),
    ],
)
def test_an_edge_scatters_by_three_hundredths_of_its_radius_and_lies_in_the_picture(
    found: Imprint, refusal: str
) -> None:
    with refusing(InputError, refusal):
        cylinder._check(found, SHAPE)


@pytest.mark.parametrize(
    ("usual", "one", "refusal"),
    [
        ((10.0, 10.0, 10.0), 6.1, ""),
        ((10.0, 10.0, 10.0), 5.9, "LED 1 is far weaker than the others: clean it, or replace it"),
        ((10.0, 10.0, 10.0), 1.51, "LED 1 is far weaker"),
        ((10.0, 10.0, 10.0), 1.49, "LED 1 stays dark: check its solder joints, or replace it"),
        ((10.0, 100.0, 10.0), 2.1, "LED 1 is far weaker"),
        ((10.0, 100.0, 10.0), 1.9, "LED 1 stays dark"),
        ((1.0, 1.0, 1.0), 0.31, "LED 1 is far weaker"),
        ((1.0, 1.0, 1.0), 0.29, "LED 1 stays dark"),
    ],
)
def test_an_led_that_gives_little_is_weak_or_dead(usual: tuple[float, ...], one: float, refusal: str) -> None:
    grey = np.repeat(usual, 4)
    grey[1] = one
    answers = [
        LedAnswer(led=led, colour=colour, grey=float(grey[led]), seen_colour=colour, azimuth_deg=0.0)
        for led, colour in enumerate("RRRRGGGGBBBB")
    ]
    with refusing(BoardError, refusal):
        refuse_leds(answers)


@pytest.mark.parametrize(("steepest_deg", "deeper"), [(24.9, True), (25.1, False)])
def test_slopes_of_25_degrees_are_wanted(steepest_deg: float, deeper: bool) -> None:
    presses = [
        Press(image=Path(), center_x_px=x, center_y_px=y, contact_radius_px=30.0)
        for x in range(10, 320, 30) for y in range(10, 240, 30)
    ]  # fmt: skip
    found = coverage(presses, BALL, SHAPE).model_copy(update={"steepest_deg": steepest_deg})
    assert advice(found, 50, 50, settled=True).startswith("press deeper") is deeper
    assert advice(coverage([], BALL, SHAPE), 2, 50, settled=False) == "48 more presses anywhere"
    assert "empty" in advice(coverage(presses[:3], BALL, SHAPE), 3, 50, settled=False)


@pytest.mark.parametrize(
    ("usual", "one", "count", "out"),
    [(1.0, 4.9, 10, []), (1.0, 5.1, 10, [0]), (3.0, 8.9, 10, []), (3.0, 9.1, 10, [0]), (3.0, 99.0, 9, [])],
)
def test_a_press_is_contradicted_that_is_worse_by_three_times_and_by_four_degrees(
    usual: float, one: float, count: int, out: list[int]
) -> None:
    live = LiveError(GREY.astype(np.float32), BALL)
    live.by_press = dict(enumerate([one, *[usual] * (count - 1)]))
    assert live.outliers() == out


@pytest.mark.parametrize(("last", "count", "settled"), [(0.951, 12, True), (0.949, 12, False), (0.951, 11, False)])
def test_the_error_has_settled_that_fell_by_less_than_a_twentieth_in_eight_presses(
    last: float, count: int, settled: bool
) -> None:
    live = LiveError(GREY.astype(np.float32), BALL)
    live.history = list(enumerate([*[1.0] * 4, *[0.97] * (count - 8), *[last] * 4]))
    assert live.settled() is settled


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        ({"contact_radius_px": 39.9}, ""),
        ({"contact_radius_px": 40.1}, "is it a ball of 4 mm"),
        ({"contact_radius_px": 6.01}, ""),
        ({"contact_radius_px": 5.99}, "too shallow"),
        ({"center_x_px": 0.0, "center_y_px": 239.0}, ""),
        ({"center_x_px": -0.1}, "off the picture"),
        ({"center_x_px": 319.1}, "off the picture"),
        ({"center_y_px": 239.1}, "off the picture"),
    ],
)
def test_a_circle_that_no_press_of_the_ball_makes_is_refused(changes: dict[str, float], refusal: str) -> None:
    numbers = {"center_x_px": 100.0, "center_y_px": 80.0, "contact_radius_px": 20.0, **changes}
    with refusing(InputError, refusal):
        assert corrected_circle(numbers, BALL, SHAPE).model_dump() == numbers


@pytest.mark.parametrize(
    ("radius", "height", "taken"), [(1.09, 0.91, True), (1.11, 1.0, False), (0.89, 1.0, False), (1.0, 1.11, False)]
)
def test_a_ring_stands_within_a_tenth_of_where_the_settings_have_it(
    radius: float, height: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = RingGeometry()
    found = SimpleNamespace(ring_radius_mm=radius * told.ring_radius_mm, height_mm=height * told.height_mm)
    model, run = SimpleNamespace(ring=told), Mock()
    run.folder.figures.return_value = SimpleNamespace(led=[[0, 0, 0]])
    monkeypatch.setattr(lights, "take_lights", lambda *how: model)
    monkeypatch.setattr(lights, "fit_ring", lambda *how: SimpleNamespace(ring=found))
    monkeypatch.setattr(lights, "ball_of", lambda run: BALL)
    with refusing(BundleError, "" if taken else "it falls off as that of LEDs"):
        assert lights._measured(run) is model


@pytest.mark.parametrize(
    ("force", "felt", "refusal"),
    [
        ([0.39, 1, 1.5, 2], [0, 5, 7.5, 10], ""),
        ([0.41, 1, 1.5, 2], [0, 5, 7.5, 10], "nothing is felt in 1 of 4"),
        ([1, 1.2, 1.45], [5.1, 5.0, 4.9], ""),
        ([1, 1.2, 1.55], [5.1, 5.0, 4.9], "do not rise together"),
        ([1, 1.29], [5, 6], "2 readings in contact"),
        ([1, 1, 1, 1], [3.8, 6.2, 3.8, 6.2], ""),
        ([1, 1, 1, 1], [3.3, 6.7, 3.3, 6.7], "one modulus leaves 32%"),
    ],
    ids=["light and unfelt", "unfelt", "of one force", "falling", "two", "scattered", "too scattered"],
)
def test_forces_are_explained_or_refused(force: list[float], felt: list[float], refusal: str) -> None:
    with refusing(InputError, refusal):
        assert fit_force(np.array(force), np.array(felt), "record").readings == sum(value > 0 for value in felt)


@pytest.mark.parametrize(
    ("force", "felt", "floor_n"),
    [([0.099, 0.5, 0.5, 0.5], [0.5, 2.5, 2.5, 2.5], 0.001), ([0.101, 0.5, 0.5, 0.5], [0.5, 2.5, 2.5, 2.5], None)],
)
def test_readings_below_a_fifth_of_the_heaviest_tell_the_floor_of_the_error(
    force: list[float], felt: list[float], floor_n: float | None
) -> None:
    fit = fit_force(np.array(force), np.array(felt), "record")
    assert fit.error_floor_n == pytest.approx(floor_n or fit.error_floor_n, rel=0.3)
    assert (fit.error_share > 0.0501) is (floor_n is None)


@pytest.mark.parametrize(("least_n", "refused"), [(-0.049, False), (-0.051, True)])
def test_a_load_cell_may_read_a_twentieth_below_zero(least_n: float, refused: bool, tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(f"unix_s,force_n\n1,1\n2,{least_n}\n")
    with refusing(InputError, "set the load cell to zero" if refused else ""):
        assert ForceReadings.read(tmp_path / "f.csv").force_n.tolist() == [1.0, least_n]
