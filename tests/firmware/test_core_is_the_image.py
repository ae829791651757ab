"""The compiled core, which is the board of `sim://`, and the image in the emulated chip: they say and show the same."""

import pytest

from gellight.ring import protocol as p
from tests.firmware.helpers.core_and_image import Account, Said, Story, told_to_the_core, told_to_the_image

WIRE_US = 1_500
"""what is said reaches the image with the next frame of the USB, a millisecond long, and is then read and answered"""

TICK_US = 10_000
"""as often a board looks at the clock for what it does by itself, and the two do not at the same moments"""
READ_US = 100_000
"""as often it reads its thermometers, at a tick"""
BY_ITSELF = {
    p.EVENTS["DARK"][0]: TICK_US, p.EVENTS["DIMMED"][0]: READ_US + TICK_US,
}  # fmt: skip
"""what a board says without being asked, and by how much two boards differ in when"""


def short() -> Story:
    story = Story(seed=1)
    story.everything(600, heat=False)
    return story


def test_every_reply_event_and_light_of_the_core_is_that_of_the_image() -> None:
    story = short()
    image = told_to_the_image(story)
    core = told_to_the_core(story, chip_of(image))
    assert image.faults == []
    watched = [(times["time_us"], BY_ITSELF[code]) for code, _, _, times in image.events if code in BY_ITSELF]

    def late_us(when_us: float) -> float:
        return WIRE_US + max((late for at_us, late in watched if abs(when_us - at_us) < 2 * TICK_US), default=0)

    for theirs, ours in ((image.replies, core.replies), (image.events, core.events)):
        for said, again in zip(theirs, ours, strict=True):
            assert said[:2] == again[:2]
            assert but_for_the_mean(said) == but_for_the_mean(again)
            assert again[2].get("mean_ma", 0) == pytest.approx(said[2].get("mean_ma", 0), abs=1)
            for name, time_us in said[3].items():
                assert again[3][name] == pytest.approx(time_us, abs=late_us(time_us)), said
    assert [colours for _, colours in core.lights] == [colours for _, colours in image.lights]
    for (at_us, _), (image_us, _) in zip(core.lights, image.lights, strict=True):
        assert at_us == pytest.approx(image_us, abs=late_us(image_us))
    assert len(image.lights) > 50


def but_for_the_mean(said: Said) -> dict[str, object]:
    """Leave out the mean current of minutes, in whole mA: the charge of a light is counted at the next tick."""
    return {name: value for name, value in said[2].items() if name != "mean_ma"}


def chip_of(account: Account) -> int:
    return next(fields["temperature"] for _, _, fields, _ in account.replies if "temperature" in fields)
