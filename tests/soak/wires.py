"""The serial line between host and board, which can be disturbed at any moment."""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from gellight.ring.transport import Transport


@dataclass
class Wires:
    """The serial line between host and board."""

    flipped: float = 0.0
    """share of the bytes that arrive with a wrong bit, in either direction"""
    silent: bool = False
    """nothing gets through"""
    draw: random.Random = field(default_factory=lambda: random.Random(0))

    def pass_on(self, data: bytes) -> bytes:
        """Return what arrives of `data`."""
        if self.silent or not self.flipped:
            return b"" if self.silent else data
        flip = self.draw
        return bytes(byte ^ (1 << flip.randrange(8)) if flip.random() < self.flipped else byte for byte in data)


class WiredTransport:
    """A transport to the board over `Wires`."""

    def __init__(self, transport: Transport, wires: Wires) -> None:
        """Disturb what goes through `transport` as `wires` say."""
        self.url, self._transport, self._wires = transport.url, transport, wires
        self.monotonic: Callable[[], float] = getattr(transport, "monotonic", time.monotonic)

    def write(self, data: bytes) -> None:
        """Send what gets through."""
        if arriving := self._wires.pass_on(data):
            self._transport.write(arriving)

    def read(self, timeout_s: float) -> bytes:
        """Return what got through; bytes that are lost end no waiting."""
        end_s = self.monotonic() + timeout_s
        while True:
            left_s = end_s - self.monotonic()
            data = self._wires.pass_on(self._transport.read(max(left_s, 0.0)))
            if data or left_s <= 0:
                return data

    def close(self) -> None:
        """Close."""
        self._transport.close()
