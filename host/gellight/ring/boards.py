"""The boards that makers use, by name: which pins they have for the LEDs, the camera and a status LED."""

from dataclasses import dataclass, replace

from gellight.base.errors import InputError
from gellight.ring.protocol import ACTIVE_LOW, CURRENT_CAP_EXTERNAL_MA, CURRENT_CAP_MA, NO_PIN, Configuration
from gellight.ring.wire import MOST_LEDS


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


# Pins by the boards' headers in Raspberry Pi's pico-sdk (src/boards/include/boards), labels by TinyGo's pin tables:
#   pico.h                   LED 25
#   pico_w.h                 no plain LED: it hangs at the radio (CYW43_WL_GPIO_LED_PIN)
#   seeed_xiao_rp2040.h      LED 25, the blue one, lit when low (..._LED_PIN_INVERTED); GPIO 2, 3, 4 are D8, D10, D9
#   adafruit_qtpy_rp2040.h   no plain LED; GPIO 3, 4, 6 are MO, MI, SCK; WS2812 at 12, its power at 11
#   waveshare_rp2040_zero.h  no plain LED; WS2812 at 16
BOARDS = {
    "pico": Board(name="Raspberry Pi Pico", data_pin=2, trigger_pin=3, output_pin=4, status_pin=25,
                  printed="GP2, GP3, GP4"),
    "pico-w": Board(name="Raspberry Pi Pico W", data_pin=2, trigger_pin=3, output_pin=4, status_pin=NO_PIN,
                    printed="GP2, GP3, GP4"),
    "xiao": Board(name="Seeed XIAO RP2040", data_pin=2, trigger_pin=3, output_pin=4, status_pin=25 + ACTIVE_LOW,
                  printed="D8, D10, D9"),
    "rp2040-zero": Board(name="Waveshare RP2040-Zero", data_pin=2, trigger_pin=3, output_pin=4, status_pin=NO_PIN,
                         printed="GP2, GP3, GP4"),
    "qt-py": Board(name="Adafruit QT Py RP2040", data_pin=3, trigger_pin=4, output_pin=6, status_pin=NO_PIN,
                   printed="MO, MI, SCK"),
}  # fmt: skip


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
            raise InputError(f"the {name} pin is GPIO {pin}: the RP2040 has 0 to 29")
        others = [other for other in pins if other != name and pins[other] == pin]
        if others:
            raise InputError(f"GPIO {pin} is chosen for {name} and {others[0]}: choose different pins")
