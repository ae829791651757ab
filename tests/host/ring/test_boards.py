"""The presets of boards, and wirings that cannot be."""

from dataclasses import replace

import pytest

from gellight.base.errors import InputError
from gellight.ring.boards import BOARDS, check_wiring, find_board, wired_as
from gellight.ring.protocol import ACTIVE_LOW, NO_PIN, Configuration

AS_IT_COMES = Configuration(1000, 450, 1000, 20000, 300, 0, 0, b"GelLight".ljust(16, b"\0"))


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("output", [False, True])
def test_every_preset_is_a_wiring_that_can_be(name: str, output: bool) -> None:
    wired = wired_as(AS_IT_COMES, find_board(name), output=output)
    check_wiring(wired)
    assert (wired.output_pin != NO_PIN) == output
    assert len(find_board(name).printed.split(", ")) == 3


def test_a_board_comes_wired_as_a_pico() -> None:
    assert wired_as(AS_IT_COMES, BOARDS["pico"], output=False) == AS_IT_COMES


def test_a_board_without_a_preset_is_named_with_those_that_have_one() -> None:
    with pytest.raises(InputError, match="'feather': choose pico, pico-w, xiao, rp2040-zero, qt-py, pico2"):
        find_board("feather")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"data_pin": 3}, "GPIO 3 is chosen for data and trigger"),
        ({"status_pin": ACTIVE_LOW + 2}, "GPIO 2 is chosen for data and status"),
        ({"output_pin": 30}, "the output pin is GPIO 30: boards have 0 to 29"),
        ({"led_count": 25}, "25 LEDs: the board drives 1 to 24"),
    ],
)
def test_a_wiring_that_cannot_be_is_told(fields: dict[str, int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        check_wiring(replace(AS_IT_COMES, **fields))
