"""What the core should do, written down a second time from docs/protocol.md, in another language and another way.

The C core advances a state machine; this model keeps a list of what was asked and computes lights from it.
"""

import itertools
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from gellight.ring import protocol as p
from gellight.ring.enumerations import Status, SyncMode

BLACK = bytes(36)
TRANSFER_US = 660
QUIESCENT_UA, CHANNEL_UA = 1000, 20000
LIMIT_MA = 450
Answer = tuple[int, int, tuple[int, int] | None]
OK: Answer = (Status.OK, 0, None)


@dataclass
class Table:
    groups: list[bytes] = field(default_factory=lambda: [BLACK] * 16)
    steps: dict[int, p.SetStep] = field(default_factory=dict)
    count: int = 0
    loops: int = 0

    def showings(self) -> Iterator[p.SetStep]:
        passes = itertools.count() if self.loops == 0 else range(self.loops)
        for _ in passes:
            for index in range(self.count):
                yield from itertools.repeat(self.steps[index], self.steps[index].repeat)


class CoreModel:
    def __init__(self, now_us: int) -> None:
        self.now_us = now_us
        self.staged, self.active = Table(), Table()
        self.mode = SyncMode.FREE
        self.running = False
        self.lights: list[tuple[int, bytes]] = []
        self.busy_until_us = 0
        self._over_us: int | None = None
        self._showings: Iterator[p.SetStep] = iter(())
        self._planned: Iterator[tuple[int, bytes, bool]] = iter(())
        self._next: tuple[int, bytes, bool] | None = None

    # ---- current ----

    def current_ma(self, colours: bytes) -> int:
        microamperes = 12 * QUIESCENT_UA + -(-sum(colours) * CHANNEL_UA // 255)
        return -(-microamperes // 1000)

    def _limit_answer(self, colours: bytes) -> Answer:
        current_ma = self.current_ma(colours)
        return (Status.OVER_CURRENT, current_ma, None) if current_ma > LIMIT_MA else (Status.OK, 0, (current_ma, 65535))

    def _light(self, at_us: int, colours: bytes) -> None:
        assert self.current_ma(colours) <= LIMIT_MA
        at_us = max(at_us, self.busy_until_us)  # a transfer that has begun is never torn
        self.lights.append((at_us, colours))
        self.busy_until_us = at_us + TRANSFER_US

    # ---- time ----

    def advance(self, duration_us: int) -> None:
        self.now_us += duration_us
        while self._next and self._next[0] <= self.now_us:
            at_us, colours, last = self._next
            self._light(at_us, colours)
            if last:
                self._over_us = self.busy_until_us
            self._next = next(self._planned, None)
        if self._over_us is not None and self._over_us <= self.now_us:
            self._end()

    def _free(self, at_us: int) -> Iterator[tuple[int, bytes, bool]]:
        for step in self._showings:
            yield at_us, self.active.groups[step.group], False
            at_us += step.dwell_us
            if step.blank_us:
                yield at_us, BLACK, False
                at_us += step.blank_us
        yield at_us, BLACK, True

    # ---- requests ----

    def ask(self, name: str, record: p.Record) -> Answer:
        answer: Answer = getattr(self, name.lower())(record)
        return answer

    def set_leds(self, record: p.SetLeds) -> Answer:
        if self.running:
            return Status.BUSY, 0, None
        answer = self._limit_answer(record.colours)
        if answer[0] == Status.OK:
            self._light(self.now_us, record.colours)
        return answer

    def blank(self, _: p.Record) -> Answer:
        self._end()
        self._light(self.now_us, BLACK)
        return OK

    def stop(self, _: p.Record) -> Answer:
        if not self.running:
            return Status.NOT_RUNNING, 0, None
        self._end()
        return OK

    def _end(self) -> None:
        self.running = False
        self._next, self._planned, self._over_us = None, iter(()), None

    def set_group(self, record: p.SetGroup) -> Answer:
        if record.group > 15:
            return Status.OUT_OF_RANGE, record.group, None
        answer = self._limit_answer(record.colours)
        if answer[0] == Status.OK:
            self.staged.groups[record.group] = record.colours
        return answer

    def set_step(self, record: p.SetStep) -> Answer:
        bounds = ((record.step, 0, 31), (record.group, 0, 15), (record.repeat, 1, 65535))
        for value, low, high in bounds:
            if not low <= value <= high:
                return Status.OUT_OF_RANGE, value, None
        for duration in (record.dwell_us, record.blank_us):
            if duration and not 2000 <= duration <= 60_000_000:
                return Status.OUT_OF_RANGE, duration, None
        self.staged.steps[record.step] = record
        return OK

    def commit(self, record: p.Commit) -> Answer:
        if not 1 <= record.step_count <= 32:
            return Status.OUT_OF_RANGE, record.step_count, None
        crc = self.table_crc(record.step_count)
        if crc != record.table_crc:
            return Status.CHECKSUM, crc, None
        problem = self._problem(self.staged, record.step_count)
        if problem:
            return problem
        self.active = Table(list(self.staged.groups), dict(self.staged.steps), record.step_count, record.loops)
        return OK

    def table_crc(self, count: int) -> int:
        empty = p.SetStep(0, 0, 0, 0, 0)
        steps = [self.staged.steps.get(index, empty).pack() for index in range(count)]
        return zlib.crc32(b"".join(self.staged.groups) + b"".join(steps))

    def _problem(self, table: Table, count: int) -> Answer | None:
        for index in range(count):
            step = table.steps.get(index)
            if step is None or (self.mode == SyncMode.FREE and not step.dwell_us):
                return Status.OUT_OF_RANGE, index, None
            answer = self._limit_answer(table.groups[step.group])
            if answer[0] != Status.OK:
                return answer
        return None

    def set_sync(self, record: p.SetSync) -> Answer:
        if self.running:
            return Status.BUSY, 0, None
        if record.mode > 1:
            return Status.OUT_OF_RANGE, record.mode, None
        self.mode = SyncMode(record.mode)
        return OK

    def start(self, _: p.Record) -> Answer:
        if self.running:
            return Status.BUSY, 0, None
        if not self.active.count:
            return Status.NOT_RUNNING, 0, None
        problem = self._problem(self.active, self.active.count)
        if problem:
            return problem
        self.running = True
        self._showings = self.active.showings()
        if self.mode == SyncMode.FREE:
            self._planned = self._free(self.now_us + 2000)
            self._next = next(self._planned)
        return OK
