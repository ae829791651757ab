"""A world of which everything is known: a board, its light, a camera and the serial line, at random; and the truth.

The truth is in the host's time. A frame is truly clean under a group when every row receives what it would receive if
that group had shone all along, with the same phases of the LEDs' pulse-width modulation; since both are computed with
those phases, bands from the modulation cancel, and the tolerance is rounding alone. Every other frame is truly mixed,
however little of another light it has; frames wholly in the dark are neither.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from gellight.frames.camera import CameraTiming
from gellight.frames.frames import LightLabel, LightState
from gellight.lab.core_board.light_timeline import Light
from gellight.lab.simulator.shutter import Shutter, row_weights
from gellight.ring import protocol
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.ring.light_ring import Ping
from gellight.sensor.lighting.clock import ClockMap
from gellight.sensor.lighting.label import label_frame
from gellight.sensor.lighting.timeline import KnownLight

ROWS = 9
ROUNDING = 1e-6
DARK = np.zeros((12, 3), np.uint8)
RING = np.zeros((12, 3), np.uint8)
for third in range(3):
    RING[4 * third : 4 * third + 4, third] = 255


@dataclass
class World:
    """One sequence of lights in front of one camera."""

    rng: np.random.Generator
    typical: bool = False
    """a 30 Hz camera and a held light as they are used, instead of anything at all"""
    frames: int = 40
    counters: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._draw_camera()
        self._draw_clock()
        self._draw_light()

    # ---- what is drawn ----

    def _draw_camera(self) -> None:
        rng = self.rng
        self.period_s = 1 / 30 if self.typical else 1 / rng.uniform(15, 120)
        readout = 0.012 if self.typical else rng.uniform(0.02, 1.0) * self.period_s
        exposure = 0.008 if self.typical else rng.uniform(0.02, 0.99) * self.period_s
        error = 0.001 if self.typical else rng.choice([0.0, 1e-4, 1e-3, 3e-3])
        pulse = 5e-4 if self.typical else rng.uniform(3e-4, 2.5e-3)
        self.timing = CameraTiming(
            exposure_s=exposure, readout_s=readout, period_s=self.period_s, stamp_error_s=error,
            pulse_period_s=0.0025 if self.typical else pulse * rng.choice([1.0, 1.2]),
        )  # fmt: skip
        self.shutter = Shutter(
            exposure_us=max(exposure + rng.uniform(-0.25, 0.25) * error, 1e-5) * 1e6,
            readout_us=max(readout + rng.uniform(-0.25, 0.25) * error, 0.0) * 1e6,
            pulse_period_us=pulse * 1e6,
        )
        self.phases_us = rng.random(12) * pulse * 1e6
        self.begin_s = rng.uniform(10, 1e5)
        self.stamps_s = self.begin_s + 0.5 + self.period_s * (np.arange(self.frames) + rng.random())
        self.starts_s = self.stamps_s + rng.uniform(-0.5, 0.5, self.frames) * error
        self.kept = rng.random(self.frames) > rng.choice([0.0, 0.1])
        self.transfer_s = rng.uniform(0.001, 0.04)

    def _draw_clock(self) -> None:
        rng = self.rng
        self.offset_us = rng.uniform(-1e9, 1e9)
        self.drift = rng.uniform(-150e-6, 150e-6)
        self.stall_at_s = self.begin_s + rng.uniform(0, 2)
        self.stall_s = 0.0 if self.typical or rng.random() < 0.9 else rng.uniform(0.02, 0.08)
        """the board's time stands still for this time, as an emulated one does on a busy machine"""
        self.jitter_s = rng.choice([1e-4, 1e-3, 5e-3]) if not self.typical else 5e-4

    def board_us(self, host_s: float) -> float:
        stalled = np.clip(host_s - self.stall_at_s, 0.0, self.stall_s)
        return float((host_s - stalled - self.begin_s) * 1e6 * (1 + self.drift) + self.offset_us)

    def host_us(self, board_us: float) -> float:
        host_s = (board_us - self.offset_us) * 1e-6 / (1 + self.drift) + self.begin_s
        return (host_s + self.stall_s * (host_s > self.stall_at_s)) * 1e6

    def _draw_light(self) -> None:
        rng = self.rng
        sets = [colour_triples(RING), single_leds(RING), (RING * rng.random((5, 12, 3))).astype(np.uint8)]
        self.groups = sets[rng.integers(3)]
        steps = rng.integers(0, len(self.groups), rng.integers(2, 7))
        frames = rng.choice([2.0, 3.0]) if self.typical else rng.choice([rng.uniform(0.3, 5), 1.0, 2.0, 3.0])
        dwell_us = max(frames * self.period_s * 1e6 * (1 + rng.uniform(-1e-4, 1e-4)), 1000.0)
        blank_us = 0.0 if self.typical else rng.choice([0.0, 0.0, 0.0, rng.uniform(1000, 2e4)])
        disturbed, lost = (0.0, 0.0) if self.typical else rng.choice([0.0, 0.03], 2)
        self.planned = blank_us == 0
        self.dwell_us = dwell_us
        self.lights: list[Light] = [Light(0.0, DARK)]
        self.events: list[tuple[float, protocol.LightEvent]] = []
        """when the board reported it, its own time, and the event; lost ones are not here"""
        self.light_ids: list[tuple[float, int]] = [(-np.inf, 6)]
        due_us, number, end_us = self.board_us(self.begin_s) + 1000.0, 0, self.board_us(self.stamps_s[-1] + 1)
        while due_us < end_us:
            step = number % len(steps)
            self._show(due_us, int(steps[step]), self.groups[steps[step]], disturbed, lost)
            if blank_us:
                self._show(due_us + dwell_us, protocol.NO_STEP, DARK, disturbed, lost)
            due_us += dwell_us + blank_us
            number += 1

    def _show(self, due_us: float, group: int, colours: np.ndarray, disturbed: float, lost: float) -> None:
        rng = self.rng
        first_us = due_us + (rng.uniform(8, 11) if rng.random() < 0.002 else 0.0)
        if rng.random() < disturbed:
            garbage = rng.integers(0, 256, (12, 3)).astype(np.uint8)
            self._latch(first_us + rng.uniform(50, 360) + rng.uniform(50, 300), garbage)
            first_us += rng.uniform(700, 1200)
        self._latch(first_us + 360 + rng.uniform(50, 300), colours)
        latched_us = first_us + 661
        reported_us = latched_us + rng.uniform(0, 200)
        light_id = self.light_ids[-1][1] + 1
        self.light_ids.append((reported_us, light_id))
        event = protocol.LightEvent(round(first_us - 0.5), round(latched_us + 0.5), light_id, 0, 0, 0, 0, group)
        if rng.random() >= lost:
            self.events.append((reported_us, event))

    def _latch(self, board_us: float, colours: np.ndarray) -> None:
        self.lights.append(Light(self.host_us(board_us), colours))

    # ---- what the host sees ----

    def labels(self) -> Iterator[tuple[int, LightLabel]]:
        """Yield the number of each frame that was not dropped, and the label that the host gives it."""
        plan = (lambda last, event: self.dwell_us) if self.planned else (lambda last, event: None)
        self.clock = ClockMap()
        self.light = KnownLight(pulse_period_us=self.timing.pulse_period_s * 1e6, plan=plan)
        self._reported = 0
        arrivals = self.starts_s + (self.shutter.duration_us * 1e-6) + self.transfer_s
        asked = [(t, -1) for t in np.arange(self.begin_s + 0.1, self.stamps_s[-1], 0.25)]
        asked += [(t, n) for n, t in enumerate(arrivals) if self.kept[n]]
        now_s = 0.0
        for time_s, number in sorted(asked):
            now_s = self._ask(max(now_s, time_s))
            if number >= 0:
                for _ in range(2):  # a slow answer proves little, and the host asks again
                    if not self.clock.covers(*self.timing.span_s(self.stamps_s[number])):
                        now_s = self._ask(now_s)
                yield number, label_frame(self.clock, self.light, self.timing, self.stamps_s[number], ROWS)

    def _ask(self, host_s: float) -> float:
        """Ask the board for its status; events come before the reply. Returns when the reply was there."""
        there, back = 1e-4 + self.rng.exponential(self.jitter_s), 1e-4 + self.rng.exponential(3 * self.jitter_s)
        board_us = int(self.board_us(host_s + there))
        jumps = self.clock.jumps
        while self._reported < len(self.events) and self.events[self._reported][0] <= board_us:
            self.light.note_event(self.events[self._reported][1])
            self._reported += 1
        ping = Ping(host_sent_s=host_s, board_received_us=board_us, board_sent_us=board_us,
                    host_received_s=host_s + there + back)  # fmt: skip
        self.clock.add(ping)
        if self.clock.jumps > jumps:
            self.light.clear()
        light_id = next(light_id for reported, light_id in reversed(self.light_ids) if reported <= board_us)
        self.light.note_status(replace(NO_STATUS, time_us=board_us, light_id=light_id))
        return host_s + there + back

    # ---- the truth ----

    def truth(self, number: int) -> LightLabel | None:
        """Return what a frame truly is; None for one wholly in the dark."""
        start_us = self.starts_s[number] * 1e6
        times = self._times
        first = np.searchsorted(times, start_us - 2 * self.shutter.pulse_period_us, side="right") - 1
        last = np.searchsorted(times, start_us + self.shutter.duration_us)
        lights = self.lights[max(first, 0) : last]
        if all((light.colours == lights[0].colours).all() for light in lights):
            return self._name(lights[0].colours)
        seen = row_weights(lights, start_us, ROWS, self.phases_us, self.shutter)
        for light in {light.colours.tobytes(): light for light in lights}.values():
            pure = row_weights([Light(0.0, light.colours)], start_us, ROWS, self.phases_us, self.shutter)
            if np.abs(seen - pure).max() < ROUNDING:
                return self._name(light.colours)
        return LightLabel(state=LightState.MIXED)

    def _name(self, colours: np.ndarray) -> LightLabel | None:
        if not colours.any():
            return None
        same = [g for g, group in enumerate(self.groups) if (group == colours).all()]
        return LightLabel(state=LightState.CLEAN, group=same[0]) if same else LightLabel(state=LightState.MIXED)

    @property
    def _times(self) -> np.ndarray:
        if not hasattr(self, "_latched"):
            self._latched = np.array([light.time_us for light in self.lights])
        return self._latched


NO_STATUS = protocol.StatusReply(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def compare(worlds: int, seed: int, *, typical: bool = False) -> dict[tuple[str, str], int]:
    """Count frames by (truth, label) over that many worlds; a clean label with the wrong group is "wrong group"."""
    counts: dict[tuple[str, str], int] = {}
    for number in range(worlds):
        world = World(np.random.default_rng([seed, number]), typical=typical)
        for frame, label in world.labels():
            truth = world.truth(frame)
            said = str(label.state)
            if truth and truth.state == label.state == LightState.CLEAN and truth.group != label.group:
                said = "wrong group"
            key = (str(truth.state) if truth else "dark", said)
            counts[key] = counts.get(key, 0) + 1
    return counts
