"""The instructions of the emulated chip, judged by another emulator."""

from itertools import pairwise

import pytest

from gellight.ring.firmware.image import BOOT2_BYTES
from tests.firmware.helpers.thumb_blocks import asks_about, differences, known_wrong


@pytest.mark.nightly
@pytest.mark.parametrize(("count", "longest"), [(6_000, 1), (14_000, 10)])
def test_random_blocks_leave_the_same_registers_flags_and_memory(count: int, longest: int) -> None:
    assert differences(count, 29, longest) == []


def test_the_image_asks_about_no_flag_that_the_emulator_gets_wrong(image: bytes) -> None:
    words = [int.from_bytes(image[at : at + 2], "little") for at in range(BOOT2_BYTES, len(image) - 1, 2)]
    assert any(known_wrong(word) for word in words)
    assert not [
        f"{first:04x} {second:04x}" for first, second in pairwise(words) if known_wrong(first) & asks_about(second)
    ]
