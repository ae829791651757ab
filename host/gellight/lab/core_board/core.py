"""The core of the firmware as a library with a virtual clock (firmware/boards/host), reached by ctypes."""

import ctypes
import functools
import platform
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, first_line
from gellight.reconstruction.native.library import NativePathError, check_whole
from gellight.ring.enumerations import Dark
from gellight.ring.wire import COLOUR_BYTES

CHECKSUMS = Path(__file__).parent / "libraries.sha256"
FLASH_BYTES = 8192  # firmware/core/port.h: two sectors of 4096
OUTPUT_BYTES = 65536  # chosen: 512 packets, more than wait at any time
RESTARTED = 2
"""of `flags`"""
_POINTER, _U32, _U64, _I32, _BOOL = (
    ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_int32, ctypes.c_bool,
)  # fmt: skip
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "new": (_POINTER, ctypes.c_char_p, _U32),
    "free": (None, _POINTER),
    "identify": (None, _POINTER, ctypes.c_char_p),
    "receive": (None, _POINTER, ctypes.c_char_p, _U32),
    "advance": (None, _POINTER, _U64),
    "edge": (None, _POINTER, _BOOL),
    "link": (None, _POINTER, _BOOL, _U32),
    "take_output": (_U32, _POINTER, ctypes.c_char_p, _U32),
    "light_count": (_U32, _POINTER),
    "light_at": (None, _POINTER, _U32, _POINTER),
    "flash": (None, _POINTER, ctypes.c_char_p),
    "fault": (None, _POINTER, _U32, _BOOL, _I32),
    "edge_after_reads": (None, _POINTER, _U32),
    "warm": (None, _POINTER, _I32),
    "warm_ring": (None, _POINTER, _U32),
    "powered": (_BOOL, _POINTER),
    "noted_saves": (_U32, _POINTER),
    "now": (_U64, _POINTER),
    "next": (_U64, _POINTER),
    "flags": (_U32, _POINTER),
}
"""of board.h: what each returns, and what it takes"""


class ShownLight(ctypes.Structure):
    """A light as the LEDs latched it: `struct board_light`."""

    _fields_ = (
        ("first_bit_us", _U64),
        ("latched_us", _U64),
        ("wire", ctypes.c_uint8 * COLOUR_BYTES),
        ("pulse_us", _U32),
    )

    def rgb(self, leds: int) -> NDArray[np.uint8]:
        """(n, 3) colours of LEDs that take green first, whatever the board is configured for."""
        return np.frombuffer(self.wire, np.uint8)[: 3 * leds].reshape(-1, 3)[:, [1, 0, 2]]


class CoreLibrary:
    """The functions of board.h, without their `board_`."""

    def __init__(self, path: str) -> None:
        """Load a library; OSError or AttributeError where that fails."""
        loaded = ctypes.CDLL(path)
        self.functions: dict[str, Any] = {name: getattr(loaded, f"board_{name}") for name in _FUNCTIONS}
        for name, (result, *arguments) in _FUNCTIONS.items():
            self.functions[name].restype, self.functions[name].argtypes = result, arguments


def library_file(name: str) -> Path:
    """Return where the library for a system and machine lies, as firmware/tools/libraries.py builds it."""
    return CHECKSUMS.with_name(f"core_board-{name}.so")


@functools.cache
def packaged_library() -> CoreLibrary:
    """Return the library for this machine that comes with the package; BoardError where there is none."""
    name = f"{sys.platform}-{platform.machine()}"
    path = library_file(name)
    try:
        if path.name not in CHECKSUMS.read_text():
            raise BoardError(
                f"no simulated board was built for {sys.platform} on {platform.machine()}: give sim://?board=0"
            )
        check_whole(path, CHECKSUMS)
        return CoreLibrary(str(path))
    except (NativePathError, OSError, AttributeError) as error:
        raise BoardError(
            f"the simulated board cannot be loaded ({first_line(error)}): install gellight again"
        ) from error


class Core:
    """A board with power and a virtual clock; nothing happens but what `advance` lets happen."""

    def __init__(self, library: CoreLibrary, flash: bytes | None = None, *, saves: int = 0) -> None:
        """Switch the power on: `flash` as it was left, None: erased; `saves` as was noted before a restart."""
        self.library = library
        self._board = library.functions["new"](flash, saves)
        self.free = weakref.finalize(self, library.functions["free"], self._board)
        self.free.atexit = False  # threads of a program that ends may still look at it
        self._output = ctypes.create_string_buffer(OUTPUT_BYTES)

    def call(self, function: str, *arguments: object) -> Any:
        """Call a function of board.h on this board."""
        return self.library.functions[function](self._board, *arguments)

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self.call("receive", data, len(data))

    def advance(self, duration_us: int) -> None:
        """Let time pass."""
        self.call("advance", duration_us)

    def edge(self, *, falling: bool = False) -> None:
        """Let the trigger pin rise, or fall."""
        self.call("edge", falling)

    def link(self, opened: bool, reason: int = Dark.PORT_CLOSED) -> None:
        """Open or close the connection to the host."""
        self.call("link", opened, reason)

    def take_output(self) -> bytes:
        """Return what it has sent to the host since the last call."""
        return self._output.raw[:count] if (count := self.call("take_output", self._output, OUTPUT_BYTES)) else b""

    @property
    def now_us(self) -> int:
        """The virtual time."""
        return int(self.call("now"))

    @property
    def next_us(self) -> int:
        """The virtual time until which nothing happens by itself."""
        return int(self.call("next"))

    @property
    def flags(self) -> int:
        """1: healthy, 2: it wants to restart, 4: into the boot loader."""
        return int(self.call("flags"))

    def latched(self, first: int = 0) -> Iterator[ShownLight]:
        """Yield what the LEDs latched, from a number on; the library remembers the last 4096."""
        for index in range(first, self.call("light_count")):
            light = ShownLight()
            self.call("light_at", index, ctypes.byref(light))
            yield light
