"""The flash of a board that was configured: the image, and behind it the record that the firmware would have saved.

firmware/core/config.h describes the record; the board itself wrote one where tests compare.
"""

import struct
import zlib

from gellight.ring.protocol import CURRENT_CAP_EXTERNAL_MA, CURRENT_CAP_MA, Configuration
from gellight.ring.wire import LED_COUNT

FLASH_BYTES = 2 << 20
CONFIGURATION_AT = FLASH_BYTES - 2 * 4096
PAGE_BYTES, MAGIC = 256, 0x474C4346
FULL_LED_MA = 21
"""of an LED that shines in one colour, by the board's model"""


def configuration_of(leds: int) -> Configuration:
    """Return that of a simulated board with `leds`; with a supply of their own where USB could not light all."""
    strong = leds * FULL_LED_MA > CURRENT_CAP_MA
    return Configuration(
        host_timeout_ms=1000, limit_ma=CURRENT_CAP_EXTERNAL_MA if strong else CURRENT_CAP_MA, quiescent_ua=1000,
        channel_ua=20000, latch_us=300, policy=0, external_supply=int(strong), name=b"GelLight".ljust(16, b"\0"),
        led_count=leds,
    )  # fmt: skip


def with_configuration(image: bytes, configuration: Configuration) -> bytes:
    """Return the whole flash: an image, and the first record of the configuration."""
    page = (struct.pack("<II", MAGIC, 1) + configuration.pack()).ljust(PAGE_BYTES - 4, b"\xff")
    record = page + struct.pack("<I", zlib.crc32(page))
    return image.ljust(CONFIGURATION_AT, b"\xff") + record


def flash_of(image: bytes, leds: int) -> bytes:
    """Return the flash of a simulated board with `leds`; as it comes, nothing is saved."""
    return image if leds == LED_COUNT else with_configuration(image, configuration_of(leds))
