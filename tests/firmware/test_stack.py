"""The stack never leaves its room: by the compiler's call graph, and by what the painted stack of an image shows."""

import numpy as np
import pytest

from firmware.tools.build import build
from gellight.ring.light_ring import LightRing
from tests.firmware.helpers.stack_bound import CallGraph, stack_bound
from tests.helpers.bench_board import BenchBoard, VirtualTransport

pytestmark = pytest.mark.nightly
ROOM_BYTES = 4096
BOOT_ROM_BYTES = 512
"""what is left at least for the boot ROM's flash functions, whose need is not ours to know"""


def test_the_deepest_calls_leave_room_for_the_boot_rom() -> None:
    assert stack_bound()["worst"] <= ROOM_BYTES - BOOT_ROM_BYTES
    assert CallGraph().deepest_path("start")[:2] == ["start", "main"]


def test_a_running_image_stays_within_the_bound() -> None:
    """The same compiler's image saves its configuration, which is the deepest path, and shows lights meanwhile."""
    board = BenchBoard(build(compiler_name="gcc"))
    ring = LightRing(VirtualTransport(board), keep_alive_s=None)
    ring.set_leds(np.full((12, 3), 9, np.uint8))
    ring.blank()
    board.run(5_000)
    ring.configure(ring.configuration(), save=True)
    used = ROOM_BYTES - ring.self_test().stack_free
    ring.close()
    assert 0.4 * stack_bound()["worst"] < used <= stack_bound()["worst"]
