"""What is known of a board: its heat, for how long and with which advice; presets, and wirings that cannot be."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gellight.base.errors import InputError
from gellight.ring import heat
from gellight.ring.boards import BOARDS, check_wiring, find_board, wired_as
from gellight.ring.heat import HeardHeat, dimmed_text, hot_text, warm_text
from gellight.ring.protocol import ACTIVE_LOW, NO_PIN, NO_TEMPERATURE, Configuration, DimmedEvent


def told(*, ring_c: float | None = None, mean_ma: int = 0, dimmed: int = 1, chip_c: float | None = 61.0) -> DimmedEvent:
    chip, ring = (NO_TEMPERATURE if celsius is None else round(10 * celsius) for celsius in (chip_c, ring_c))
    return DimmedEvent(0, chip, 0, dimmed, mean_ma, ring)


@pytest.mark.parametrize(
    ("ring_c", "chip_is_why"), [(None, True), (54.9, True), (55.0, True), (55.1, False), (61.0, False)]
)
def test_to_raise_the_limit_of_the_chip_is_advised_unless_the_ring_is_hot(
    ring_c: float | None, chip_is_why: bool
) -> None:
    """The ring has a limit of its own, 60 degrees, and is dimmed until it is 5 degrees cooler."""
    assert ("--hottest" in hot_text(told(ring_c=ring_c))) == chip_is_why


@pytest.mark.parametrize(("mean_ma", "said"), [(499, False), (500, True)])
def test_what_the_leds_draw_is_said_where_it_keeps_the_housing_warm(mean_ma: int, said: bool) -> None:
    assert (f"{mean_ma} mA" in hot_text(told(mean_ma=mean_ma))) == said


def test_heat_is_asked_for_again_after_a_while_and_forgotten_after_twice_that(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimpleNamespace(now_s=100.0)
    monkeypatch.setattr(heat, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    heard = HeardHeat()
    assert (heard.due(), heard.known()) == (True, None)
    heard.note(told(ring_c=40.5, mean_ma=120))
    for after_s, due, known in ((4.9, False, True), (5.1, True, True), (9.9, True, True), (10.1, True, False)):
        clock.now_s = 100.0 + after_s
        assert (heard.due(), heard.known() is not None) == (due, known)
    clock.now_s = 100.0
    assert heard.known() == {"chip_c": 61.0, "ring_c": 40.5, "dimmed": 1, "mean_ma": 120}
    assert heard.why_dark("left") == hot_text(told(ring_c=40.5, mean_ma=120))
    heard.note(told(dimmed=0))
    assert "left" in heard.why_dark("left")


def test_heat_is_said_in_words() -> None:
    assert warm_text(None, None) == ""
    assert warm_text(41.0, None) == "chip at 41 °C (±10)"
    assert warm_text(None, 40.46) == "ring at 40.5 °C"
    assert warm_text(41.0, 40.46) == "chip at 41 °C (±10), ring at 40.5 °C"
    assert [dimmed_text(times) for times in (0, 1, 3)] == [
        "", "dimmed to 1/2 because it is hot", "dimmed to 1/8 because it is hot",
    ]  # fmt: skip
    assert "LEDs to 1/8" in hot_text(told(dimmed=3))


AS_IT_COMES = Configuration(1000, 450, 1000, 20000, 300, 0, 0, b"GelLight".ljust(16, b"\0"))


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("output", [False, True])
def test_every_preset_is_a_wiring_that_can_be(name: str, output: bool) -> None:
    wired = wired_as(AS_IT_COMES, find_board(name), output=output)
    check_wiring(wired)
    assert (wired.output_pin != NO_PIN) == output
    assert len(find_board(name).printed.split(", ")) == 3


def test_a_board_comes_wired_as_a_pico_and_one_without_a_preset_is_named_with_those_that_have_one() -> None:
    assert wired_as(AS_IT_COMES, BOARDS["pico"], output=False) == AS_IT_COMES
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
