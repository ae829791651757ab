"""A camera with controls and a board with LEDs and a memory; each step can be made to fail."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from gellight.base.errors import BoardError, CameraError
from gellight.lab.simulator.simulated_controls import SimulatedControls
from gellight.ring.protocol import Configuration
from tests.helpers.scripted_camera import FlatCamera


class Failures:
    """Which steps fail, and how often each was taken; a step is "what" or "what number"."""

    def __init__(self) -> None:
        self.at: set[str] = set()
        self.taken: dict[str, int] = {}

    def reset(self, *at: str) -> None:
        self.at, self.taken = set(at), {}

    def step(self, what: str, kind: type[Exception]) -> None:
        self.taken[what] = self.taken.get(what, 0) + 1
        if {what, f"{what} {self.taken[what]}"} & self.at:
            raise kind(f"{what} failed")


class Board:
    """The ring of a sensor."""

    def __init__(self, failures: Failures, unique_id: str = "E660C06213842F2A") -> None:
        self.failures = failures
        self.hello = SimpleNamespace(unique_id=bytes.fromhex(unique_id))
        self.lit = np.zeros((12, 3), np.uint8)
        self.still: np.ndarray | None = None
        self.memory = Configuration(
            host_timeout_ms=1000, limit_ma=450, quiescent_ua=1000, channel_ua=20000, latch_us=300, policy=0,
            external_supply=0, name=b"GelLight".ljust(16, b"\0"),
        )  # fmt: skip
        self.closed = False

    def light(self, colours: np.ndarray | None) -> None:
        self.failures.step("light", BoardError)
        if colours is None:
            self.blank()
            return
        assert not self.closed, "lit after the end"
        self.lit = self.still = colours

    def blank(self) -> None:
        self.failures.step("blank", BoardError)
        self.still, self.lit = None, np.zeros((12, 3), np.uint8)

    def configuration(self) -> Configuration:
        self.failures.step("configuration", BoardError)
        return self.memory

    def configure(self, configuration: Configuration, *, save: bool) -> None:
        self.failures.step("configure", BoardError)
        self.memory = replace(configuration)
        self.failures.step("configured", BoardError)


class Controls(SimulatedControls):
    """Exposure, gain and white balance."""

    def __init__(self, failures: Failures) -> None:
        super().__init__(lambda exposure_us, gains: None)
        self.failures = failures

    def set(self, name: str, value: float) -> float:
        self.failures.step(name, CameraError)
        return super().set(name, value)


class LitCamera(FlatCamera):
    """Gives the untouched gel of the linear sensor, and knows how it is set and lit."""

    url = "lit"

    def __init__(self) -> None:
        super().__init__(10**9, CameraError("never"), period_s=0.002)
        self.failures = Failures()
        self.ring: Any = Board(self.failures)
        self.controls: Any = Controls(self.failures)

    def setting(self) -> tuple[dict[str, float], list[list[int]]]:
        """Controls and LEDs, to be compared."""
        return {name: self.controls.read(name) for name in self.controls.names()}, self.ring.lit.tolist()

    def close(self) -> None:
        super().close()
        self.ring.lit, self.ring.closed = np.zeros((12, 3), np.uint8), True
