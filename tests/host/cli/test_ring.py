"""`gellight ring`, `firmware` and `sim`: what a builder types, and what is refused in one line."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gellight.ring.firmware.targets import committed_image
from gellight.ring.light_ring import LightRing
from tests.helpers.bench_board import BenchBoard, VirtualTransport
from tests.helpers.command_line import invoke, refused, succeeded


class WatchedTransport(VirtualTransport):
    """A transport to a board in this process, which keeps what its LEDs showed."""

    def close(self) -> None:
        super().close()
        self.board.run(5_000)


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Iterator[BenchBoard]:
    """A board that every URL names."""
    emulated = BenchBoard(committed_image())
    monkeypatch.setattr("gellight.ring.light_ring.open_transport", lambda _: WatchedTransport(emulated))
    yield emulated
    assert emulated.faults == []


def shown(board: BenchBoard) -> list[list[list[int]]]:
    return [board.timeline[k].colours.tolist() for k in range(len(board.timeline))]


def test_info_tells_who_the_board_is_and_how_warm(board: BenchBoard) -> None:
    board.set_temperature(41.0)
    told = json.loads(invoke("ring", "info", "--json").stdout)
    assert told["board"] == board.unique_id.hex().upper()
    assert abs(told["temperature_c"] - 41) < 0.5
    assert (told["dark"], told["running"], told["counters"]["bad_crc"]) == ("BOOT", False, 0)
    text = invoke("ring", "info").stdout
    assert "chip at 41 °C" in text
    assert "nothing wrong" in text


def test_set_lights_all_leds_or_those_that_are_named_and_leaves_them_dark(board: BenchBoard) -> None:
    done = invoke("ring", "set", "102030", "--seconds", "0.01")
    assert (done.exit_code, done.stdout) == (0, "lit, 103 mA\n")  # 12 + 12 * 20 * (16 + 32 + 48) / 255, rounded up
    assert [[0x10, 0x20, 0x30]] * 12 in shown(board)
    assert not board.lit.any()
    invoke("ring", "set", "ff0000", "--leds", "0-2,7", "--seconds", "0.01")
    board_lit = np.array([colours for colours in shown(board) if np.any(colours)][-1])
    assert np.flatnonzero(board_lit.any(axis=1)).tolist() == [0, 1, 2, 7]


def test_configure_saves_wiring_supply_and_limit_of_heat_and_starts_the_board_anew(board: BenchBoard) -> None:
    done = succeeded(invoke("ring", "configure", "--board", "xiao", "--order", "rgb", "--output", "middle"))
    assert "12 LEDs (RGB) at GPIO 2, trigger at GPIO 3, trigger output at GPIO 4 (middle" in done.stdout
    assert "Seeed XIAO RP2040 prints data, trigger, output as D8, D10, D9" in done.stdout
    board.run(200_000)
    assert board.resets == 1
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        kept = ring.configuration()
    assert (kept.colour_order, kept.output_pin, kept.output_at, kept.status_pin) == (1, 4, 1, 0x80 + 25)
    done = succeeded(invoke("ring", "configure", "--pin", "switch=134", "--supply-ma", "1200", "--hottest", "50"))
    assert "load switch at GPIO 6, dimmed above 50 °C" in done.stdout
    board.run(200_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        kept = ring.configuration()
        assert ring.status().limit_ma == 1200
    assert (kept.switch_pin, kept.external_supply, kept.limit_ma, kept.hottest_c) == (0x80 + 6, 1, 1200, 50)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--pin", "switch=131"], "GPIO 3 is chosen for trigger and switch"),
        (["--pin", "sw=6"], "give NAME=GPIO with a name of data, trigger, output, status, switch"),
        (["--pin", "switch"], "'switch' is no pin"),
        (["--hottest", "90"], "90 °C: the board takes 40 to 85"),
        (["--supply-ma", "3000"], "takes a current limit of 100 to 2000 mA"),
        (["--board", "feather"], "choose pico, pico-w"),
        (["--order", "bgr"], "'bgr' is none of grb, rgb, rgbw"),
    ],
)
def test_a_wiring_that_cannot_be_changes_nothing(board: BenchBoard, options: list[str], words: str) -> None:
    done = invoke("ring", "configure", *options)
    assert words in str(done.exception)
    assert board.resets == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("set", "ff"), "is no colour"),
        (("set", "red"), "is no colour"),
        (("set", "101010", "--seconds", "-1"), "--seconds -1 is not possible"),
        (("set", "101010", "--leds", "12"), "names no LEDs"),
        (("set", "101010", "--leds", "x"), "names no LEDs"),
        (("set", "ffffff", "--seconds", "0.01"), "OVER_CURRENT"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_and_lights_nothing(
    board: BenchBoard, arguments: tuple[str, ...], said: str
) -> None:
    done = invoke("ring", *arguments)
    assert said in refused(done)
    assert "\n" not in str(done.exception)
    assert not np.any(shown(board))


def test_an_image_that_cannot_be_read_or_written_is_said_so(tmp_path: Path) -> None:
    for arguments in (("flash", "--image", str(tmp_path / "none.uf2")), ("flash", "--image", str(tmp_path))):
        done = invoke("firmware", *arguments)
        assert "cannot read" in refused(done)
