"""A light ring without a board: it latches at once, notes its lights, and loses them when a test says so."""

import threading
from collections import deque
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np

from gellight.ring import protocol
from gellight.ring.enumerations import Dark, State
from gellight.ring.light_ring import LightRing


class ScriptedRing(LightRing):
    """A `LightRing` whose requests are answered here."""

    led_count = 12

    def __init__(self, still: np.ndarray | None = None) -> None:
        self._lock, self._lighting = threading.RLock(), threading.RLock()
        self._dark, self._heard_s, self.lit_s = None, inf, -inf
        self.events, self.event_listeners, self.ping_listeners = deque(), [], []
        self.still = still
        self.shown: list[np.ndarray] = []
        self.dimmed = 0
        self.scale = protocol.FULL_SCALE
        self.dark = Dark.NOT_DARK
        self.lost: deque[bool] = deque()
        """for each question to come: whether another light is on than was asked"""

    def set_leds(self, colours: np.ndarray) -> Any:
        self.still = np.array(colours)
        self.shown.append(self.still)
        return SimpleNamespace(light_id=len(self.shown), scale=self.scale)

    def wait_for_light(self, light_id: int, timeout_s: float = 1.0) -> protocol.LightEvent:
        assert light_id == len(self.shown)
        return protocol.LightEvent(0, 0, light_id, 0, 0, 0, 0, 0)

    def blank(self) -> None:
        self.still = None

    def status(self) -> Any:
        lost = self.lost.popleft() if self.lost else False
        return SimpleNamespace(
            state=State.STILL, dark=self.dark, light_id=len(self.shown) + lost, dimmed=0, temperature=270
        )

    def close(self) -> None:
        self.still = None
