"""Geometry and pixels, light on the gel (Lambert, inverse square, shadows), and from light to grey levels."""

from dataclasses import replace
from math import cos, radians, sin, tan

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from sim_reference.camera import CameraResponse, digitise, expose, exposure_for, linear_grey
from sim_reference.geometry import SensorGeometry, led_axes, led_positions, pixel_grid
from sim_reference.imaging import directional_image, led_irradiance, normals, ring_irradiance, ring_light, visibility
from sim_reference.surface import press_object, sample, untouched

GEOMETRY = SensorGeometry()
SMALL = replace(GEOMETRY, image_width_px=160, image_height_px=120, pixel_size_mm=0.2352)
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_the_ring_is_where_the_paper_puts_it() -> None:
    position, axis = led_positions(GEOMETRY), led_axes(GEOMETRY)
    assert position[:, 2] == pytest.approx(20.0)
    assert np.hypot(position[:, 0], position[:, 1]) == pytest.approx(21.5)
    assert position[3] == pytest.approx([0, -21.5, 20])  # azimuth 90 degrees is up in the image
    assert axis[:, 2] == pytest.approx(-cos(radians(29)))
    assert (position[:, :2] * axis[:, :2]).sum(axis=1) == pytest.approx(-21.5 * sin(radians(29)))
    assert ring_light(GEOMETRY)[[0, 4, 8]] == pytest.approx(np.eye(3))


def test_one_pixel_by_hand() -> None:
    # LED 0 at (21.5, 0, 20), its axis (-sin 29, 0, -cos 29); the pixel at (1.5 mm, 1.5 mm).
    geometry = replace(GEOMETRY, image_width_px=4, image_height_px=4, pixel_size_mm=1.0)
    to_led = np.array([20.0, -1.5, 20.0])
    distance = np.sqrt(to_led @ to_led)
    leaving = (20 * sin(radians(29)) + 20 * cos(radians(29))) / distance
    expected = leaving * 20 / distance * 400 / distance**2
    assert led_irradiance(untouched(geometry), geometry, 0)[3, 3] == pytest.approx(expected, rel=1e-12)


def test_light_falls_with_the_square_of_the_distance() -> None:
    # Twice as far in every direction: the same angles, a quarter of the light (E is relative to h^2 / d^2).
    far = replace(SMALL, camera_height_mm=60.0, ring_radius_mm=43.0, pixel_size_mm=2 * 0.2352)
    one = led_irradiance(untouched(SMALL), SMALL, 2) / 20**2
    other = led_irradiance(untouched(far), far, 2) / 40**2
    assert one == pytest.approx(4 * other, rel=1e-12)


def test_a_slope_towards_the_light_is_brighter_by_lambert() -> None:
    direction = np.array([sin(radians(30)), 0, cos(radians(30))])
    tilt = np.tan(radians(10))
    slopes = np.array([[[-tilt, 0.0], [0.0, 0.0], [tilt, 0.0]]])
    assert directional_image(slopes, direction)[0] == pytest.approx([cos(radians(a)) for a in (20, 30, 40)])


def test_a_slope_that_turns_away_is_dark() -> None:
    direction = np.array([sin(radians(60)), 0, cos(radians(60))])
    assert directional_image(np.array([[[tan(radians(31)), 0.0]]]), direction) == 0


def test_the_picture_has_the_symmetry_of_the_ring() -> None:
    # Mirrored left to right, the 12 LEDs are the same ring, numbered the other way round.
    flat = untouched(SMALL)
    for led, twin in ((0, 6), (1, 5), (2, 4), (10, 8)):
        assert led_irradiance(flat, SMALL, led)[:, ::-1] == pytest.approx(led_irradiance(flat, SMALL, twin), rel=1e-9)


def test_dark_leds_give_no_light_and_channels_do_not_mix() -> None:
    flat = untouched(SMALL)
    light = np.zeros((12, 3))
    light[4] = (0.0, 0.5, 0.0)
    picture = ring_irradiance(flat, SMALL, light)
    assert not picture[..., [0, 2]].any()
    assert picture[..., 1] == pytest.approx(0.5 * led_irradiance(flat, SMALL, 4))


def test_a_box_is_a_piece_of_the_whole() -> None:
    surface = sample(press_object("BALL", 0.5, SMALL, size=256), SMALL, 2.0, 1.0)
    box = (slice(30, 90), slice(60, 120))
    whole = ring_irradiance(surface, SMALL, ring_light(SMALL))
    np.testing.assert_allclose(ring_irradiance(surface, SMALL, ring_light(SMALL), box), whole[box], rtol=1e-12)


def test_a_flat_gel_has_no_cast_shadow() -> None:
    x, y = pixel_grid(SMALL)
    for position in led_positions(SMALL):
        assert visibility(np.zeros(SMALL.image_shape), (x[0], y[:, 0]), position).min() == 1


def test_a_gentle_ball_casts_no_shadow_on_itself() -> None:
    surface = sample(press_object("BALL", 0.3, GEOMETRY), GEOMETRY, 0.0, 0.0)
    x, y = pixel_grid(GEOMETRY)
    for position in led_positions(GEOMETRY)[::3]:
        assert visibility(surface.depth_mm, (x[0], y[:, 0]), position).min() == 1


def test_the_shadow_of_a_wall_has_the_length_of_geometry() -> None:
    # A wall 1 mm high and 20 mm in front of the light's foot, light 20 mm high: the shadow ends where the ray over
    # the wall comes down, at 20 * 20 / (20 - 1) = 21.05 mm from the foot.
    x = np.arange(3.0, 8.0, 0.02)
    y = np.arange(-1.0, 1.0, 0.02)
    wall = np.broadcast_to(((x >= 4.5) & (x <= 5.0)).astype(float), (len(y), len(x)))
    seen = visibility(wall, (x, y), np.array([-15.0, 0.0, 20.0]))
    middle = seen[len(y) // 2]
    shadow = x[(middle < 0.5) & (x > 5.05)]
    # Shadows are found on a polar grid of two pixels' pitch, 0.04 mm.
    assert shadow.max() == pytest.approx(-15 + 20 * 20 / 19, abs=0.08)
    assert middle[x < 4.4].min() == 1
    assert middle[x > 6.4].min() == 1


def test_shadows_agree_with_brute_force() -> None:
    surface = sample(press_object("BALL", 2.0, GEOMETRY, size=256), SMALL, 6.0, -2.0)
    x, y = pixel_grid(SMALL)
    shadowed = 0
    for position in led_positions(SMALL)[[1, 4, 7, 11]]:
        fast = visibility(surface.depth_mm, (x[0], y[:, 0]), position)
        slow = ray_marched(surface.depth_mm, x[0], y[:, 0], position)
        assert np.mean((fast > 0.5) != slow) < 0.004, "the two may differ along the shadow's edge only"
        shadowed += int((~slow).sum())
    assert shadowed > 100, "a ball this deep throws shadows"


def ray_marched(depth: np.ndarray, x: np.ndarray, y: np.ndarray, led: np.ndarray) -> np.ndarray:
    """(H, W) whether each pixel sees the light, by walking along its ray in small steps."""
    pixel = x[1] - x[0]
    seen = np.ones(depth.shape, bool)
    for step in np.linspace(0.001, 0.15, 150):  # shares of the way to the light: above 3 mm nothing stands
        rows = (1 - step) * np.arange(len(y))[:, None] + step * (led[1] - y[0]) / pixel
        columns = (1 - step) * np.arange(len(x))[None, :] + step * (led[0] - x[0]) / pixel
        surface = map_coordinates(depth, np.broadcast_arrays(rows, columns), order=1, mode="nearest")
        seen &= surface <= depth + step * (led[2] - depth) + 1e-3
    return seen


def test_normals_have_unit_length_and_point_to_the_camera() -> None:
    slopes = np.random.default_rng(0).normal(size=(5, 7, 2))
    normal = normals(slopes)
    assert np.linalg.norm(normal, axis=2) == pytest.approx(1)
    assert (normal[..., 2] > 0).all()
    assert -normal[..., :2] / normal[..., 2:] == pytest.approx(slopes)


def test_an_ideal_camera_is_proportional_to_light() -> None:
    light = np.random.default_rng(0).random((4, 5, 3))
    response = CameraResponse(exposure=0.5, crosstalk=IDENTITY)
    assert linear_grey(light, response) == pytest.approx(127.5 * light)


def test_crosstalk_has_a_row_for_each_channel() -> None:
    red = np.array([[[1.0, 0.0, 0.0]]])
    response = CameraResponse()
    assert linear_grey(red, response)[0, 0] / 255 == pytest.approx([row[0] for row in response.crosstalk])
    assert np.sum(response.crosstalk, axis=1) == pytest.approx(1), "grey light stays grey"


def test_gamma_leaves_black_and_white_where_they_are() -> None:
    light = np.repeat(np.array([0.0, 0.25, 1.0])[:, None, None], 3, axis=2)
    assert linear_grey(light, CameraResponse(gamma=2.0))[:, 0, 0] == pytest.approx([0, 127.5, 255])


def test_the_noise_has_the_stated_deviation_and_quantisation_adds_a_twelfth() -> None:
    picture = digitise(np.full((400, 500, 3), 100.3, np.float32), 2.0, np.random.default_rng(1))
    assert picture.dtype == np.uint8
    assert picture.mean() == pytest.approx(100.3, abs=0.02)
    assert picture.std() == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.01)


def test_too_much_light_clips_and_does_not_wrap() -> None:
    picture = expose(np.full((2, 2, 3), 5.0), CameraResponse(noise_grey=0.0), np.random.default_rng(0))
    assert (picture == 255).all()


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_the_exposure_puts_the_brightest_pixel_where_it_is_wanted(gamma: float) -> None:
    light = np.random.default_rng(2).random((6, 6, 3))
    exposure = exposure_for(light, CameraResponse(gamma=gamma), 200.0)
    assert linear_grey(light, CameraResponse(gamma=gamma, exposure=exposure)).max() == pytest.approx(200.0)


@pytest.mark.parametrize("wrong", [{"exposure": 0.0}, {"gamma": -1.0}, {"noise_grey": -0.1}])
def test_impossible_cameras_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        CameraResponse(**wrong)


def test_pixels_are_counted_from_the_image_centre() -> None:
    x, y = pixel_grid(SensorGeometry(image_width_px=4, image_height_px=3, pixel_size_mm=0.5))
    assert x.ravel() == pytest.approx([-0.75, -0.25, 0.25, 0.75])
    assert y.ravel() == pytest.approx([-0.5, 0, 0.5])


def test_a_beam_of_120_degrees_is_lambertian_and_a_wider_one_flatter() -> None:
    assert SensorGeometry().emission_exponent == pytest.approx(1)
    assert SensorGeometry(beam_angle_rad=np.radians(160)).emission_exponent == pytest.approx(0.396, abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"mounting_height_mm": 40.0},
        {"mounting_height_mm": float("nan")},
        {"led_colours": "RGX"},
        {"led_colours": "RG"},
        {"pixel_size_mm": 0.0},
        {"gel_thickness_mm": float("nan")},
        {"poisson_ratio": 0.5},
        {"camera_height_mm": float("nan")},
        {"coating_smoothing_mm": float("nan")},
        {"incident_angle_rad": np.pi / 2},
        {"beam_angle_rad": np.pi},
        {"obliquity": -1.0},
        {"window": True, "mounting_height_mm": 33.0},
    ],
)
def test_geometry_that_cannot_be_built_is_refused(wrong: dict) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong)).replace("mounting_", "mounting.")):
        SensorGeometry(**wrong)
