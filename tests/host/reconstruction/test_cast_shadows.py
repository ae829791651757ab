"""The light that a surface hides and that its depth changes: against the reference simulator, and in deep presses."""

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.pixel_grid import block_means
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.lights_file import FILE_NAME, read_lights
from gellight.photometric.solver import Points
from gellight.photometric.window import bent
from gellight.reconstruction.cast_shadows import CastShadows
from gellight.reconstruction.errors import surface_errors
from gellight.reconstruction.gelnet import CELL_PX, GradientNetwork
from gellight.reconstruction.led_light import LedLight, unit_normals
from sim_reference import imaging
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.geometry import AS_BUILT, SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.surface import Surface
from sim_reference.view import seen_height_mm
from tests.helpers.native_forms import agree, both
from tests.helpers.simulated_bundle import ball_presses
from tests.helpers.simulated_light import PARALLEL, WHOLE, WORLDS, simulated_light

SYNTHETIC = load_bundle("synthetic")
AS_IT_LOOKS = replace(SYNTHETIC, manifest=SYNTHETIC.manifest.model_copy(update={"light_by_depth": False}))
"""as of a network that learnt from gel of every depth as it looks"""
GEOMETRY = AS_BUILT
NOISE_GREY = 1.0
DEEP = Press("BALL", 2.0, 6.5, -3.0)
WALLS = Press("WAVE", 1.0, 0.5, -0.5)


@lru_cache
def scene_of(geometry: SensorGeometry) -> Scene:
    return Scene(geometry, CameraResponse(noise_grey=NOISE_GREY))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of(GEOMETRY)


def of(bundle: Bundle, *, wanted: bool = True) -> CastShadows | None:
    network = GradientNetwork(bundle.network, bundle.image_shape, noise_grey=NOISE_GREY)
    return CastShadows.of_bundle(bundle, network, wanted=wanted)


def on_cells(surface: Surface) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Depth and slopes."""
    return tuple(block_means(a, CELL_PX).astype(np.float32) for a in (surface.depth_mm, surface.gradient_map))  # type: ignore[return-value]


@lru_cache
def picture(scene: Scene, press: Press) -> CameraFrame:
    image = digitise(scene.show(press)[0], NOISE_GREY, np.random.default_rng(5))
    return CameraFrame(image=image, time_s=0.0, sequence=0)


def test_a_deep_press_is_found_as_deep_as_it_is(scene: Scene) -> None:
    """Light that was bent comes from above 45 degrees, and is hidden by none of its slopes."""
    frame, (_, true) = picture(scene, DEEP), scene.show(DEEP)
    for given in (True, False):
        found = Reconstructor(SYNTHETIC, cast_shadows=given).reconstruct(frame)
        assert surface_errors(found, true).contact_depth_mm < 0.004


def test_objects_with_steep_walls_gain_most(scene: Scene) -> None:
    press = Press("PCONVEX", 1.2, 0.5, -0.5)
    frame, (_, true) = picture(scene, press), scene.show(press)
    found, before = (
        surface_errors(Reconstructor(SYNTHETIC, cast_shadows=given).reconstruct(frame), true) for given in (True, False)
    )
    assert found.contact_depth_mm < 0.8 * before.contact_depth_mm
    assert found.normal_deg < 0.95 * before.normal_deg


@pytest.fixture(scope="module", params=[PARALLEL, WHOLE], ids=["parallel", "whole"])
def world(request: pytest.FixtureRequest) -> Scene:
    return scene_of(request.param)


def seen_in(scene: Scene, bundle: Bundle) -> CastShadows:
    """The shadows of a bundle in the world of a scene, whose light is told."""
    found = of(bundle)
    found.light, found.height_mm = simulated_light(scene.geometry, CELL_PX), seen_height_mm(scene.geometry)
    found.on_cells = found.light.on_cells(found.x_mm, found.y_mm, found.height_mm)
    return found


def test_the_light_that_is_given_back_is_what_the_shadow_took(monkeypatch: pytest.MonkeyPatch) -> None:
    """Along parallel rays, where light that comes from low casts long shadows."""
    scene = scene_of(PARALLEL)
    shown, true = scene.show(DEEP)
    monkeypatch.setattr(imaging, "visibility", lambda depth_mm, *_: np.ones(depth_mm.shape))
    lit = Scene(PARALLEL, CameraResponse(noise_grey=NOISE_GREY)).show(DEEP)[0]
    taken = block_means((lit - shown) / scene.show(None)[0], CELL_PX)
    found = seen_in(scene, AS_IT_LOOKS).lost(*on_cells(true))
    assert np.count_nonzero(taken > 0.02) > 100
    assert np.abs(found - taken).sum() < 0.25 * taken.sum()
    # Cells lower the ridge that casts the shadow, so shadows are found some per cent too short.
    assert found.sum() == pytest.approx(taken.sum(), rel=0.1)


@pytest.mark.parametrize("wall_mm", [-3.0, 0.0, 4.0])
def test_a_wall_casts_a_shadow_as_long_as_snells_law_says(world: Scene, wall_mm: float) -> None:
    """Gel right of a wall lies 2 mm deeper; the LED at azimuth 0 lights the ground beyond the shadow of its edge."""
    seen, deep_mm, (h, w) = seen_in(world, AS_IT_LOOKS), 2.0, (120, 160)
    right = np.broadcast_to(seen.x_mm > wall_mm, (h, w))
    edge_mm = (seen.x_mm[~right[0]][-1] + seen.x_mm[right[0]][0]) / 2
    hidden = seen._hidden(0, np.where(right, np.float32(deep_mm), 0), np.roll(right, -1, axis=1) & ~right)
    led, window_mm = np.array(seen.light.leds[0], np.float64), seen.light.window_mm
    top_mm, ends_mm = edge_mm * (1 - deep_mm / seen.height_mm), edge_mm
    for _ in range(30):
        away = led[0] - ends_mm
        above = bent(away, led[2] - window_mm, window_mm).above_mm if window_mm else led[2]
        ends_mm = top_mm - deep_mm * away / above
    assert edge_mm - ends_mm > 1.1
    assert hidden[h // 2].sum() * seen.cell_mm[0] == pytest.approx(edge_mm - ends_mm, abs=seen.cell_mm[0])


def test_with_it_every_slope_is_as_bright_as_it_would_be_at_rest(world: Scene) -> None:
    shown, true = world.show(DEEP)
    level = Surface(np.zeros_like(true.depth_mm), true.gradient_map, true.contact)
    wanted = linear_grey(imaging.ring_irradiance(level, world.geometry, world.light), world.response)
    taken = block_means((wanted - shown) / world.show(None)[0], CELL_PX)
    found = seen_in(world, SYNTHETIC).lost(*on_cells(true))
    assert taken.min() < -0.009
    assert np.abs(found - taken).sum() < 0.15 * np.abs(taken).sum()


def test_waves_are_felt_in_the_light_that_their_second_round_finds(scene: Scene) -> None:
    """In the light of the first, felt from shadows that are too long, their contact is .06 mm off."""
    frame, (_, true) = picture(scene, WALLS), scene.show(WALLS)
    assert surface_errors(Reconstructor(SYNTHETIC).reconstruct(frame), true).contact_depth_mm < 0.015


@pytest.mark.parametrize("depth_mm", [pytest.param(0.3, marks=pytest.mark.nightly), 0.6])
def test_nothing_is_changed_where_no_wall_is_steeper_than_the_light(scene: Scene, depth_mm: float) -> None:
    for press in ball_presses(GEOMETRY, 2, np.random.default_rng(8), depth_mm):
        frame = picture(scene, press)
        one, other = (Reconstructor(SYNTHETIC, cast_shadows=given).reconstruct(frame) for given in (True, False))
        np.testing.assert_array_equal(one.depth_mm, other.depth_mm)
        np.testing.assert_array_equal(one.gradient_map, other.gradient_map)


@pytest.mark.parametrize("bundle", [SYNTHETIC, AS_IT_LOOKS], ids=["at rest", "as it looks"])
@pytest.mark.parametrize(
    ("press", "exponent", "gamma", "window_mm"),
    [(DEEP, 1.0, 1.0, 0.0), (WALLS, 1.0, 1.0, 0.0), (WALLS, 2.3, 1.7, 0.0), (WALLS, 1.0, 1.0, 8.0)],
)
def test_both_forms_find_the_same_light(
    bundle: Bundle, press: Press, exponent: float, gamma: float, window_mm: float
) -> None:
    lights, height_mm = json.loads(SYNTHETIC.files[FILE_NAME]), 53.1 if window_mm else 0.0
    bundle = replace(bundle, manifest=bundle.manifest.model_copy(update={"camera_height_mm": height_mm}))
    lights["ring"]["window_mm"] = window_mm
    lights["ring"]["beam_angle_rad"], lights["gamma"] = 2 * np.arccos(0.5 ** (1 / exponent)), gamma
    scene = scene_of(WHOLE if window_mm else PARALLEL)
    native, pixels = both(replace(bundle, files={**bundle.files, FILE_NAME: json.dumps(lights).encode()}))
    agree(native.reconstruct(frame := picture(scene, press)), pixels.reconstruct(frame))


def test_no_shadow_of_an_earlier_frame_is_left(scene: Scene) -> None:
    used = Reconstructor(AS_IT_LOOKS)
    for depth_mm in (1.6, 1.0):
        frame = picture(scene, Press("BALL", depth_mm, -3.0, 2.0))
        used.reconstruct(picture(scene, DEEP))
        anew = Reconstructor(AS_IT_LOOKS).reconstruct(frame)
        np.testing.assert_array_equal(used.reconstruct(frame).depth_mm, anew.depth_mm)


def test_pixels_that_are_not_square_give_the_same_light_in_both_forms(scene: Scene) -> None:
    oblong = SYNTHETIC.manifest.model_copy(update={"pixel_size_mm": (GEOMETRY.pixel_size_mm, 0.07)})
    frame = picture(scene, WALLS)
    native, pixels = (path.reconstruct(frame).depth_mm for path in both(replace(SYNTHETIC, manifest=oblong)))
    np.testing.assert_allclose(native, pixels, atol=25e-3)  # 22 um at most, 4 in the mean, of 1.2 mm


def test_a_bundle_that_does_not_know_its_leds_has_no_shadows() -> None:
    files = {name: content for name, content in AS_IT_LOOKS.files.items() if name != FILE_NAME}
    assert of(replace(AS_IT_LOOKS, files=files)) is None


def test_a_lens_or_a_setting_leaves_shadows_out_but_not_the_light_of_depth() -> None:
    lens = {"lens.json": b"{}"}
    assert of(AS_IT_LOOKS, wanted=False) is None
    assert of(replace(AS_IT_LOOKS, files={**AS_IT_LOOKS.files, **lens})) is None
    for found in (of(SYNTHETIC, wanted=False), of(replace(SYNTHETIC, files={**SYNTHETIC.files, **lens}))):
        assert not found.hide
        assert found.by_depth


def test_a_flat_surface_and_one_as_high_as_the_leds_have_none() -> None:
    shadows = of(AS_IT_LOOKS)
    for depth_mm in (0.0, 20.5):
        flat = np.full([n // CELL_PX for n in GEOMETRY.image_shape], depth_mm, np.float32)
        assert not shadows.lost(flat, np.zeros((*flat.shape, 2), np.float32)).any()


MODEL = read_lights(load_bundle("synthetic"))
BLOCKS = (12, 16)


def points(depth_mm: float, x_mm: float = 0.0, y_mm: float = 0.0) -> Points:
    return Points(*(np.array([value], np.float32) for value in (x_mm, y_mm, depth_mm)))


def straight_above(height_mm: float) -> LedLight:
    """One LED that shines straight down through no window, which is all the light of each channel."""
    led = np.array([[0, 0, height_mm, 0, 0, 1]], np.float32)
    return replace(LedLight.of(MODEL, BLOCKS), leds=led, shares=np.ones((1, 3, *BLOCKS), np.float32), window_mm=0)


@pytest.mark.parametrize("depth_mm", [-0.5, 0.0, 0.7, 2.0])
def test_light_from_straight_above_grows_by_the_inverse_square(depth_mm: float) -> None:
    light = straight_above(20.0)
    lost = light.lost_by_depth(points(depth_mm), np.zeros((1, 2), np.float32), np.ones((1, 3, 1), np.float32))
    np.testing.assert_allclose(lost, 1 - (20 / (20 - depth_mm)) ** 2, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("geometry", WORLDS)
def test_what_a_point_has_more_is_what_the_simulator_shows_there(geometry: SensorGeometry) -> None:
    """A plate of one slope at two depths, in every pixel, for the light of the whole ring."""
    shape = geometry.image_shape
    slopes = np.broadcast_to(np.array([0.3, -0.2]), (*shape, 2))
    contact = np.ones(shape, np.bool_)
    response = CameraResponse(exposure=1.0)
    level, deep, rest = (
        linear_grey(ring_irradiance(Surface(np.full(shape, depth), gradient, contact), geometry, ring_light(geometry)),
                    response)
        for depth, gradient in ((0.0, slopes), (1.2, slopes), (0.0, np.zeros((*shape, 2))))
    )  # fmt: skip
    light = simulated_light(geometry, 1)
    y, x = (np.indices(shape).reshape(2, -1) - (np.array(shape)[:, None] - 1) / 2) * geometry.pixel_size_mm
    at = Points.seen_at(x, y, np.full(x.shape, 1.2), seen_height_mm(geometry))
    lost = light.lost_by_depth(at, slopes.reshape(-1, 2), light.shares.reshape(len(light.leds), 3, -1))
    true = ((level - deep) / rest).reshape(-1, 3).T
    assert np.abs(true).max() > 0.03
    # The camera is taken to be as high everywhere as it seems to be near the axis: .04 mm beside it in the corners.
    np.testing.assert_allclose(lost, true, atol=4e-3 if geometry.perspective else 5e-4)
    assert np.abs(lost - true).mean() < 5e-4


def test_light_that_is_given_and_taken_again_changes_nothing() -> None:
    random = np.random.default_rng(0)
    seen, lost = random.uniform(-60, 60, (50, 3)), random.uniform(-0.1, 0.1, (50, 3))
    rest = random.uniform(100, 180, (50, 3))
    light = replace(LedLight.of(MODEL, BLOCKS), gamma=1.8, black=np.array([3.0, 4, 5], np.float32))
    again = light.with_light(light.with_light(seen, lost, rest), -lost, rest)
    np.testing.assert_allclose(again, seen, atol=2e-3)


def test_no_picture_is_darker_than_black() -> None:
    light = replace(LedLight.of(MODEL, BLOCKS), gamma=1.8)
    rest = np.full((1, 3), 100.0)
    darkest = light.with_light(np.full((1, 3), -95.0), np.full((1, 3), -0.5), rest)
    np.testing.assert_allclose(darkest + rest, light.black[None], atol=1e-3)


def test_normals_are_unit_vectors_against_the_slopes() -> None:
    normal = unit_normals(np.array([[3.0, -4.0], [0.0, 0.0]], np.float32))
    np.testing.assert_allclose(normal, np.array([[-3, 4, 1], [0, 0, np.sqrt(26)]]).T / np.sqrt(26), rtol=1e-6)
