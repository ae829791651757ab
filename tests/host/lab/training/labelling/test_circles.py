"""Contact circles without clicks: found to a fraction of a pixel and known how well, or refused with the reason."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.image_files import read_image
from gellight.lab.report.pictures import write_png
from gellight.lab.training.labelling import circle
from gellight.lab.training.labelling.circle import ARC, PressCircle, find_circle
from gellight.lab.training.labelling.detection import Detection, _refused_touch_of_reference
from gellight.lab.training.labelling.pattern import (
    Array,
    PressShape,
    free_response,
    jacobian,
    profile,
    response,
    sampled_around,
    standard_errors,
)
from gellight.lab.training.labelling.pixel_ratio import PixelRatio, pixel_ratio
from gellight.lab.training.presses import Ball, Press
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters
from sim_reference.surface import press_object, sample
from tests.benchmarks.measured_response import MeasuredResponse
from tests.helpers.derivatives import slope
from tests.helpers.places import REAL_CROPS, real

SHAPE = (200, 260)
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.1)
LIGHTS = np.array([[90.0, 0.0], [-45.0, 78.0], [-45.0, -78.0]])
"""(3, 2) grey levels per component of the normal: three lights 120 degrees apart"""


def reference() -> np.ndarray:
    y, x = np.indices(SHAPE) / 200
    return np.stack([110 + 20 * x, 120 - 15 * y, 115 + 10 * x * y], axis=2)


def photograph(*places: tuple[float, float, float], noise: float = 1.0, strength: float = 1.0) -> np.ndarray:
    """A picture of balls pressed at (x, y) with a contact radius, px."""
    y, x = (axis.ravel().astype(float) for axis in np.indices(SHAPE))
    colour = np.zeros((x.size, 3))
    for place in places:
        shape = PressShape(center_x=place[0], center_y=place[1], contact_radius=place[2], skirt_length=20.0)
        colour += strength * response(x, y, shape, BALL.radius_px)[:, :3] @ np.vstack([LIGHTS.T, [-30, -20, -25]])
    image = reference() + colour.reshape(*SHAPE, 3) + np.random.default_rng(0).normal(0, noise, (*SHAPE, 3))
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("place", [(130.3, 100.7, 24.0), (60.0, 140.2, 30.5), (200.9, 70.0, 16.0)])
def test_the_circle_is_found_to_a_fraction_of_a_pixel(place: tuple[float, float, float]) -> None:
    circle = find_circle(photograph(place), reference(), ball=BALL)
    assert np.hypot(circle.center_x_px - place[0], circle.center_y_px - place[1]) < 0.3
    assert circle.contact_radius_px == pytest.approx(place[2], abs=0.6)
    assert circle.quality > 0.95


@pytest.mark.parametrize("height", [1.0, 1.08, 0.97])
def test_pixels_that_are_not_square_show_by_how_much(height: float, tmp_path: Path) -> None:
    """Lines of a picture are made fewer: each pixel is higher by as much."""
    places = [(130.3, 100.7, 24.0), (60.0, 140.2, 30.5), (200.9, 70.0, 16.0), (90.0, 60.0, 27.0)]
    lines = round(SHAPE[0] / height)
    height = SHAPE[0] / lines
    presses = []
    for number, (x, y, radius) in enumerate(places):
        flat = cv2.resize(photograph((x, y, radius)), (SHAPE[1], lines), interpolation=cv2.INTER_AREA)
        write_png(tmp_path / f"{number}.png", flat)
        at = {"center_x_px": x, "center_y_px": (y + 0.5) / height - 0.5, "contact_radius_px": radius}
        presses.append(Press(image=tmp_path / f"{number}.png", **at))
    flat = cv2.resize(reference(), (SHAPE[1], lines), interpolation=cv2.INTER_AREA).astype(np.float32)
    found = pixel_ratio(presses, flat, BALL)
    assert found is not None
    assert found.ratio == pytest.approx(height, abs=0.01)
    assert bool(found.remedy((lines, SHAPE[1]))) is (height > 1.05)
    assert pixel_ratio(presses[:3], flat, BALL) is None


def test_square_pixels_are_called_so_within_what_presses_tell() -> None:
    for ratio, error, square in ((1.029, 0.001, True), (1.031, 0.001, False), (0.9, 0.026, True), (0.9, 0.024, False)):
        assert bool(PixelRatio(ratio=ratio, error=error).remedy((480, 640))) is not square
    remedy = PixelRatio(ratio=1.0811, error=0.001).remedy((444, 640))
    assert '--corners "-0.5,-0.5 639.5,-0.5 639.5,443.5 -0.5,443.5" --size 640x480' in remedy


ARCS = [(-12.0, 100.3, 30.0), (130.4, -8.0, 26.0), (8.0, 191.0, 28.0), (257.0, 100.0, 24.0)]


@pytest.mark.parametrize("place", ARCS)
def test_an_arc_whose_centre_is_off_the_picture_or_near_its_border_is_found(place: tuple[float, float, float]) -> None:
    circle = find_circle(photograph(place), reference(), ball=BALL, least_view=ARC)
    off = np.hypot(circle.center_x_px - place[0], circle.center_y_px - place[1])
    assert off < min(1.5, 3 * circle.center_error_px)
    assert circle.contact_radius_px == pytest.approx(place[2], abs=min(1.5, 3 * circle.radius_error_px))
    with pytest.raises(InputError, match="off the image"):
        find_circle(photograph(place), reference(), ball=BALL)


def test_less_than_an_arc_and_an_uncertain_one_are_refused() -> None:
    with pytest.raises(InputError, match="at least 25 % are needed: press nearer"):
        find_circle(photograph((-26, 100, 30)), reference(), ball=BALL, least_view=ARC)
    with pytest.raises(InputError, match=r"the circle is uncertain: .* at most 2\.8 px may be"):
        find_circle(photograph((-10, -8, 26)), reference(), ball=BALL, least_view=ARC)


def test_the_slope_is_that_of_the_ball_inside_and_the_depth_is_its_integral() -> None:
    shape = PressShape(center_x=0, center_y=0, contact_radius=25.0)
    r = np.linspace(0, 120, 2401)
    slope, depth = profile(r, shape, 40.0)
    np.testing.assert_allclose(slope[r < 25], r[r < 25] / np.sqrt(1600 - r[r < 25] ** 2))
    np.testing.assert_allclose(-np.gradient(depth, r)[r != 25], slope[r != 25], atol=0.02)


STEEP = PressShape(
    center_x=131.2, center_y=99.4, contact_radius=30.0, step_share=0.7, step_length=3.0, skirt_length=80.0
)


@pytest.mark.parametrize("shape", [PressShape(center_x=129.3, center_y=101.4, contact_radius=20.0), STEEP])
def test_the_derivatives_of_the_fit_are_those_of_finer_differences(shape: PressShape) -> None:
    difference = photograph((130.3, 100.7, 24.0)) - reference()
    residual = free_response(sampled_around(difference, (130, 100), 24.0, BALL.radius_px), BALL.radius_px)
    at = shape.vector()
    differences = [slope(residual, at, one) for one in np.eye(len(at))]
    np.testing.assert_allclose(jacobian(residual, at), differences, atol=1e-3)


REFUSED = {
    "no press": (photograph(), "no press"),
    "too faint": (photograph((130, 100, 24), strength=0.05), "no press"),
    "too shallow": (photograph((130, 100, 5), strength=2), "too shallow"),
    "off the image": (photograph((8, 100, 24)), "off the image"),
    "several presses": (photograph((70, 100, 24), (190, 100, 24)), "several presses"),
    "clipped": (photograph((130, 100, 24), strength=6), "clipped"),
    "dark": (np.zeros((*SHAPE, 3), np.uint8), "dark"),
    "another size": (np.zeros((90, 100, 3), np.uint8), "100 x 90 px, the reference 260 x 200 px.* one camera setting"),
}


@pytest.mark.parametrize(("image", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_usable_press_is_refused_with_the_reason(image: np.ndarray, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        find_circle(image, reference(), ball=BALL)


@pytest.mark.parametrize("light", [0.9, 1.1, np.array([1.1, 1, 0.9])], ids=["darker", "brighter", "of another colour"])
def test_a_press_is_found_by_a_reference_of_another_light(light: float | np.ndarray) -> None:
    found = find_circle(photograph((130, 100, 24)), light * reference(), ball=BALL)
    assert (found.center_x_px, found.center_y_px) == pytest.approx((130, 100), abs=0.3)
    assert found.contact_radius_px == pytest.approx(24, abs=0.6)


def test_light_that_is_too_far_off_is_refused_with_its_size_and_the_remedy() -> None:
    with pytest.raises(InputError, match=r"by up to 4[0-9]%, at most 30% can be taken out: .* same light, or adapt"):
        find_circle(photograph(strength=0.1), 0.7 * reference(), ball=BALL)


def test_an_object_that_is_no_ball_is_refused_and_all_that_may_be_wrong_is_said() -> None:
    image = reference()
    image[60:140, 120:124] += 60
    image[60:64, 120:200] -= 60
    with pytest.raises(InputError, match=r"no single ball.* check its radius and the size of a pixel"):
        find_circle(image.astype(np.uint8), reference(), ball=BALL)


@pytest.mark.real_images("gelsight_mini_ball")
def test_on_a_real_sensor_every_press_is_found_where_a_hand_put_it() -> None:
    folder = real("gelsight_mini_ball")
    ball, untouched = Ball(radius_mm=2.35, pixel_size_mm=0.05107), read_image(folder / "background.png")
    apart = []
    for line in (folder / "presses.csv").read_text().splitlines()[1:]:
        name, x, y, _ = line.split(",")
        circle = find_circle(read_image(folder / name), untouched, ball=ball)
        apart.append(np.hypot(circle.center_x_px - float(x), circle.center_y_px - float(y)))
    assert len(apart) == 33
    assert np.median(apart) < 4
    assert max(apart) < 9


@pytest.mark.real_images("gelslam_ball")
def test_on_a_real_sensor_half_a_circle_is_found_where_the_whole_one_is() -> None:
    folder, ball = real("gelslam_ball"), Ball(radius_mm=3.155, pixel_size_mm=0.0634)
    untouched, apart, told = read_image(folder / "background.png"), [], []
    for number in (1, 5, 9, 13, 16, 21, 25, 29):
        image = read_image(folder / f"{number:04}.png")
        whole = find_circle(image, untouched, ball=ball)
        cut = round(whole.center_x_px)
        seen = np.s_[:, cut:] if cut < image.shape[1] / 2 else np.s_[:, :cut]
        try:
            circle = find_circle(image[seen], untouched[seen], ball=ball, least_view=ARC)
        except InputError as error:
            if "the circle is uncertain" in str(error):
                continue
            raise
        x = circle.center_x_px + (seen[1].start or 0)
        apart.append(np.hypot(x - whole.center_x_px, circle.center_y_px - whole.center_y_px))
        told.append(circle.center_error_px)
    assert len(apart) >= 6
    assert max(apart) < 3.5
    assert (np.array(apart) < 2 * np.array(told)).mean() > 0.7


@pytest.mark.parametrize(("sensor", "x", "y"), [(1, 243, 188), (2, 283, 173)])
def test_it_is_found_under_white_light_too(sensor: int, x: float, y: float) -> None:
    folder = REAL_CROPS / "ninedtact"
    image, untouched = (read_image(folder / f"{sensor}_upright_{name}.png") for name in ("press", "untouched"))
    circle = find_circle(image, untouched, ball=Ball(radius_mm=4.0, pixel_size_mm=0.0505))
    assert np.hypot(circle.center_x_px - x, circle.center_y_px - y) < 5


def test_a_picture_read_from_a_file_has_its_colours_in_order(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), photograph((130, 100, 24))[..., ::-1])
    circle = find_circle(read_image(tmp_path / "a.png"), reference(), ball=BALL)
    assert circle.center_x_px == pytest.approx(130, abs=0.3)


@pytest.mark.parametrize(("press_mm", "x_mm", "y_mm"), [(0.8, 4.0, 2.0), (1.5, 4.0, 2.0), (2.2, 7.0, -4.0)])
def test_a_golf_ball_whose_contact_is_cut_off_is_found(press_mm: float, x_mm: float, y_mm: float) -> None:
    """Radius 21 mm in a view of 16 x 12 mm, by the light of a real sensor; 43 to 67 % of the view are in contact."""
    geometry = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.05, gel_thickness_mm=4.0)
    deformed = press_object(
        "BALL", press_mm, geometry, parameters=ObjectParameters(calibration_ball_radius_mm=21.0)
    )  # fmt: skip
    response, random = MeasuredResponse.read("polycalib"), np.random.default_rng(0)
    surface = sample(deformed, geometry, x_mm, y_mm)
    image, untouched = (response.photograph(one, random, geometry.image_shape) for one in (surface, None))
    circle = find_circle(image, untouched, ball=Ball(radius_mm=21.0, pixel_size_mm=0.05), least_view=ARC)
    apart = np.hypot(circle.center_x_px - x_mm / 0.05 - 159.5, circle.center_y_px - y_mm / 0.05 - 119.5)
    assert apart < max(2 * circle.center_error_px, 3)
    assert circle.center_error_px < 0.07 * 420


def of_a_line(x: Array, values: Array) -> Callable[[Array], Array]:
    """What a straight line leaves of values, the same in each channel."""
    return lambda line: values - (line[0] + line[1] * x)[:, None]


def test_the_errors_are_three_times_those_of_least_squares_and_more_where_the_pixels_of_a_part_are_alike() -> None:
    random, x, parts = np.random.default_rng(0), np.linspace(-1, 1, 4000), np.arange(4000) // 50
    exact = 3 * 0.1 * np.sqrt([1.0, 3.0]) / (3 * 4000) ** 0.5  # the mean of x^2 is 1 / 3
    alone = of_a_line(x, random.normal(0, 0.1, (4000, 3)))
    found = standard_errors(alone, np.zeros(2), np.arange(4000))
    np.testing.assert_allclose(found, exact, rtol=0.05)
    shared = of_a_line(x, np.repeat(random.normal(0, 0.1, (80, 3)), 50, axis=0))
    found = standard_errors(shared, np.zeros(2), parts)
    np.testing.assert_allclose(found, 50**0.5 * exact, rtol=0.2)


@pytest.mark.parametrize(("error_px", "accepted"), [(15.9, True), (16.1, False)])
def test_a_whole_circle_is_known_to_four_tenths_of_the_ball(
    error_px: float, accepted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ball is 40 px in radius."""
    known = PressCircle(
        center_x_px=130, center_y_px=100, contact_radius_px=24, quality=0.9, contrast_grey=9, center_error_px=error_px
    )
    monkeypatch.setattr(
        circle, "fit_circle", lambda *_: (PressShape(center_x=130, center_y=100, contact_radius=24), known)
    )
    monkeypatch.setattr(circle, "_check_rivals", lambda *_: None)
    with nullcontext() if accepted else pytest.raises(InputError, match="uncertain"):
        find_circle(photograph((130, 100, 24)), reference(), ball=BALL)


def found_at(*centres: float, radius_px: float = 30.0) -> list[Detection]:
    circles = [
        PressCircle(center_x_px=x, center_y_px=90, contact_radius_px=radius_px, quality=0.9, contrast_grey=9,
                    center_error_px=0.5, radius_error_px=0.5)
        for x in centres
    ]  # fmt: skip
    return [Detection(image=Path(f"{number}.png"), contact=circle) for number, circle in enumerate(circles)]


@pytest.mark.parametrize(
    ("found", "kept"),
    [
        (found_at(100, 100, 101.9, 98.1, 240), [False] * 4 + [True]),
        (found_at(100, 100, 102.1, 97.9, 240), [True] * 5),
        (found_at(100, 100, 240), [True] * 3),
        (found_at(100, 100, 100, 10, 50, 150, 200), [True] * 7),
        ([*found_at(100, 100), *found_at(100, 100, radius_px=38)], [True] * 4),
    ],
    ids=["most at one place", "two and near ones", "two", "three of seven", "of two depths"],
)
def test_one_circle_in_most_pictures_is_a_touch_of_the_reference(found: list[Detection], kept: list[bool]) -> None:
    judged = _refused_touch_of_reference(found)
    assert [one.contact is not None for one in judged] == kept
    assert all(bool(one.refused) != stays for one, stays in zip(judged, kept, strict=True))
