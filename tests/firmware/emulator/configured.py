"""The flash of a board that was configured: the image, and behind it the record that the firmware would have saved."""

from gellight.lab.core_board.simulated_board import record_of
from gellight.ring.protocol import Configuration

FLASH_BYTES = 2 << 20
CONFIGURATION_AT = FLASH_BYTES - 2 * 4096


def with_configuration(image: bytes, configuration: Configuration) -> bytes:
    """Return the whole flash: an image, and the first record of the configuration."""
    return image.ljust(CONFIGURATION_AT, b"\xff") + record_of(configuration)
