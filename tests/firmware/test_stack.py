"""The most stack that the image can ever need, from the compiler's call graph: no run has to be lucky to see it.

GCC tells the frame of each function and who calls whom (`-fcallgraph-info=su`). Calls through pointers are resolved by
hand, and a new kind of them is an error: `commands_execute` calls the handlers of its table, the rest of the core
calls what `port_fill` puts into the port, and the flash driver calls the boot ROM, whose own need is not ours to know.
An interrupt adds its deepest path and the eight words that the processor pushes, once for each priority, since only a
higher one interrupts. Recursion is an error.
"""

import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from firmware.tools.build import build
from gellight.ring.light_ring import LightRing
from tests.helpers.bench_board import BenchBoard, VirtualTransport
from tests.helpers.places import CHECKOUT

BOARD, SHARED, CORE = (CHECKOUT / "firmware" / name for name in ("boards/rp2040", "boards/rp2", "core"))
COMPILER = ["arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb", "-std=c11", "-Os", "-ffreestanding", "-fno-builtin",
            "-fno-common", "-DTHERMISTOR_PIN=26u", f"-I{BOARD}", f"-I{SHARED}", f"-I{CORE}",
            "-fcallgraph-info=su", "-c"]  # fmt: skip
PRIORITIES = (
    ("light_interrupt",),
    ("trigger_interrupt", "pulse_interrupt"),
    ("usb_interrupt", "tick_interrupt", "join_interrupt"),
)
"""highest first (`clock_start` sets them); those of one priority never interrupt each other"""
EXCEPTION_FRAME_BYTES = 8 * 4 + 4
"""eight registers, and a word where the stack was not aligned to eight bytes"""
INDIRECT = "__indirect_call"


NODE = re.compile(r'node: { title: "([^"]+)" label: "[^"]*?\\n([^"]*?):\d+:\d+\\n(\d+) bytes \((\w+)\)"')
EDGE = re.compile(r'edge: { sourcename: "([^"]+)" targetname: "([^"]+)"')


class CallGraph:
    """Frames and calls of all functions of the image; a static function is named with its file."""

    def __init__(self) -> None:
        self.frames: dict[str, int] = {}
        self.files: dict[str, Path] = {}
        self.calls: dict[str, set[str]] = {}
        self._depths: dict[str, int] = {}
        with tempfile.TemporaryDirectory() as folder:
            for source in (path for folder in (BOARD, SHARED, CORE) for path in sorted(folder.glob("*.c"))):
                target = Path(folder) / f"{source.parent.name}-{source.stem}.o"
                subprocess.run([*COMPILER, str(source), "-o", str(target)], check=True)
                self._read(target.with_suffix(".ci").read_text())
        for caller in self.calls:
            self._resolve(caller)

    def _read(self, text: str) -> None:
        for title, file, size, kind in NODE.findall(text):
            assert kind == "static", f"the frame of {title} is {kind}"
            self.frames[short(title)], self.files[short(title)] = int(size), Path(file)
        for source, target in EDGE.findall(text):
            self.calls.setdefault(short(source), set()).add(short(target))

    def _resolve(self, caller: str) -> None:
        called = self.calls[caller]
        if INDIRECT not in called:
            return
        called.remove(INDIRECT)
        if caller == "commands_execute":
            called |= {name for name in self.frames if name.startswith("handle_")}
        elif self.files[caller].parent == CORE:
            names = re.findall(r"\.\w+ = (\w+),", (SHARED / "main.c").read_text())
            called |= {name for name in self.frames if short(name).rpartition(":")[2] in names}
        elif caller == "start":
            called.add("main")
        elif self.files[caller].name not in ("flash.c", "rom.c"):
            raise AssertionError(f"{caller} calls through a pointer: say here whom")

    def depth(self, name: str, above: tuple[str, ...] = ()) -> int:
        """Bytes that a function and everything below it need."""
        assert name not in above, f"{name} calls itself by way of {above}"
        if name not in self._depths:
            below = self.calls.get(name, set())
            deepest = max((self.depth(callee, (*above, name)) for callee in below), default=0)
            self._depths[name] = self.frames.get(name, 0) + deepest
        return self._depths[name]

    def deepest_path(self, name: str) -> list[str]:
        """The functions of the deepest path."""
        below = self.calls.get(name, set())
        return [name, *(self.deepest_path(max(below, key=self.depth)) if below else [])]


def short(title: str) -> str:
    return title.rpartition("/")[2]


@cache
def stack_bound() -> dict[str, int]:
    """Bytes of the deepest path of main and of each interrupt, and the sum in the worst case."""
    graph = CallGraph()
    paths = {"start": graph.depth("start")}
    for level in PRIORITIES:
        paths |= {name: graph.depth(name) + EXCEPTION_FRAME_BYTES for name in level}
    worst = paths["start"] + sum(max(paths[name] for name in level) for level in PRIORITIES)
    return {**paths, "worst": worst}


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
