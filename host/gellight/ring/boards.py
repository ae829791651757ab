"""The boards that makers use, by name: which pins they have for the LEDs, the camera and a status LED."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from gellight.base.errors import InputError
from gellight.base.leds import MOST_LEDS
from gellight.ring.firmware.targets import Target, packaged
from gellight.ring.protocol import ACTIVE_LOW, CURRENT_CAP_EXTERNAL_MA, CURRENT_CAP_MA, NO_PIN, Configuration


@dataclass(frozen=True, kw_only=True)
class CarrierPins:
    """GPIOs that the carrier uses beside those of the preset."""

    switch: int
    """closes the load switch"""
    status: int
    """of the carrier's own LED"""
    thermistor: int
    """an input of the ADC: the temperature of the ring"""


@dataclass(frozen=True, kw_only=True)
class Board:
    """Pins by their GPIO number, and what is printed beside them."""

    name: str
    data_pin: int
    trigger_pin: int
    output_pin: int
    status_pin: int
    """ACTIVE_LOW is added where the LED lights when low; NO_PIN: it has none that a pin alone can light"""
    printed: str
    """data, trigger and output as the board labels them"""
    carrier: CarrierPins | None = None
    """None: no carrier takes this board"""


def _board(told: dict[str, Any]) -> Board:
    pins = {f"{name}_pin": told[name] for name in ("data", "trigger", "output")}
    carrier = CarrierPins(**told["carrier"]) if "carrier" in told else None
    return Board(
        name=told["name"], printed=told["printed"], status_pin=told.get("status", NO_PIN), carrier=carrier, **pins
    )


def presets(targets: Iterable[Target]) -> dict[str, Board]:
    """Return the boards that the `board.toml` of each chip tells, by their names."""
    return {name: _board(told) for target in targets for name, told in target.boards.items()}


BOARDS = presets(packaged().values())

LEDS = {"ws2812b": 20_000, "ws2812b-v5": 12_000, "ws2812b-2020": 12_000, "ws2812c-2020": 5_000}
"""what one colour of an LED draws at 255, uA, by their data sheets; SK6812 as ws2812b, SK6805 as ws2812c-2020"""


def channel_ua_of(name: str) -> int:
    """Return what one colour of an LED draws, uA; InputError for a kind that is not listed."""
    if name not in LEDS:
        raise InputError(f"there is no preset for LEDs {name!r}: choose {', '.join(LEDS)}; ws2812b draws the most")
    return LEDS[name]


def find_board(name: str) -> Board:
    """Return a board by its name; InputError for one that is not listed."""
    if name not in BOARDS:
        raise InputError(f"there is no preset for a board {name!r}: choose {', '.join(BOARDS)}, or give its pins")
    return BOARDS[name]


def wired_as(configuration: Configuration, board: Board, *, output: bool) -> Configuration:
    """Return the configuration with the pins of a board; that of the trigger output only where it is wanted."""
    return replace(
        configuration, data_pin=board.data_pin, trigger_pin=board.trigger_pin, status_pin=board.status_pin,
        output_pin=board.output_pin if output else NO_PIN,
    )  # fmt: skip


def check_wiring(configuration: Configuration) -> None:
    """Raise InputError where the board would refuse the pins, the number of LEDs or its limits, and say why."""
    if not 40 <= configuration.hottest_c <= 85:
        raise InputError(f"{configuration.hottest_c} °C: the board takes 40 to 85 as the limit of its chip")
    if not 1 <= configuration.led_count <= MOST_LEDS:
        raise InputError(f"{configuration.led_count} LEDs: the board drives 1 to {MOST_LEDS}")
    most_ma = CURRENT_CAP_EXTERNAL_MA if configuration.external_supply else CURRENT_CAP_MA
    if not 100 <= configuration.limit_ma <= most_ma:
        raise InputError(f"{configuration.limit_ma} mA: the board takes a current limit of 100 to {most_ma} mA")
    pins = {"data": configuration.data_pin, "trigger": configuration.trigger_pin}
    if configuration.output_pin != NO_PIN:
        pins["output"] = configuration.output_pin
    if configuration.status_pin != NO_PIN:
        pins["status"] = configuration.status_pin & ~ACTIVE_LOW
    if configuration.switch_pin != NO_PIN:
        pins["switch"] = configuration.switch_pin & ~ACTIVE_LOW
    for name, pin in pins.items():
        if not 0 <= pin <= 29:
            raise InputError(f"the {name} pin is GPIO {pin}: boards have 0 to 29")
        others = [other for other in pins if other != name and pins[other] == pin]
        if others:
            raise InputError(f"GPIO {pin} is chosen for {name} and {others[0]}: choose different pins")
