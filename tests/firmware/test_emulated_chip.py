"""Two flags that the emulated processor (rp2040py 0.3.6) gets wrong, by random blocks beside QEMU's: nobody asks."""

from itertools import pairwise

from gellight.ring.firmware.image import BOOT2_BYTES

SHIFTS, CARRIED = (2, 3, 4, 7), (5, 6)
"""of the arithmetic instructions: LSLS, LSRS, ASRS, RORS by a register; ADCS, SBCS"""
C, V = 2, 1


def known_wrong(word: int) -> int:
    """C, where a register shifts by 0 or by more than 32; V, where a sum with carry ends at 2^31."""
    operation = word >> 6 & 15 if word >> 10 == 0x10 else -1
    return C * (operation in SHIFTS) | V * (operation in CARRIED)


def asks_about(word: int) -> int:
    """Which of C and V an instruction of 16 bits goes by."""
    if word >> 12 == 0xD:
        condition = word >> 8 & 15
        return C * (condition in (2, 3, 8, 9)) | V * (condition in (6, 7, 10, 11, 12, 13))
    return C * (word >> 6 in (0x105, 0x106))


def test_the_image_asks_about_no_flag_that_the_emulator_gets_wrong(image: bytes) -> None:
    words = [int.from_bytes(image[at : at + 2], "little") for at in range(BOOT2_BYTES, len(image) - 1, 2)]
    assert any(known_wrong(word) for word in words)
    assert not [
        f"{first:04x} {second:04x}" for first, second in pairwise(words) if known_wrong(first) & asks_about(second)
    ]
