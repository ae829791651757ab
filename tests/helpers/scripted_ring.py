"""A light ring without a board: it latches at once, notes its lights, and loses them or fails when a test says so."""

import threading
from collections import Counter, deque
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np

from gellight.base.errors import BoardError
from gellight.ring import protocol
from gellight.ring.enumerations import Dark, State
from gellight.ring.heat import HeardHeat
from gellight.ring.light_ring import LATCH_TIMEOUT_S, LightRing

BOARD = "E660C06213842F2A"


class Failures:
    """Which steps fail, and how often each was taken; a step is "what" or "what number"."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, *at: str) -> None:
        self.at, self.taken = set(at), Counter[str]()

    def step(self, what: str, kind: type[Exception]) -> None:
        self.taken[what] += 1
        if {what, f"{what} {self.taken[what]}"} & self.at:
            raise kind(f"{what} failed")


class ScriptedRing(LightRing):
    """A `LightRing` whose requests are answered here; its steps fail where `failures` says."""

    led_count, dimmed, temperature = 12, 0, 270

    def __init__(
        self, still: np.ndarray | None = None, *, unique_id: str = BOARD, failures: Failures | None = None
    ) -> None:
        self._lock, self._lighting, self.heat = threading.RLock(), threading.RLock(), HeardHeat()
        self._dark, self._heard_s, self.lit_s = None, inf, -inf
        self.events, self.event_listeners, self.ping_listeners = deque(), [], []
        self.hello: Any = SimpleNamespace(
            unique_id=bytes.fromhex(unique_id), firmware_major=1, firmware_minor=2, firmware_patch=3
        )
        self.memory = protocol.Configuration(
            host_timeout_ms=1000, limit_ma=450, quiescent_ua=1000, channel_ua=20000, latch_us=300, unused=0,
            external_supply=0, name=b"GelLight".ljust(16, b"\0"),
        )  # fmt: skip
        self.failures = failures or Failures()
        self._nothing = np.zeros((self.led_count, 3), np.uint8)
        self.lit, self.still = self._nothing if still is None else still, still
        self.shown: list[np.ndarray] = []
        self.scale = protocol.FULL_SCALE
        self.dark = Dark.NOT_DARK
        self.lost: deque[bool] = deque()
        """for each question to come: whether another light is on than was asked"""
        self.closed = False

    def light(self, colours: np.ndarray | None, timeout_s: float = LATCH_TIMEOUT_S) -> int:
        self.failures.step("light", BoardError)
        return super().light(colours, timeout_s)

    def set_leds(self, colours: np.ndarray) -> Any:
        assert not self.closed, "lit after the end"
        self.lit = self.still = np.array(colours)
        self.shown.append(self.still)
        return SimpleNamespace(light_id=len(self.shown), scale=self.scale)

    def wait_for_light(self, light_id: int, timeout_s: float = 1.0) -> protocol.LightEvent:
        assert light_id == len(self.shown)
        return protocol.LightEvent(0, 0, light_id, 0, 0, 0, 0, 0)

    def blank(self) -> None:
        self.failures.step("blank", BoardError)
        self.lit, self.still = self._nothing, None

    def configuration(self) -> protocol.Configuration:
        self.failures.step("configuration", BoardError)
        return self.memory

    def configure(self, configuration: protocol.Configuration, *, save: bool = False) -> None:
        self.failures.step("configure", BoardError)
        self.memory = configuration
        self.failures.step("configured", BoardError)

    def status(self) -> Any:
        lost = self.lost.popleft() if self.lost else False
        return SimpleNamespace(
            state=State.STILL,
            dark=self.dark,
            light_id=len(self.shown) + lost,
            dimmed=self.dimmed,
            temperature=self.temperature,
            mean_ma=0,
            ring_temperature=protocol.NO_TEMPERATURE,
        )

    def close(self) -> None:
        self.lit, self.still, self.closed = self._nothing, None, True
