"""What a board says of its heat: what is known of it for how long, and which advice fits."""

from types import SimpleNamespace

import pytest

from gellight.ring import heat
from gellight.ring.heat import HeardHeat, dimmed_text, hot_text, warm_text
from gellight.ring.protocol import NO_TEMPERATURE, DimmedEvent


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
