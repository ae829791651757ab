"""The simulated kernel on virtual time, which moves when somebody waits: fast, and the same on every machine."""

from collections.abc import Callable

import pytest

from gellight.sensor.v4l2.errors import Kernel
from tests.helpers.simulated_kernel import CameraDevice as FakeCamera
from tests.helpers.simulated_kernel import DeviceControl as FakeControl
from tests.helpers.simulated_kernel import SimulatedKernel, refuse

__all__ = ["FakeCamera", "FakeControl", "FakeKernel", "refuse"]


class FakeKernel(SimulatedKernel):
    """Cameras by path; `now_s` moves when somebody waits."""

    def __init__(self, cameras: dict[str, FakeCamera] | None = None) -> None:
        super().__init__(cameras)
        self.now_s = 100.0
        self.events: list[tuple[float, Callable[[], None]]] = []

    def take_over(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Take the place of Linux for everything that names no kernel of its own."""
        for name in ("open", "ioctl", "mmap", "poll", "close", "clock"):
            monkeypatch.setattr(Kernel, name, getattr(self, name))

    def at(self, time_s: float, action: Callable[[], None]) -> None:
        """Let something happen at a time, while somebody waits."""
        self.events = sorted([*self.events, (time_s, action)], key=lambda event: event[0])

    def sleep(self, seconds: float) -> None:
        self._until(self.now_s + seconds)

    def clock(self) -> float:
        return self.now_s

    def wait_until(self, time_s: float) -> None:
        soonest = [moment for moment, _ in self.events[:1] if moment > self.now_s]
        self._until(min([time_s, *soonest]))

    def _until(self, time_s: float) -> None:
        while self.events and self.events[0][0] <= time_s:
            moment, action = self.events.pop(0)
            self._move(max(moment, self.now_s))
            action()
        self._move(time_s)

    def _move(self, time_s: float) -> None:
        self.now_s = time_s
        self.advance()
