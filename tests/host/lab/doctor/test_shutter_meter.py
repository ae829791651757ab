"""The shutter measured by its own pictures: exposure, readout and the meaning of the stamp, against the truth."""

from contextlib import nullcontext

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.frames.camera import CameraTiming
from gellight.lab.core_board.light_timeline import Light
from gellight.lab.doctor.shutter_meter import BANDS, CELLS, ShutterMeter, TwoLights, cells, measure_shutter, robust_fit
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.lab.simulator.simulated_camera import built
from gellight.ring.light_groups import colour_triples
from sim_reference.camera import CameraResponse, digitise
from tests.helpers.virtual_sensor import RING, virtual_sensor

PAIR = colour_triples(RING)[[0, 2]]
HEIGHT = (np.arange(BANDS) + 0.5) / BANDS


def seen(share: np.ndarray) -> np.ndarray:
    return np.stack([1 - share, share], axis=1)


@pytest.mark.parametrize(
    "late_s",
    [pytest.param(0.0, marks=pytest.mark.nightly, id="stamps are starts"), pytest.param(0.021, id="stamps are ends")],
)
def test_it_measures_the_shutter_on_the_emulated_board(monkeypatch: pytest.MonkeyPatch, late_s: float) -> None:
    camera = virtual_sensor(monkeypatch, late_s=late_s, jitter_s=2e-4)
    found = measure_shutter(camera, PAIR, timing=CameraTiming(pulse_period_s=0.0005))
    assert found.exposure_s == pytest.approx(0.008, abs=5e-4)
    assert found.readout_s == pytest.approx(0.012, abs=1e-3)
    assert found.delay_s == pytest.approx(-late_s, abs=7e-4)
    timing = found.timing(CameraTiming())
    assert timing.span_s(100.0)[0] <= 100.0 - late_s + 1e-4
    camera.close()


def test_without_noise_the_solution_is_exact() -> None:
    meter, exposure, readout, delay = ShutterMeter(), 0.005, 0.014, 0.003
    for change_s in np.linspace(0.002, 0.025, 40):
        share = np.clip((readout * HEIGHT + delay + exposure - change_s) / exposure, 0, 1)
        meter.add(seen(share), 0, 1, float(change_s))
    found = meter.estimate()
    assert (found.exposure_s, found.readout_s, found.delay_s) == pytest.approx((exposure, readout, delay), abs=1e-9)


def test_a_change_the_other_way_round_is_not_taken_for_this_one() -> None:
    share = np.clip(2 * HEIGHT - 0.5, 0, 1)
    assert ShutterMeter().add(seen(share), 0, 1, 0.01) > 0
    assert ShutterMeter().add(seen(share), 1, 0, 0.01) == 0


def test_too_few_changes_or_pictures_that_ignore_the_light_are_told() -> None:
    with pytest.raises(CameraError, match="only 0 row bands"):
        ShutterMeter().estimate()
    meter, rng = ShutterMeter(), np.random.default_rng(0)
    for true_s in rng.uniform(0.002, 0.018, 40):
        share = np.clip((0.012 * HEIGHT + 0.008 - true_s) / 0.008, 0, 1)
        meter.add(seen(share), 0, 1, float(rng.uniform(-0.02, 0.02)))
    with pytest.raises(CameraError, match="do not follow"):
        meter.estimate()


@pytest.mark.parametrize("press", [None, Press("BALL", 1.0, 7.0, -5.0)], ids=["untouched", "a ball in the gel"])
def test_the_amounts_run_from_one_light_to_the_other_as_the_shutter_does(press: Press | None) -> None:
    rows, rng = 240, np.random.default_rng(5)
    geometry = built({"image_width_px": 320, "image_height_px": rows, "pixel_size_mm": 0.1176})
    scene = Scene(geometry, CameraResponse())
    ring = np.round(scene.light * 255).astype(np.uint8)
    pair = colour_triples(ring)[[1, 3]]
    lights = TwoLights((scene.show(None, pair[0] / 255)[0], scene.show(None, pair[1] / 255)[0]))
    change = [Light(0.0, pair[0]), Light(1e6 + 10_000.0, pair[1])]
    weights = row_weights(change, 1e6, rows, 500.0 * rng.random(12), Shutter())
    found = lights.amounts(digitise(scene.show(press, weights)[0], 1.0, rng))
    wanted = np.clip((12.0 * HEIGHT + 8.0 - 10.0 - 0.25) / 8.0, 0, 1)
    told = np.isfinite(found).all(axis=1)
    assert told.sum() >= (BANDS if press is None else BANDS - 6)
    assert found[told, 1] == pytest.approx(wanted[told], abs=0.07)  # half a pulse of 0.5 ms, of an exposure of 8 ms
    assert found[told].sum(axis=1) == pytest.approx(1.0, abs=0.08)


def test_one_cell_in_three_may_be_anything() -> None:
    rng = np.random.default_rng(0)
    basis, wanted = rng.uniform(5, 100, (CELLS * 3, 2)), np.array([0.7, 0.3])
    observed = basis @ wanted
    observed[rng.choice(CELLS * 3, CELLS, replace=False)] *= rng.uniform(1.5, 3.0, CELLS)
    assert robust_fit(basis, observed, 0.15 + 0.05 * observed) == pytest.approx(wanted, abs=0.05)


def test_the_mean_of_a_cell_is_its_mean() -> None:
    image = np.zeros((64, 128, 3), np.uint8)
    image[4:8, 4:8, 1] = 200
    found = cells(image).reshape(BANDS, CELLS, 3)
    assert found[1, 1].tolist() == [0, 200, 0]
    assert found.sum() == 200


def test_pictures_that_cannot_be_told_apart_are_refused() -> None:
    picture = np.random.default_rng(0).uniform(20, 200, (64, 128, 3)).astype(np.float32)
    with pytest.raises(InputError, match="look the same"):
        TwoLights((picture, 0.5 * picture))
    with pytest.raises(InputError, match="group 1 is dark"):
        TwoLights((picture, np.zeros_like(picture)))
    with pytest.raises(InputError, match="12 x 10 px is too small"):
        TwoLights((picture[:10, :12], picture[:10, :12]))


@pytest.mark.parametrize(("told", "bands"), [(2, 0), (3, 3)])
def test_a_change_is_seen_from_three_bands_on(told: int, bands: int) -> None:
    amounts = seen(np.linspace(0.3, 0.7, BANDS))
    amounts[told:] = np.nan
    assert ShutterMeter().add(amounts, 0, 1, 0.01) == bands


@pytest.mark.parametrize(("share", "bands"), [(0.079, 0), (0.081, 16), (0.919, 16), (0.921, 0)])
def test_a_band_says_something_where_both_lights_are_in_it(share: float, bands: int) -> None:
    assert ShutterMeter().add(seen(np.full(BANDS, share)), 0, 1, 0.01) == bands


@pytest.mark.parametrize(("slope", "bands"), [(-0.0019, 16), (-0.0021, 0)])
def test_rows_may_see_earlier_light_by_what_a_global_shutter_scatters(slope: float, bands: int) -> None:
    assert ShutterMeter().add(seen(0.5 + slope * np.arange(BANDS)), 0, 1, 0.01) == bands


@pytest.mark.parametrize(("bands", "enough"), [(59, False), (60, True)])
def test_sixty_bands_are_needed(bands: int, enough: bool) -> None:
    meter = ShutterMeter()
    share = np.random.default_rng(0).uniform(0.1, 0.9, bands)
    meter._samples = [(n % 16 / 16, 0.012 * (n % 16) / 16 + 0.008 * (1 - at), at) for n, at in enumerate(share)]
    with nullcontext() if enough else pytest.raises(CameraError, match="only 59 row bands"):
        assert meter.estimate().readout_s == pytest.approx(0.012)


@pytest.mark.parametrize(("grey", "dark"), [(1.02, False), (0.98, True)])
def test_a_light_is_dark_that_gives_less_than_a_grey_level(grey: float, dark: bool) -> None:
    picture = np.random.default_rng(0).uniform(20, 200, (64, 128, 3)).astype(np.float32)
    with pytest.raises(InputError, match="is dark") if dark else nullcontext():
        TwoLights((picture, np.full_like(picture, grey)))


@pytest.mark.parametrize(
    ("exposure_s", "readout_s", "sound"),
    [(2.1e-3, 0.012, True), (1.9e-3, 0.012, False), (0.008, -2.9e-3, True), (0.008, -3.1e-3, False)],
)
def test_an_exposure_is_twice_its_scatter_and_a_readout_no_more_than_three_times_it_below_zero(
    exposure_s: float, readout_s: float, sound: bool
) -> None:
    """What the bands saw scatters by 1 ms, about what the shutter says."""
    rng, meter = np.random.default_rng(0), ShutterMeter()
    height, share = np.tile(HEIGHT, 20), rng.uniform(0.1, 0.9, 20 * BANDS)
    design = np.column_stack([height, 1 - share, np.ones(len(share))])
    scatter = rng.choice([-1.0, 1.0], len(share))
    scatter -= design @ np.linalg.lstsq(design, scatter, rcond=None)[0]
    seen_s = design @ [readout_s, exposure_s, 0.002] + 1e-3 * scatter / scatter.std()
    meter._samples = list(zip(height.tolist(), seen_s.tolist(), share.tolist(), strict=True))
    with nullcontext() if sound else pytest.raises(CameraError, match="do not follow the light"):
        found = meter.estimate()
        assert found.scatter_s == pytest.approx(1e-3)
        assert (found.exposure_s, found.readout_s) == pytest.approx((exposure_s, max(readout_s, 0.0)))
