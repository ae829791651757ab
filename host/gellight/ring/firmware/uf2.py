"""UF2, the file that a board in its boot loader takes as a USB stick (github.com/microsoft/uf2, "File format")."""

import struct

from gellight.base.errors import InputError

RP2040_FAMILY = 0xE48BFF56
FLASH_BASE = 0x10000000
PAYLOAD = 256
BLOCK = 512
_HEAD = struct.Struct("<8I")
_MAGIC = (0x0A324655, 0x9E5D5157)
_END = 0x0AB16F30
_FAMILY_PRESENT = 0x2000


def pack(image: bytes) -> bytes:
    """Wrap a flash image, filled up with zeros to whole pages of 256 bytes."""
    image += bytes(-len(image) % PAYLOAD)
    count = len(image) // PAYLOAD
    blocks = []
    for number in range(count):
        address = FLASH_BASE + PAYLOAD * number
        head = _HEAD.pack(*_MAGIC, _FAMILY_PRESENT, address, PAYLOAD, number, count, RP2040_FAMILY)
        payload = image[PAYLOAD * number : PAYLOAD * (number + 1)]
        blocks.append((head + payload).ljust(BLOCK - 4, b"\0") + _END.to_bytes(4, "little"))
    return b"".join(blocks)


def unpack(file: bytes) -> bytes:
    """Return the flash image of a UF2 file for the RP2040; InputError if it is anything else."""
    if not file or len(file) % BLOCK:
        raise InputError(f"a UF2 file consists of blocks of {BLOCK} bytes, this one has {len(file)} bytes")
    image = bytearray()
    for at in range(0, len(file), BLOCK):
        image += _payload(file[at : at + BLOCK], at // BLOCK, len(file) // BLOCK)
    return bytes(image)


def _payload(block: bytes, number: int, count: int) -> bytes:
    first, second, flags, address, size, index, total, family = _HEAD.unpack_from(block)
    if (first, second) != _MAGIC or int.from_bytes(block[-4:], "little") != _END:
        raise InputError(f"block {number} is not UF2: download the firmware again")
    if not flags & _FAMILY_PRESENT or family != RP2040_FAMILY:
        raise InputError(f"the firmware is for another chip (family 0x{family:08x}), not for the RP2040")
    if (index, total, size, address) != (number, count, PAYLOAD, FLASH_BASE + PAYLOAD * number):
        raise InputError(f"block {number} of {count} is out of place: download the firmware again")
    return block[_HEAD.size : _HEAD.size + size]
