"""Rings of other numbers of LEDs than the paper's, by the geometry, and rings with a thermometer that get hot."""

import time

import numpy as np
import pytest

from gellight.base.errors import BoardError, ConfigError
from gellight.cli.status import heat as heat_text
from gellight.lab.core_board.simulated_board import configuration_of
from gellight.opening import open_camera
from gellight.ring.firmware.targets import committed_image
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.ring.light_ring import LightRing, connect
from gellight.sensor.lighting.hold import exposures
from tests.firmware.emulator.configured import with_configuration
from tests.helpers.bench_board import BenchBoard, VirtualTransport
from tests.helpers.waiting import eventually

SMALL = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}
LATCHED_WITHIN_US = 20_000
RINGS = ["RGB", "RRRGGGBB", "RRRRGGGGBBBB", "RGB" * 8]


@pytest.mark.parametrize("leds", [1, 8, 24])
def test_a_simulated_board_drives_as_many_leds_as_its_url_says(leds: int) -> None:
    colours = (np.arange(3 * leds, dtype=np.uint8) * 5 % 61).reshape(leds, 3)
    with connect(f"sim://?leds={leds}") as ring:
        assert ring.led_count == leds
        ring.light(colours)
        board = ring.transport
        replied_us = board.virtual_us(time.monotonic())
        shown = board.light_during(replied_us, replied_us + LATCHED_WITHIN_US)[-1]
        np.testing.assert_array_equal(shown.colours, colours)
        ring.light(None)


@pytest.mark.parametrize("url", ["sim://?leds=0", "sim://?leds=25", "sim://?leds=many", "sim://?lamps=8",
                                 "sim://?ring_c=126"])  # fmt: skip
def test_a_board_that_cannot_be_is_refused(url: str) -> None:
    with pytest.raises(BoardError, match=r"1 to 24|names no board|made for -40 to 125"):
        connect(url)


@pytest.mark.parametrize("leds", [1, 24])
def test_the_record_of_a_simulated_board_is_the_one_that_the_firmware_writes(leds: int) -> None:
    wanted = configuration_of(leds)
    written = BenchBoard(committed_image())
    with LightRing(VirtualTransport(written), keep_alive_s=None) as ring:
        ring.set_supply(external=bool(wanted.external_supply), channel_ua=wanted.channel_ua)
        ring.configure(wanted, save=True)
        flash = bytes(written.flash)
    record = with_configuration(committed_image(), wanted)
    assert record == flash[: len(record)]


@pytest.mark.parametrize("colours", RINGS)
def test_the_simulated_sensor_is_lit_by_every_led_of_its_geometry(colours: str) -> None:
    """Full on, which for 24 LEDs is more than USB gives: a simulated board of that size has its own supply."""
    with open_camera("sim://?programme=0&fps=200", geometry={**SMALL, "led_colours": colours}) as camera:
        ring = camera.ring
        assert ring.led_count == len(colours)
        frame = camera.read()
        assert frame.light.tolist() == [[255 * (own == channel) for channel in "RGB"] for own in colours]
        whole = frame.image.mean(axis=(0, 1))
        groups = [*single_leds(ring.still)[:2], *colour_triples(ring.still)[:1]]
        means = [shown.image.mean(axis=(0, 1)) for shown in exposures(camera, np.array(groups))]
    for group, mean in zip(groups, means, strict=True):
        lit = group.any(axis=0)
        assert (mean[lit] < whole[lit] + 1).all()
        assert (mean[~lit] < whole[~lit] / 3).all()


def test_more_leds_than_a_board_drives_need_steady_light() -> None:
    many = {**SMALL, "led_colours": "RGB" * 9}
    with pytest.raises(ConfigError, match=r"27 LEDs, the board of the light ring drives 24 at most"):
        open_camera("sim://", geometry=many)
    with open_camera("sim://?board=0&programme=0&fps=200", geometry=many) as camera:
        assert camera.read().image.any()


def test_a_light_of_another_ring_is_refused() -> None:
    with (
        connect("sim://?leds=8") as ring,
        pytest.raises(BoardError, match="drives 8 LEDs, this light has 12: calibrate"),
    ):
        ring.light(np.zeros((12, 3), np.uint8))


def test_a_warm_ring_is_told_in_the_status_of_the_sensor() -> None:
    with open_camera("sim://?programme=0&ring_c=31.5", geometry=SMALL) as camera:
        eventually(camera.ring.heat.known)
        heat = camera.ring.heat.known()
        assert heat["ring_c"] == pytest.approx(31.5, abs=0.3)
        told = heat_text(heat)
        assert "ring at 31.5 °C" in told or "ring at 31.4 °C" in told
    assert heat_text({"chip_c": None, "ring_c": 61.0, "dimmed": 2, "mean_ma": 0}) == (
        "; ring at 61.0 °C; dimmed to 1/4 because it is hot"
    )


def test_no_frame_of_a_hot_ring_passes_for_one_of_its_light_and_it_is_said_what_helps() -> None:
    why = r"the ring 70 °C \(its limit is 60\), so it dims its LEDs to 1/2"
    with (  # noqa: PT012
        pytest.raises(BoardError, match=why) as refused,
        open_camera("sim://?programme=0&ring_c=70", geometry=SMALL) as camera,
    ):
        while True:  # the first frames may come before the board has looked at its thermometer
            camera.read()
    assert "--hottest" not in str(refused.value)  # that is the limit of the chip
