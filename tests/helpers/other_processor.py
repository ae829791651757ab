"""A library of the frame path for aarch64, run in QEMU's emulator of programs."""

import struct
import subprocess
import sys
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.native.library import Library

SERVER = Path(__file__).with_name("call_server.c")
_INTEGER, _REAL, _ARRAY = range(3)


def build_server(folder: Path) -> Path:
    """Compile the program that calls the library's functions there."""
    import ziglang

    out = folder / "call_server"
    command = [
        sys.executable,
        "-m",
        "ziglang",
        "cc",
        "-target",
        "aarch64-linux-musl",
        "-static",
        "-nostdlib",
        "-O1",
    ]
    # Without a C library zig leaves its headers out too, and one of them says what a library's file looks like.
    headers = Path(ziglang.__file__).parent / "lib/libc/musl/include"
    plain = ["-ffreestanding", "-fno-builtin", "-fno-sanitize=all", "-fno-stack-protector", "-idirafter", headers]
    subprocess.run([*command, *plain, "-Wall", "-Wextra", "-Werror", SERVER, "-o", out], check=True)
    return out


class OtherProcessor(Library):
    """Calls go to a child process, with all that the arrays hold, and come back the same way."""

    def __init__(self, path: Path, server: Path) -> None:
        self.called: set[str] = set()
        self._child = subprocess.Popen(["qemu-aarch64", server], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        content = path.read_bytes()
        self._send(struct.pack("<q", len(content)), content)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        assert self._child.stdin
        self._child.stdin.close()
        assert self._child.wait(10) == 0

    def call(self, function: str, *arguments: NDArray[Any] | float) -> int:
        self.called.add(function)
        self._send(struct.pack("<32sq", function.encode(), len(arguments)))
        arrays = [argument for argument in arguments if isinstance(argument, np.ndarray)]
        for argument in arguments:
            if isinstance(argument, np.ndarray):
                self._send(struct.pack("<qq", _ARRAY, argument.nbytes), _bytes_of(argument))
            elif isinstance(argument, int | np.integer):
                self._send(struct.pack("<qq", _INTEGER, argument))
            else:
                self._send(struct.pack("<qfi", _REAL, argument, 0))
        result = int(struct.unpack("<q", self._receive(8))[0])
        for array in arrays:
            content = self._receive(array.nbytes)
            if array.flags.writeable:
                _bytes_of(array)[:] = content
        return result

    def _send(self, *parts: bytes | memoryview) -> None:
        assert self._child.stdin
        for part in parts:
            self._child.stdin.write(part)
        self._child.stdin.flush()

    def _receive(self, size: int) -> bytes:
        assert self._child.stdout
        content = self._child.stdout.read(size)
        assert len(content) == size, f"the emulated program ended with {self._child.wait(10)}"
        return content


def _bytes_of(array: NDArray[Any]) -> memoryview:
    assert array.flags.c_contiguous
    return memoryview(array.reshape(-1).view(np.uint8))
