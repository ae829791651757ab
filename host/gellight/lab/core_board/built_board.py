"""What a simulated board comes with: its number of LEDs, in the record of its flash, and the NTC of its ring.

firmware/core/config.h describes the record; the board itself wrote one where tests compare.
"""

import struct
import zlib
from math import exp

from gellight.base.errors import BoardError
from gellight.ring.protocol import CURRENT_CAP_EXTERNAL_MA, CURRENT_CAP_MA, Configuration
from gellight.ring.wire import MOST_LEDS

COLDEST_C, HOTTEST_C = -40.0, 125.0
"""the NTC of the strip is made for these"""
PAGE_BYTES, MAGIC = 256, 0x474C4346
FULL_LED_MA = 21
"""of an LED that shines in one colour, by the board's model"""


def check_buildable(leds: int, ring_c: float | None) -> None:
    """Raise BoardError for what no board has."""
    if not 1 <= leds <= MOST_LEDS:
        raise BoardError(f"{leds} LEDs: a board drives 1 to {MOST_LEDS}")
    if ring_c is not None and not COLDEST_C <= ring_c <= HOTTEST_C:
        raise BoardError(f"a ring of {ring_c:g} °C: its NTC is made for {COLDEST_C:g} to {HOTTEST_C:g} °C")


def thermistor_ohm(temperature_c: float) -> float:
    """Return what the NTC of the strip has: R = 10 kohm * exp(B * (1 / T - 1 / T25)), in kelvin, B = 3380 K."""
    return 10e3 * exp(3380 * (1 / (temperature_c + 273.15) - 1 / 298.15))


def thermistor_reading(temperature_c: float) -> int:
    """Return what the converter reads of 4096 where 10 kohm lead to the NTC from full scale."""
    ohm = thermistor_ohm(temperature_c)
    return int(4096 * ohm / (ohm + 10e3))


def configuration_of(leds: int) -> Configuration:
    """Return that of a simulated board with `leds`; with a supply of their own where USB could not light all."""
    strong = leds * FULL_LED_MA > CURRENT_CAP_MA
    return Configuration(
        host_timeout_ms=1000, limit_ma=CURRENT_CAP_EXTERNAL_MA if strong else CURRENT_CAP_MA, quiescent_ua=1000,
        channel_ua=20000, latch_us=300, unused=0, external_supply=int(strong), name=b"GelLight".ljust(16, b"\0"),
        led_count=leds,
    )  # fmt: skip


def record_of(configuration: Configuration) -> bytes:
    """Return the first record of a configuration, as a board saves it."""
    page = (struct.pack("<II", MAGIC, 1) + configuration.pack()).ljust(PAGE_BYTES - 4, b"\xff")
    return page + struct.pack("<I", zlib.crc32(page))
