"""A hot chip: the committed image dims the LEDs, says so, and the host tells its user."""

import logging
import re

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.lab.doctor.sensor_checks import check_board
from gellight.ring.light_ring import LightRing
from gellight.ring.protocol import DIMMING_US, HOTTEST_C, RING_HOTTEST_C, DimmedEvent
from tests.helpers.bench_board import BenchBoard

RED = np.tile(np.array((100, 0, 0), np.uint8), (12, 1))


def attend(ring: LightRing, board: BenchBoard, duration_us: float) -> None:
    """Do what the keep-alive thread does, on the board's time."""
    end_us = board.now_us + duration_us
    while board.now_us < end_us:
        ring.clock()
        ring._light_again()
        board.run(250_000)


def test_a_hot_board_dims_its_leds_and_the_host_says_so(
    board: BenchBoard, ring: LightRing, caplog: pytest.LogCaptureFixture
) -> None:
    ring.light(RED)
    attend(ring, board, 1e6)
    assert np.isfinite(ring.lit_since_s())
    board.set_temperature(HOTTEST_C + 8)
    with caplog.at_level(logging.WARNING):
        attend(ring, board, 8e6)
    np.testing.assert_array_equal(board.lit, RED // 2)
    assert ring.lit_since_s() == np.inf  # no frame is of the light that was asked for
    assert (ring.dimmed, ring.status().dimmed) == (1, 1)
    told = re.search(r"board has (\d+) °C", caplog.text)
    assert told
    assert 60 <= int(told[1]) <= 62, "its mean, which has just passed 60"
    assert "dims its LEDs to 1/2" in caplog.text
    attend(ring, board, DIMMING_US)
    np.testing.assert_array_equal(board.lit, RED // 4)
    with pytest.raises(BoardError, match="dims its LEDs to 1/4: let it cool"):
        ring.light(RED)
    finding = check_board(ring)
    assert "dims its LEDs to 1/4" in finding.remedy


def test_a_board_that_has_cooled_shows_the_light_again(
    board: BenchBoard, ring: LightRing, caplog: pytest.LogCaptureFixture
) -> None:
    ring.light(RED)
    board.set_temperature(HOTTEST_C + 8)
    attend(ring, board, 8e6)
    board.set_temperature(HOTTEST_C - 20)
    with caplog.at_level(logging.WARNING):
        attend(ring, board, DIMMING_US)
    assert "the board is cool again; they are lit again" in caplog.text
    np.testing.assert_array_equal(board.lit, RED)
    assert np.isfinite(ring.lit_since_s())
    assert ring.dimmed == 0
    assert [event.dimmed for event in ring.events if isinstance(event, DimmedEvent)] == [1, 0]


def test_a_hot_ring_beside_a_cool_chip_is_dimmed(
    board: BenchBoard, ring: LightRing, caplog: pytest.LogCaptureFixture
) -> None:
    board.set_ring_temperature(RING_HOTTEST_C + 5)
    ring.light(RED)
    with caplog.at_level(logging.WARNING):
        attend(ring, board, 3e6)
    np.testing.assert_array_equal(board.lit, RED // 2)
    assert "the ring 65 °C (its limit is 60)" in caplog.text
    assert "the ring 65 °C" in check_board(ring).remedy
