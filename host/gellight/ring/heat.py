"""How warm chip and ring are, by what the board says, and the text for a board that dims its LEDs."""

from typing import TypedDict

from gellight.ring import protocol

WARM_MA = protocol.HOUSING_MA * 5 // 6
"""above this mean a board that was dimmed for its housing stays so"""


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


def heat_of(status: protocol.StatusReply) -> RingHeat:
    """Return what a status says of heat."""
    return {
        "chip_c": chip_temperature_c(status), "ring_c": ring_temperature_c(status), "dimmed": status.dimmed,
        "mean_ma": status.mean_ma,
    }  # fmt: skip


def chip_temperature_c(status: protocol.StatusReply) -> float | None:
    """Return the temperature of the board's chip in degrees Celsius, good to 10 degrees; None without a sensor."""
    return None if status.temperature == protocol.NO_TEMPERATURE else status.temperature / 10


def ring_temperature_c(told: protocol.StatusReply | protocol.DimmedEvent) -> float | None:
    """Return the temperature of the ring's NTC in degrees Celsius, good to 2 degrees; None where none is read."""
    return None if told.ring_temperature == protocol.NO_TEMPERATURE else told.ring_temperature / 10


def hot_text(told: protocol.StatusReply | protocol.DimmedEvent) -> str:
    """Say that the board halves its light, how hot chip and ring are, and what its LEDs draw where that may be why."""
    drawn = f", its LEDs draw {told.mean_ma} mA in the mean" if told.mean_ma >= WARM_MA else ""
    ring_c = ring_temperature_c(told)
    ring = "" if ring_c is None else f", the ring {ring_c:.0f} °C (its limit is {protocol.RING_HOTTEST_C})"
    return (
        f"the chip of the light ring's board has {told.temperature / 10:.0f} °C (±10){ring}{drawn}, so it dims its "
        f"LEDs to 1/{1 << told.dimmed}: let it cool, light fewer LEDs or for a shorter time, or raise the limit of its "
        "chip: `gellight ring configure --hottest`"
    )
