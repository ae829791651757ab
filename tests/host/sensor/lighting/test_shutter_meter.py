"""The shutter measured by its own pictures: exposure, readout and the meaning of the stamp, against the truth."""

import numpy as np
import pytest

from gellight.base.errors import CameraError
from gellight.frames.timing import CameraTiming
from gellight.ring.light_groups import colour_triples
from gellight.sensor.lighting.content import BANDS, Content
from gellight.sensor.lighting.shutter_meter import ShutterMeter, measure_shutter
from tests.helpers.virtual_sensor import RING, virtual_sensor

PAIR = colour_triples(RING)[[0, 2]]
HEIGHT = (np.arange(BANDS) + 0.5) / BANDS


def seen(share: np.ndarray, old: int = 0, new: int = 1) -> Content:
    coefficients = np.zeros((BANDS, 2))
    coefficients[:, new], coefficients[:, old] = share, 1 - share
    return Content(coefficients, np.ones(BANDS))


@pytest.mark.parametrize("late_s", [0.0, 0.021], ids=["stamps are starts", "stamps are ends"])
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
