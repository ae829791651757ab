"""What an image of the flash says of itself, and images to UF2 and back.

UF2 is the file that a board in its boot loader takes as a USB stick (github.com/microsoft/uf2, "File format").
"""

import struct
import zlib

from gellight.base.errors import InputError

FLASH_BASE = 0x10000000  # XIP_BASE of RP2040 and RP2350, by their data sheets
PAYLOAD = 256  # UF2 specification: bytes of the image in each block
BLOCK = 512  # and of the block
_BLOCK_HEAD = struct.Struct("<8I")
_BLOCK_MAGIC = (0x0A324655, 0x9E5D5157)  # its first words, by the UF2 specification
_BLOCK_END = 0x0AB16F30  # its last word
_FAMILY_PRESENT = 0x2000  # its flag for the number of a chip
BOOT2_BYTES = 256  # RP2040 data sheet 2.8: the second stage of its boot loader
VECTORS = 64  # Cortex-M: 16 vectors of 4 bytes, before those of interrupts
HEADER = struct.Struct("<4I")
"""behind the first 16 vectors: magic, bytes that follow, their CRC-32, family of the UF2 file"""
HEADER_MAGIC = 0x474C494D  # "GLIM" in ASCII


def header_at(image: bytes) -> int:
    """Return where the header of an image is: behind the vectors, with boot2 before them or without."""
    for at in (VECTORS + BOOT2_BYTES, VECTORS):
        if len(image) >= at + HEADER.size and HEADER.unpack_from(image, at)[0] == HEADER_MAGIC:
            return at
    raise InputError("this is no firmware image of a light ring, or it is damaged: build or download it again")


def image_family(image: bytes) -> int:
    """Return the UF2 family of the chip that an image is for; InputError if it is none."""
    return int(HEADER.unpack_from(image, header_at(image))[3])


def image_crc(image: bytes) -> int:
    """Return the checksum that the firmware of this image reports in HELLO; InputError if it is damaged."""
    at = header_at(image)
    _, count, crc, _ = HEADER.unpack_from(image, at)
    if zlib.crc32(image[at + HEADER.size :][:count]) != crc:
        raise InputError("the firmware image is damaged, its checksum does not fit: build or download it again")
    return int(crc)


def to_uf2(image: bytes) -> bytes:
    """Wrap a flash image, filled up with zeros to whole pages of 256 bytes."""
    family = image_family(image)
    image += bytes(-len(image) % PAYLOAD)
    count, file = len(image) // PAYLOAD, bytearray()
    for number in range(count):
        at = PAYLOAD * number
        head = _BLOCK_HEAD.pack(*_BLOCK_MAGIC, _FAMILY_PRESENT, FLASH_BASE + at, PAYLOAD, number, count, family)
        file += (head + image[at : at + PAYLOAD]).ljust(BLOCK - 4, b"\0") + _BLOCK_END.to_bytes(4, "little")
    return bytes(file)


def from_uf2(file: bytes) -> bytes:
    """Return the flash image of a UF2 file of ours; InputError if it is anything else."""
    if not file or len(file) % BLOCK:
        raise InputError(f"a UF2 file consists of blocks of {BLOCK} bytes, this one has {len(file)} bytes")
    count = len(file) // BLOCK
    blocks = [_payload(file[BLOCK * number : BLOCK * (number + 1)], number, count) for number in range(count)]
    image = b"".join(payload for _, payload in blocks)
    if {family for family, _ in blocks} != {image_family(image)}:
        raise InputError("the UF2 file is for another chip than the image in it: download the firmware again")
    return image


def _payload(block: bytes, number: int, count: int) -> tuple[int, bytes]:
    first, second, flags, address, size, index, total, family = _BLOCK_HEAD.unpack_from(block)
    if (first, second) != _BLOCK_MAGIC or int.from_bytes(block[-4:], "little") != _BLOCK_END:
        raise InputError(f"block {number} is not UF2: download the firmware again")
    if not flags & _FAMILY_PRESENT:
        raise InputError(f"block {number} does not say which chip it is for: download the firmware again")
    if (index, total, size, address) != (number, count, PAYLOAD, FLASH_BASE + PAYLOAD * number):
        raise InputError(f"block {number} of {count} is out of place: download the firmware again")
    return family, block[_BLOCK_HEAD.size : _BLOCK_HEAD.size + size]
