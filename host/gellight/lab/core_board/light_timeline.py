"""Which light the LEDs of a simulated board showed when."""

from bisect import bisect_left, bisect_right
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError
from gellight.ring.wire import LED_COUNT

BY_TIME = attrgetter("time_us")
KEPT_LIGHTS = 4096
"""lights that are remembered at least: 8 s of the fastest sequence; a camera asks for the last tenth of a second"""


class Light(NamedTuple):
    """What the LEDs show from a time on."""

    time_us: float
    """when they latched it"""
    colours: NDArray[np.uint8]
    """(n, 3) RGB"""


class LightTimeline:
    """Which light the LEDs showed when, dark before the first one; the oldest lights are forgotten."""

    def __init__(self, leds: int = LED_COUNT) -> None:
        """Begin in the dark."""
        self._dark = np.zeros((leds, 3), np.uint8)
        self._lights: list[Light] = []
        self._forgotten = 0

    def append(self, light: Light) -> None:
        """Add a light; times only grow."""
        if self._lights and light.time_us < self._lights[-1].time_us:
            raise ValueError(f"the light of {light.time_us} us comes before that of {self._lights[-1].time_us} us")
        self._lights.append(light)
        if len(self._lights) >= 2 * KEPT_LIGHTS:
            del self._lights[:KEPT_LIGHTS]
            self._forgotten += KEPT_LIGHTS

    def __len__(self) -> int:
        """Return how many lights were latched, with those that are forgotten."""
        return self._forgotten + len(self._lights)

    def __getitem__(self, index: int) -> Light:
        """Return the light by its number, from 0 or backwards from -1; IndexError for one that is forgotten."""
        kept = index if index < 0 else index - self._forgotten
        if not -len(self._lights) <= kept < len(self._lights) or (index >= 0 > kept):
            raise IndexError(f"light {index} of {len(self)}: {self._forgotten} are forgotten")
        return self._lights[kept]

    @property
    def shining(self) -> bool:
        """Whether the newest light is not dark."""
        return bool(self._lights) and bool(self._lights[-1].colours.any())

    def at(self, time_us: float) -> NDArray[np.uint8]:
        """Return the (n, 3) colours that are latched at a time; BoardError for one that is forgotten."""
        index = bisect_right(self._lights, time_us, key=BY_TIME) - 1
        if index < 0 and self._forgotten:
            raise BoardError(
                f"what simulated LEDs showed at {time_us / 1e6:.3f} s is forgotten after {KEPT_LIGHTS} more lights: "
                "the machine is too busy; open sim:// anew"
            )
        return self._dark if index < 0 else self._lights[index].colours

    def interval(self, start_us: float, end_us: float) -> list[Light]:
        """Return what was latched from start to end: the light at the start, then every change before the end."""
        if end_us < start_us:
            raise ValueError(f"the interval ends ({end_us} us) before it starts ({start_us} us)")
        first = bisect_right(self._lights, start_us, key=BY_TIME)
        changes = self._lights[first : bisect_left(self._lights, end_us, key=BY_TIME)]
        return [Light(start_us, self.at(start_us)), *changes]
