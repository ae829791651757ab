"""The C core as a library with a virtual clock (firmware/boards/host), as the tests use it."""

import ctypes
import functools
import os
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Sequence
from pathlib import Path

from gellight.lab.core_board.core import FLASH_BYTES, OUTPUT_BYTES, Core, CoreLibrary
from gellight.ring import protocol
from gellight.ring.enumerations import Edge, SyncMode
from gellight.ring.wire import LED_COUNT, Packet, Record, decode, encode

CHECKOUT = Path(__file__).parents[3]
NO_PULSE = 0xFFFFFFFF
RED, GREEN, BLUE = (bytes([0] * k + [200] + [0] * (35 - k)) for k in range(3))
BLACK, WHITE = bytes(36), b"\xff" * 36
"""of the whole ring; the first three of one LED alone"""
FLAGS = ["-std=c11", "-g", "-O1", "-fPIC", "-Wall", "-Wextra", "-Wconversion", "-Werror"]


def c_compiler() -> list[str]:
    """The system's compiler, or the one from PyPI."""
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    return [found] if found else [sys.executable, "-m", "ziglang", "cc"]


def compile_library(target: Path, sanitizers: str, extra: Sequence[str] = (), *, checkout: Path = CHECKOUT) -> Path:
    folders = [checkout / "firmware" / name for name in ("boards/host", "core")]
    files, headers = ([path for folder in folders for path in sorted(folder.glob(end))] for end in ("*.c", "*.h"))
    flags = (*FLAGS, f"-fsanitize={sanitizers}", "-fno-sanitize-recover=all", *extra)
    known = tuple((path.name, path.read_text()) for path in headers)
    objects = [target.with_name(f"{path.stem}.o") for path in files]
    for path, place in zip(files, objects, strict=True):
        place.write_bytes(compiled(path.name, path.read_text(), known, flags))
    _run([*c_compiler(), *flags, "-shared", *map(str, objects), "-o", str(target)])
    return target


@functools.cache
def compiled(name: str, source: str, headers: tuple[tuple[str, str], ...], flags: tuple[str, ...]) -> bytes:
    """An object file; a mutant has all but one in common with the others, and is compiled in a tenth of the time."""
    with tempfile.TemporaryDirectory() as folder:
        for file, content in ((name, source), *headers):
            (Path(folder) / file).write_text(content)
        _run([*c_compiler(), *flags, "-c", f"{folder}/{name}", "-o", f"{folder}/object.o"])
        return (Path(folder) / "object.o").read_bytes()


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def run_core_tests(library: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of the core on a library, to the first failure; without plugins, which take longer than they do.

    Nothing is captured in between: what a sanitizer says before it ends the process would be lost.
    """
    files = (CHECKOUT / "tests/firmware").glob("test_core*.py")
    tests = [str(path) for path in sorted(files, key=lambda path: ("config" in path.name, path.name))]  # long ones last
    plain = {"GELLIGHT_CORE_LIBRARY": str(library), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-s", "-p", "no:cacheprovider", *tests],
        cwd=CHECKOUT, env=os.environ | plain | environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


class VirtualBoard(Core):
    def __init__(
        self, library: CoreLibrary, flash: bytes | None = None, *, opened: bool = True, saves: int = 0
    ) -> None:
        super().__init__(library, flash, saves=saves)
        self._sequence = 0
        self.packets: list[Packet] = []
        self._partial = bytearray()
        self.led_count = LED_COUNT
        if opened:
            self.link(True)
            self.advance(2000)
            self.collect()

    def restarted(self) -> "VirtualBoard":
        """Another board with what the flash of this one keeps."""
        return VirtualBoard(self.library, self.flash())

    def faults(self, *, room: int = OUTPUT_BYTES, stuck: bool = False, cut_after: int = -1) -> None:
        """The host takes `room` bytes more; transfers to the LEDs break off; `cut_after` bytes of flash change."""
        self.call("fault", room, stuck, cut_after)

    def flash(self) -> bytes:
        """What its flash keeps of the configuration."""
        kept = ctypes.create_string_buffer(FLASH_BYTES)
        self.call("flash", kept)
        return kept.raw

    @property
    def noted_saves(self) -> int:
        """What `saves` of a board that starts anew is to be."""
        return int(self.call("noted_saves"))

    def edge_after_reads(self, reads: int) -> None:
        """The trigger comes right after the board has read its clock that many times."""
        self.call("edge_after_reads", reads)

    def warm(self, celsius: float) -> None:
        self.call("warm", round(10 * celsius))

    def warm_ring(self, reading: int) -> None:
        """Let the converter read this of the ring's NTC."""
        self.call("warm_ring", reading)

    @property
    def powered(self) -> bool:
        return bool(self.call("powered"))

    def lights(self) -> list[tuple[int, int, bytes]]:
        """First bit and latch in us, and the colours in logical order, RGB."""
        return [(light.first_bit_us, light.latched_us, light.rgb(self.led_count).tobytes()) for light in self.latched()]

    @property
    def light(self) -> bytes:
        return self.lights()[-1][2]

    def pulses(self) -> list[bool]:
        """Of each light: whether the trigger output pulses."""
        return [light.pulse_us != NO_PULSE for light in self.latched()]

    def collect(self) -> list[Packet]:
        """Every packet that came since the last call."""
        self._partial += self.take_output()
        *whole, rest = self._partial.split(b"\0")
        self._partial = bytearray(rest)
        return [decode(bytes(stuffed)) for stuffed in whole]

    def ask(self, name: str, record: Record | None = None, *, sequence: int | None = None) -> tuple[int, int, bytes]:
        """Status, value and reply record of a request; events go to `packets`."""
        self._sequence = (self._sequence + 1 & 0xFF) if sequence is None else sequence
        code = protocol.COMMANDS[name].code
        self.receive(encode(Packet(code, self._sequence, record.pack() if record else b"")))
        reply = None
        for packet in self.collect():
            if (packet.type, packet.sequence) == (code | protocol.REPLY, self._sequence):
                reply = packet
            else:
                self.packets.append(packet)
        assert reply is not None, f"no reply to {name}"
        return reply.payload[0], int.from_bytes(reply.payload[1:5], "little"), reply.payload[5:]

    def ok(self, name: str, record: Record | None = None) -> Record:
        status, value, payload = self.ask(name, record)
        assert status == 0, (name, status, value)
        return protocol.COMMANDS[name].reply.unpack(payload)

    def status(self) -> protocol.StatusReply:
        return self.ok("STATUS")

    def load_sequence(self, groups: Sequence[bytes], steps: Sequence[protocol.SetStep], loops: int = 0) -> None:
        table = [*groups, *[bytes(3 * self.led_count)] * (protocol.GROUP_COUNT - len(groups))]
        for index, colours in enumerate(table):
            self.ok("SET_GROUP", protocol.SetGroup(index, colours))
        for step in steps:
            self.ok("SET_STEP", step)
        crc = zlib.crc32(b"".join(table) + b"".join(step.pack() for step in steps))
        self.ok("COMMIT", protocol.Commit(crc, loops, len(steps)))

    def play(
        self, groups: Sequence[bytes], steps: Sequence[protocol.SetStep], loops: int = 0,
        mode: SyncMode = SyncMode.FREE, **sync: int,
    ) -> None:  # fmt: skip
        """Start a sequence; by the board's clock, if `mode` and `sync` do not say otherwise."""
        self.sync(mode, **sync)
        self.load_sequence(groups, steps, loops)
        self.ok("START")

    def sync(self, mode: SyncMode, *, divider: int = 1, delay_us: int = 0, timeout_us: int = 0) -> None:
        self.ok("SET_SYNC", protocol.SetSync(mode, Edge.RISING, divider, delay_us, timeout_us))


def load(path: str | None = None) -> CoreLibrary:
    return CoreLibrary(path or os.environ["GELLIGHT_CORE_LIBRARY"])
