"""What pictures say about their light: rendered ones, touched and untouched, under one light and under two."""

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import LightLabel, LightState
from gellight.lab.emulator.waveform import Light
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.lab.simulator.simulated_camera import built
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.content import BANDS, ContentCheck, cells, robust_fit
from sim_reference.camera import CameraResponse, digitise

SHUTTER = Shutter()
ROWS = 240


class Rendered:
    """A small sensor whose gel is pressed; pictures under any light."""

    def __init__(self) -> None:
        geometry = built({"image_width_px": 320, "image_height_px": ROWS, "pixel_size_mm": 0.1176})
        self.scene = Scene(geometry, CameraResponse())
        self.rng = np.random.default_rng(5)
        self.ring = np.round(self.scene.light * 255).astype(np.uint8)
        self.phases_us = 500.0 * self.rng.random(12)
        self.press: Press | None = None

    def picture(self, light: np.ndarray) -> np.ndarray:
        grey, _ = self.scene.show(self.press, light)
        return digitise(grey, 1.0, self.rng)

    def changed(self, old: np.ndarray, new: np.ndarray, after_us: float) -> np.ndarray:
        lights = [Light(0.0, old), Light(1e6 + after_us, new)]
        return self.picture(row_weights(lights, 1e6, ROWS, self.phases_us, SHUTTER))

    def check(self, groups: np.ndarray) -> ContentCheck:
        self.press = None
        return ContentCheck([self.scene.show(None, group / 255)[0] for group in groups])


@pytest.fixture(scope="module")
def sensor() -> Iterator[Rendered]:
    return Rendered()


BALLS = [Press("BALL", depth, x, y) for depth, x, y in ((0.5, -6.0, 3.0), (1.0, 7.0, -5.0), (1.5, 0.5, 1.0))]


@pytest.mark.parametrize("groups_of", [colour_triples, single_leds])
def test_a_ball_in_the_gel_does_not_hide_which_group_is_lit(sensor: Rendered, groups_of) -> None:
    groups = groups_of(sensor.ring)
    check = sensor.check(groups)
    for sensor.press in (None, *BALLS):
        for number, group in enumerate(groups):
            assert check.label(sensor.picture(group / 255)) == LightLabel(state=LightState.CLEAN, group=number)


@pytest.mark.parametrize("groups_of", [colour_triples, single_leds])
def test_a_change_of_light_in_mid_frame_is_seen_through_a_ball(sensor: Rendered, groups_of) -> None:
    groups = groups_of(sensor.ring)
    check = sensor.check(groups)
    for sensor.press in (None, *BALLS):
        for after_us in (4000.0, 8000.0, 12_000.0, 16_000.0):
            picture = sensor.changed(groups[0], groups[2], after_us)
            assert check.label(picture).state == LightState.MIXED


def test_plates_that_fill_the_view_are_admitted_to_be_unreadable_but_never_another_group(sensor: Rendered) -> None:
    groups = colour_triples(sensor.ring)
    check = sensor.check(groups)
    said: Counter = Counter()
    for name in ("SINWAVE", "TSTEP", "CCONVEX"):
        sensor.press = Press(name, 0.6, 1.0, -1.0)
        for number, group in enumerate(groups):
            label = check.label(sensor.picture(group / 255))
            said["right" if label.group == number else str(label.state)] += 1
    assert said["clean"] == 0, "that would be the wrong group"
    assert said["mixed"] <= 1


def test_the_coefficients_run_from_one_light_to_the_other_as_the_shutter_does(sensor: Rendered) -> None:
    groups = colour_triples(sensor.ring)
    check = sensor.check(groups)
    sensor.press = None
    found = check.read(sensor.changed(groups[1], groups[3], 10_000.0)).coefficients
    height = (np.arange(BANDS) + 0.5) / BANDS
    wanted = np.clip((12.0 * height + 8.0 - 10.0 - 0.25) / 8.0, 0, 1)
    assert found[:, 3] == pytest.approx(wanted, abs=0.07)  # half a pulse of 0.5 ms, of an exposure of 8 ms
    assert found[:, 1] + found[:, 3] == pytest.approx(1.0, abs=0.07)
    assert found[:, [0, 2]].max() < 0.03


def test_drifted_brightness_is_still_the_same_group_and_darkness_is_none(sensor: Rendered) -> None:
    groups = colour_triples(sensor.ring)
    check = sensor.check(groups)
    sensor.press = None
    assert check.label(sensor.picture(0.8 * groups[2] / 255)).group == 2
    assert check.label(sensor.picture(0.0 * groups[2])).state == LightState.UNKNOWN
    assert check.label(sensor.picture(groups.max(axis=0) / 255)).state != LightState.CLEAN, "all of them at once"


def test_light_from_elsewhere_is_taken_out_by_the_dark_picture(sensor: Rendered) -> None:
    groups = colour_triples(sensor.ring)
    sensor.press = None
    lamp = 12.0
    references = [sensor.scene.show(None, group / 255)[0] + lamp for group in groups]
    check = ContentCheck(references, dark=np.full((ROWS, 320, 3), lamp, np.float32))
    picture = np.clip(sensor.picture(groups[1] / 255).astype(int) + 12, 0, 255).astype(np.uint8)
    assert check.label(picture).group == 1


def test_one_cell_in_three_may_be_anything() -> None:
    rng = np.random.default_rng(0)
    basis = rng.uniform(5, 100, (96, 4))
    wanted = np.array([0.7, 0.0, 0.3, 0.0])
    observed = basis @ wanted
    observed[rng.choice(96, 32, replace=False)] *= rng.uniform(1.5, 3.0, 32)
    assert robust_fit(basis, observed, 0.15 + 0.05 * observed) == pytest.approx(wanted, abs=0.05)


def test_the_mean_of_a_cell_is_its_mean() -> None:
    image = np.zeros((64, 128, 3), np.uint8)
    image[4:8, 4:8, 1] = 200
    found = cells(image).reshape(BANDS, 32, 3)
    assert found[1, 1].tolist() == [0, 200, 0]
    assert found.sum() == 200


def test_references_that_cannot_be_told_apart_are_refused(sensor: Rendered) -> None:
    groups = colour_triples(sensor.ring)
    pictures = [sensor.scene.show(None, group / 255)[0] for group in groups]
    with pytest.raises(InputError, match="light groups 1 and 4 look the same"):
        ContentCheck([*pictures, 0.5 * pictures[1]])
    with pytest.raises(InputError, match="group 2 is dark"):
        ContentCheck([*pictures[:2], np.zeros_like(pictures[0])])
    with pytest.raises(InputError, match="12 x 10 px is too small"):
        ContentCheck([picture[:10, :12] for picture in pictures])
