"""The light model from pictures of the untouched gel: what the simulated camera does to light is found again."""

import json
from contextlib import nullcontext, suppress
from dataclasses import replace
from math import radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, ConfigError
from gellight.bundle.bundle import load_bundle
from gellight.lab.optics.lights import reference_light
from gellight.lab.optics.lights.adding import _untouched
from gellight.lab.optics.lights.reference_light import check_places, find_gamma, fit_pattern, light_model
from gellight.lab.optics.lights.ring_fit import coarse_points, fit_ring, flat_light
from gellight.lab.simulator.stage import Stage
from gellight.photometric.light_model import LightGroups, LightModel, signals_of, unmixing
from gellight.photometric.lights_file import read_lights
from gellight.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import single_leds
from sim_reference.imaging import led_irradiance
from sim_reference.surface import untouched
from tests.helpers.command_line import invoke
from tests.helpers.simulated_gel import PIXEL_MM, RING, SMALL, Gel


@pytest.fixture(scope="module")
def gel() -> Gel:
    return Gel()


def test_crosstalk_is_what_other_channels_show_of_a_colour(gel: Gel) -> None:
    true = np.array(gel.base.crosstalk)
    np.testing.assert_allclose(gel.model().crosstalk, true / np.diag(true), atol=0.003)


def test_the_light_of_every_led_is_known_at_every_pixel(gel: Gel) -> None:
    model = gel.model(8)
    for kind in LightGroups:
        found = model.references(kind)
        for led, (group, channel) in enumerate(zip(single_leds(RING.colours), RING.channels, strict=True)):
            true = gel.exact(None, group)[..., channel]
            assert np.quantile(np.abs(found[led] - true), 0.99) < 0.2
            assert abs((found[led] / true).mean() - 1) < 0.003


def test_the_pattern_misses_nothing_of_the_sensor_of_the_paper(gel: Gel) -> None:
    exact = np.stack(
        [gel.exact(None, g)[..., c] for g, c in zip(single_leds(RING.colours), RING.channels, strict=True)]
    )
    _, residual = fit_pattern(exact)
    assert residual < 1e-4


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
def test_gamma_is_what_makes_light_add_up(gamma: float) -> None:
    assert Gel(gamma=gamma).model().gamma == pytest.approx(gamma, abs=0.02)


def test_black_is_what_the_dark_shows() -> None:
    model = Gel(black_grey=16.0).model(frames=2)
    np.testing.assert_allclose(model.black_grey, 16.0, atol=0.5)
    assert model.gamma == pytest.approx(1.0, abs=0.02)


def test_linear_and_grey_are_inverses() -> None:
    model = replace(Gel(noise_grey=0).model(1), gamma=2.2, black_grey=np.array([5.0, 16.0, 0.0]))
    image = np.random.default_rng(0).integers(16, 256, (*model.image_shape, 3)).astype(np.uint8)
    assert (model.grey(model.linear(image), model.image_shape) == image).all()


def test_signals_are_the_light_of_single_leds_whatever_shone_together(gel: Gel) -> None:
    model = gel.model()
    single, triple = (
        signals_of([[gel.picture(None, g)] for g in model.groups(kind)], model.groups(kind), model, 1.0)
        for kind in (LightGroups.SINGLES, LightGroups.TRIPLES)
    )
    assert abs((single.grey - triple.grey).mean()) < 0.05
    assert (single.grey - triple.grey).std() == pytest.approx(
        np.sqrt((single.deviation**2 + triple.deviation**2).mean()), rel=0.05
    )
    whole = model.linear(gel.picture(None, RING.colours))
    assert abs((triple.light - whole).mean()) < 0.2
    assert triple.valid.all()


def test_averaged_frames_have_less_noise(gel: Gel) -> None:
    model, groups = gel.model(), gel.model().groups(LightGroups.TRIPLES)
    four = signals_of([[gel.picture(None, g) for _ in range(4)] for g in groups], groups, model, 1.0)
    one = signals_of([[gel.picture(None, g)] for g in groups], groups, model, 1.0)
    np.testing.assert_allclose(four.deviation * 2, one.deviation)
    true = np.concatenate([model.references(LightGroups.TRIPLES).reshape(12, -1)])
    assert (four.grey - true).std() < 0.6 * (one.grey - true).std()


def test_clipped_pixels_and_dark_ones_are_left_out(gel: Gel) -> None:
    model, groups = gel.model(), gel.model().groups(LightGroups.TRIPLES)
    pictures = [[gel.picture(None, g)] for g in groups]
    pictures[1][0][10:20, 10:20] = 255
    pictures[2][0][100:140, 100:140] = 0
    valid = signals_of(pictures, groups, model, 1.0).valid.reshape(12, *model.image_shape)
    for group, (rows, columns) in ((1, (slice(10, 20),) * 2), (2, (slice(103, 137),) * 2)):
        lit = groups[group].any(axis=1)
        assert not valid[lit][:, rows, columns].any()
        assert valid[~lit][:, rows, columns].all()


def test_two_leds_of_one_colour_cannot_be_told_apart(gel: Gel) -> None:
    both = np.zeros((12, 3), np.uint8)
    both[:2, 0] = 255
    with pytest.raises(ValueError, match=r"LEDs \[0, 1\] .* same colour"):
        unmixing(both, RING, gel.model().crosstalk)


def test_a_ring_that_is_turned_is_told(gel: Gel) -> None:
    model = gel.model()
    turned = {kind: np.roll(pattern, 1, axis=0) for kind, pattern in model.patterns.items()}
    with pytest.raises(BundleError, match=r"LED 0 shines as if it were in the place of LED 11 \(12 of 12"):
        check_places(replace(model, patterns=turned), PIXEL_MM)


def test_a_dead_led_is_told(gel: Gel) -> None:
    pictures = gel.references(1)
    singles = (*pictures.singles[:5], pictures.dark, *pictures.singles[6:])
    with pytest.raises(BundleError, match=r"LED 5 alone shows .* in its own channel G: is it lit"):
        light_model(replace(pictures, singles=singles), RING, RING.colours, PIXEL_MM)


def test_pictures_of_different_exposures_are_told(gel: Gel) -> None:
    pictures = gel.references(1)
    with pytest.raises(BundleError, match="no camera curve explains"):
        light_model(replace(pictures, whole=pictures.whole * 0.05), RING, RING.colours, PIXEL_MM)


def test_a_glint_is_no_clipped_picture(gel: Gel) -> None:
    pictures = gel.references(1)
    for image in (pictures.whole, *pictures.singles, *pictures.triples):
        image[40:43, 60:63] = 255
    without, found = gel.model(1), light_model(pictures, RING, RING.colours, PIXEL_MM)
    assert found.gamma == without.gamma
    np.testing.assert_allclose(found.crosstalk, without.crosstalk, atol=2e-3)
    for kind, pattern in without.patterns.items():
        np.testing.assert_allclose(found.patterns[kind], pattern, atol=0.02)


def test_an_object_in_the_gel_is_told() -> None:
    from gellight.lab.simulator.scene import Press

    gel = Gel()
    for_good = gel.exact
    gel.exact = lambda press, group: for_good(Press("CCONVEX", 0.8), group)  # type: ignore[method-assign]
    with pytest.raises(BundleError, match="is something touching it"):
        gel.model(1)


def test_a_ring_in_the_gel_is_refused() -> None:
    with pytest.raises(ConfigError, match="above the gel"):
        RingGeometry.from_overrides({"mounting_height_mm": 41.0})


@pytest.mark.parametrize("pressed", [True, False])
def test_what_a_stage_presses_is_lifted_off_and_pressed_again(pressed: bool) -> None:
    stage = Stage(SMALL, programme=False)
    if pressed:
        stage.press("BALL", 0.5, 1.0, -2.0)
    before = stage.status()
    camera: Any = SimpleNamespace(stage=stage)
    with suppress(KeyboardInterrupt), _untouched(camera):
        assert not stage.status()["object"]
        raise KeyboardInterrupt
    told = ("object", "depth_mm", "x_mm", "y_mm")
    assert [stage.status()[name] for name in told] == [before[name] for name in told]


@pytest.mark.parametrize(("gamma", "found"), [(1.009, 1.0), (0.991, 1.0), (1.011, 1.011), (0.989, 0.989)])
def test_a_gamma_within_a_hundredth_of_1_is_1(gamma: float, found: float) -> None:
    singles = np.full((12, 8, 8, 3), 200 * (1 / 12) ** (1 / gamma))
    assert find_gamma(singles, np.full((8, 8, 3), 200.0)) == pytest.approx(found, abs=2e-4)


@pytest.mark.parametrize(
    ("led_grey", "whole_grey", "refusal"),
    [(8.1, 253.9, ""), (7.9, 253.9, "LED 5 alone shows 7.9"), (8.1, 254.1, "reaches 254 of 255")],
)
def test_leds_show_8_grey_levels_and_the_ring_clips_nothing(led_grey: float, whole_grey: float, refusal: str) -> None:
    singles = np.full((12, 4, 4, 3), 50.0)
    singles[5] = led_grey
    pictures: Any = SimpleNamespace(whole=np.full((4, 4, 3), whole_grey))
    with pytest.raises(BundleError, match=refusal) if refusal else nullcontext():
        reference_light._check_brightness(pictures, singles, RING)


@pytest.mark.parametrize(("residual", "smooth"), [(0.049, True), (0.051, False)])
def test_a_twentieth_of_the_light_may_lie_beside_a_smooth_pattern(
    residual: float, smooth: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reference_light, "fit_pattern", lambda levels: (levels, residual))
    monkeypatch.setattr(reference_light, "_levels", lambda *taken: np.zeros(1))
    taken = {LightGroups.SINGLES: np.zeros(1), LightGroups.TRIPLES: np.zeros(1)}
    with nullcontext() if smooth else pytest.raises(BundleError, match=r"5\.1% beside a smooth"):
        assert reference_light._patterns(taken, RING.colours, RING, np.eye(3))[1] == residual


# ---- the ring from that light: place, height, tilt and beam of the LEDs ----

WRONG = replace(RING, ring_radius_mm=22.8, mounting_height_mm=18.6, incident_angle_rad=radians(20.0), centre_x_mm=0.5)


@pytest.fixture(scope="module")
def model() -> LightModel:
    return Gel(seed=8).model(16)


def test_light_on_flat_gel_is_that_of_the_reference_simulator() -> None:
    flat = untouched(SMALL)
    found = flat_light(*coarse_points(SMALL.image_shape, PIXEL_MM), RING)
    for led in (0, 5):
        true = led_irradiance(flat, SMALL, led)[::16, ::16].ravel()
        np.testing.assert_allclose(found[led] / found[led, 0], true / true[0], rtol=1e-9)


@pytest.mark.parametrize("start", [RING, WRONG])
def test_the_ring_is_found_from_noisy_pictures_wherever_one_begins(model: LightModel, start: RingGeometry) -> None:
    fit = fit_ring(replace(model, ring=start), PIXEL_MM)
    assert fit.ring.ring_radius_mm == pytest.approx(21.5, abs=0.15)
    assert fit.ring.height_mm == pytest.approx(20.0, abs=0.15)
    assert fit.ring.incident_angle_rad == pytest.approx(radians(29.0), abs=radians(1.5))
    assert (fit.ring.centre_x_mm, fit.ring.centre_y_mm) == pytest.approx((0.0, 0.0), abs=0.05)
    assert fit.misfit < 0.01
    assert fit.as_json()["ring_radius_mm"] == pytest.approx(21.5, abs=0.15)


def test_the_ring_is_found_through_the_window_that_bends_its_light() -> None:
    behind, ring = replace(SMALL, window=True), replace(RING, window_mm=SMALL.window_mm)
    flat = untouched(behind)
    x, y = coarse_points(SMALL.image_shape, PIXEL_MM)
    true = np.stack([led_irradiance(flat, behind, led)[::16, ::16].ravel() for led in range(12)])
    found = flat_light(x, y, ring)
    np.testing.assert_allclose(found / found[:, :1], true / true[:, :1], rtol=1e-9)


def test_the_middle_of_the_ring_moves_all_leds() -> None:
    moved = replace(RING, centre_x_mm=1.5, centre_y_mm=-0.5).positions_mm() - RING.positions_mm()
    np.testing.assert_allclose(moved, np.tile([1.5, -0.5, 0.0], (12, 1)), atol=1e-12)


def test_the_verb_finds_the_ring_of_the_simulated_sensor_and_its_bundle_has_the_lights(tmp_path: Path) -> None:
    url = "sim://?object=BALL&fps=1000"  # what is pressed is lifted off meanwhile
    done = invoke("calibrate", "lights", "--out", tmp_path / "lit", "--sensor", url, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert (found["leds"], found["exposure_us"]) == (12, 8000)
    ring = found["ring_from_light"]
    assert ring["ring_radius_mm"] == pytest.approx(21.5, abs=0.1)
    assert ring["height_mm"] == pytest.approx(20, abs=0.1)
    assert len(read_lights(load_bundle(tmp_path / "lit")).colours) == 12
