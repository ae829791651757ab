"""How warm chip and ring are, by what the board says, and the text for a board that dims its LEDs."""

import time
from math import inf
from typing import TypedDict

from gellight.ring import protocol

ASKED_S = 5.0
"""between two questions after the heat of a board"""
KNOWN_S = 2 * ASKED_S
"""for so long counts what a board said of its heat"""
WARM_MA = protocol.HOUSING_MA * 5 // 6
"""above this mean a board that was dimmed for its housing stays so"""


Told = protocol.StatusReply | protocol.DimmedEvent


class RingHeat(TypedDict):
    """How warm a light ring is, as its board says."""

    chip_c: float | None
    """of the board's chip, degrees Celsius, good to 10 degrees"""
    ring_c: float | None
    """of the ring's NTC, good to 2 degrees; None where there is none"""
    dimmed: int
    """how often every colour is halved because chip, ring or housing is hot"""
    mean_ma: int
    """what the LEDs drew in the last seven minutes"""


class HeardHeat:
    """What a board said last of its heat."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._told: Told | None = None
        self._heard_s = -inf

    def note(self, told: Told) -> None:
        """Take what a packet says that has just come."""
        self._told, self._heard_s = told, time.monotonic()

    def due(self) -> bool:
        """Whether the board should be asked."""
        return time.monotonic() - self._heard_s > ASKED_S

    def known(self) -> RingHeat | None:
        """Return how warm the ring is; None where its board has not said so for `KNOWN_S`."""
        told = self._told
        if told is None or time.monotonic() - self._heard_s > KNOWN_S:
            return None
        chip_c, ring_c = chip_temperature_c(told), ring_temperature_c(told)
        return {"chip_c": chip_c, "ring_c": ring_c, "dimmed": told.dimmed, "mean_ma": told.mean_ma}

    def why_dark(self, name: str) -> str:
        """Return why the LEDs of the sensor `name` do not show the light that was asked for, and what to do."""
        if self._told is not None and self._told.dimmed:
            return hot_text(self._told)
        return f"the board of {name} keeps its LEDs dark: see `gellight ring info`"


def warm_text(chip_c: float | None, ring_c: float | None) -> str:
    """Return for people how warm chip and ring are; "" where neither is known."""
    told = [] if chip_c is None else [f"chip at {chip_c:.0f} °C (±10)"]
    return ", ".join(told if ring_c is None else [*told, f"ring at {ring_c:.1f} °C"])


def dimmed_text(dimmed: int) -> str:
    """Return for people that the light is halved so often; "" where it is not."""
    return f"dimmed to 1/{1 << dimmed} because it is hot" if dimmed else ""


def chip_temperature_c(told: Told) -> float | None:
    """Return the temperature of the board's chip in degrees Celsius, good to 10 degrees; None without a sensor."""
    return None if told.temperature == protocol.NO_TEMPERATURE else told.temperature / 10


def ring_temperature_c(told: Told) -> float | None:
    """Return the temperature of the ring's NTC in degrees Celsius, good to 2 degrees; None where none is read."""
    return None if told.ring_temperature == protocol.NO_TEMPERATURE else told.ring_temperature / 10


def hot_text(told: Told) -> str:
    """Say that the board halves its light, how hot chip and ring are, and what its LEDs draw where that may be why."""
    drawn = f", its LEDs draw {told.mean_ma} mA in the mean" if told.mean_ma >= WARM_MA else ""
    ring_c = ring_temperature_c(told)
    ring = "" if ring_c is None else f", the ring {ring_c:.0f} °C (its limit is {protocol.RING_HOTTEST_C})"
    ring_is_hot = ring_c is not None and ring_c > protocol.RING_HOTTEST_C - protocol.COOLER_C
    other = "" if ring_is_hot else ", or raise the limit of its chip: `gellight ring configure --hottest`"
    return (
        f"the chip of the light ring's board has {told.temperature / 10:.0f} °C (±10){ring}{drawn}, so it dims its "
        f"LEDs to 1/{1 << told.dimmed}: let it cool, light fewer LEDs or for a shorter time{other}"
    )
