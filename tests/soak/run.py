"""A soak: hours of faults on a simulated sensor, with everything that has to hold checked all the time.

The quiet between two faults is cut to `QUIET_S`: a minute of frames says no more than two seconds of them. Faults and
all that the product waits for take the time that they take.
"""

import logging
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gellight.base.errors import GellightError, InputError
from gellight.bundle.bundle import Bundle, write_bundle
from tests.helpers.small_bundles import ordinary
from tests.helpers.terminal_board import TerminalBoard
from tests.soak.faults import JUMP_S, FaultKind, PlannedFault, maltreat, plan
from tests.soak.hardware import SERIAL, SHUTTER, SoakSensor, digitised
from tests.soak.judging import (
    DARK_WITHIN_S,
    FEWEST,
    FIRST_RESTS,
    RECOVERY_S,
    Holdings,
    Invariant,
    Judge,
    Patience,
    Violation,
    handle_growth,
    memory_growth_mb,
)
from tests.soak.labelling import Labelling
from tests.soak.pressed_gel import BITS, PIXEL_MM, PressedGel, marked
from tests.soak.shift import Shift
from tests.soak.working import Work

logger = logging.getLogger(__name__)
REFERENCE_FRAMES = 30
QUIET_S = 2.0
GIVE_UP_S = 30.0
FAULTS_A_SHIFT = 8
POLL_S = 0.02
PROGRESS_S, STEPS = 20.0, 6
"""so long a fault waits until a calibration has gone on by so much"""


@dataclass
class Outcome:
    count: int = 0
    worst_recovery_s: float = 0.0
    """from the end of a fault to the start of the next sound frame's exposure that was delivered"""


@dataclass
class Report:
    seed: int
    simulated_s: float = 0.0
    wall_s: float = 0.0
    starved_s: float = 0.0
    """for so long the process was kept from the processor"""
    frames: int = 0
    labels: int = 0
    """frames that were called clean, and judged"""
    slowest_label_s: float = 0.0
    """from the end of a fault until a frame was called clean again, on virtual time"""
    memory_growth_mb: float = 0.0
    work: Work = field(default_factory=Work)
    faults: dict[str, Outcome] = field(default_factory=dict)
    violations: list[Violation] = field(default_factory=list)
    not_judged: list[Invariant] = field(default_factory=list)

    def add_labels(self, labelling: Labelling) -> None:
        judge = labelling.judge
        self.labels, self.slowest_label_s = self.labels + judge.labels, labelling.slowest_s
        self.violations += judge.violations
        if judge.labels:
            judged = Invariant.LABEL, Invariant.FIRMWARE
            self.not_judged = [invariant for invariant in self.not_judged if invariant not in judged]

    @property
    def passed(self) -> bool:
        return not self.violations and not self.not_judged


@dataclass(frozen=True)
class _Moment:
    """A moment on the clocks by which a recovery is measured."""

    time_s: float
    starved_s: float


class WallClock:
    """The time of day of this process, which can jump."""

    def __init__(self) -> None:
        self.error_s = 0.0
        self._time, self._time_ns = time.time, time.time_ns

    @contextmanager
    def in_force(self) -> Iterator["WallClock"]:
        """Let everything in this process go by this clock."""
        time.time = lambda: self._time() + self.error_s
        time.time_ns = lambda: self._time_ns() + int(self.error_s * 1e9)
        try:
            yield self
        finally:
            time.time, time.time_ns = self._time, self._time_ns


class Soak:
    """Makes the faults of a plan, and waits after each until the product has recovered."""

    def __init__(
        self, seed: int, folder: Path, note: Callable[[str], object] = logger.info, *, works: bool = True
    ) -> None:
        """Make a sensor and its bundle in `folder`; `note` is told what happens. works: somebody works with it."""
        self.report = Report(seed)
        self._note, self._works = note, works
        self.sensor = SoakSensor(folder / "bus", seed)
        self._bundle = soak_bundle(folder / "bundle", self.sensor.gel)
        self.judge = Judge(self.sensor)
        self.patience, self.clock = Patience(), WallClock()
        self._folder, self._random = folder, random.Random(seed)
        self._samples: list[Holdings] = []
        self._rests: list[Holdings] = []
        self._begun_s = time.monotonic()
        self._done = threading.Event()
        self._make: Mapping[FaultKind, Callable[[PlannedFault, Shift], None]] = {
            FaultKind.SILENCE: self._silence, FaultKind.WALL_CLOCK: self._wall_clock,
            FaultKind.FULL_DISK: self._full_disk,
            FaultKind.SUBSCRIBER_KILLED: self._kill_reader, FaultKind.SUBSCRIBER_FROZEN: self._freeze_reader,
            FaultKind.HOST_KILLED: self._kill_host,
        }  # fmt: skip

    def run(self, faults: Iterator[PlannedFault]) -> Report:
        """Make every fault of the plan; return what was found."""
        left, sequenced = deque(faults), False
        with ExitStack() as stack:
            stack.enter_context(self.clock.in_force())
            stack.callback(self.patience.close)
            stack.callback(self.sensor.close)
            stack.callback(self._done.set)
            self.sensor.plug()
            threading.Thread(target=self._sample, name="holdings", daemon=True).start()
            while left:
                self._shift(left, sequenced=sequenced)
                sequenced = not sequenced
        return self._conclude()

    def _shift(self, left: deque[PlannedFault], *, sequenced: bool) -> None:
        """Run a daemon through some of the faults that are left, and end it, earlier where it does not recover."""
        try:
            work = self.report.work if self._works and not sequenced else None
            with Shift(self.sensor, self._bundle, self.judge, self._folder, sequenced=sequenced, work=work) as shift:
                self._recover(None, shift)
                for number in range(min(FAULTS_A_SHIFT, len(left))):
                    self._quiet(shift, number)
                    if self._one(left.popleft(), shift) > GIVE_UP_S / 2:
                        break
        except GellightError as error:
            if left:
                left.popleft()
            self.judge.broken(Invariant.RUNNING, f"a daemon did not start or end: {error}")
        self._expect_dark("the daemon ended")
        self._rests.append(Holdings.now(time.monotonic() - self._begun_s))

    def _quiet(self, shift: Shift, number: int) -> None:
        """Let there be peace before the next fault; while the sensor is calibrated, until that went on."""
        time.sleep(QUIET_S)
        if shift.working is None:
            return
        if 2 * number == FAULTS_A_SHIFT:
            shift.working.rest()
        end_s, before = time.monotonic() + PROGRESS_S, shift.working.progress
        while shift.working.calibrating and shift.working.progress < before + STEPS and time.monotonic() < end_s:
            time.sleep(POLL_S)

    def _one(self, fault: PlannedFault, shift: Shift) -> float:
        """Make a fault; return how long the recovery took."""
        try:
            if fault.kind in self._make:
                self._make[fault.kind](fault, shift)
            else:
                maltreat(self.sensor, fault, time.sleep)
        except GellightError as error:
            self.judge.broken(Invariant.RUNNING, f"{fault.kind}: {error}")
        recovery_s = self._recover(fault.kind, shift)
        self.judge.looked_at(Invariant.RUNNING, Invariant.RECOVERY)
        outcome = self.report.faults.setdefault(fault.kind, Outcome())
        outcome.count += 1
        outcome.worst_recovery_s = max(outcome.worst_recovery_s, recovery_s)
        how = "sequence" if shift.sequenced else "still"
        self._note(f"{fault.at_s / 3600:6.2f} h  {fault.kind:18} {fault.seconds:4.1f} s  {how:8}  {recovery_s:5.2f} s")
        self.report.simulated_s = fault.at_s
        return recovery_s

    def _recover(self, kind: FaultKind | None, shift: Shift) -> float:
        """Wait for a sound frame that was exposed from now on; return how long that took, without starved time."""
        began, told = self._moment(), dict[str, None]()
        while (taken_s := self._since(began)) < GIVE_UP_S:
            error = shift.daemon.status()["error"]
            if error is not None:
                told[re.sub(r"since [0-9.]+ s", "for a while", str(error))] = None
            elif self.judge.newest_start_s > began.time_s:
                break
            time.sleep(POLL_S)
        if kind and taken_s > RECOVERY_S:
            how = "sequence" if shift.sequenced else "still"
            why = "; ".join(told) or "no error was told"
            self.judge.broken(Invariant.RECOVERY, f"{taken_s:.1f} s after {kind}, {how}: {why}")
        return taken_s

    def _moment(self) -> "_Moment":
        return _Moment(time.monotonic(), self.patience.starved_s)

    def _since(self, began: "_Moment") -> float:
        """Return how long ago that was, s, without the time in which this process was starved."""
        now = self._moment()
        return now.time_s - began.time_s - (now.starved_s - began.starved_s)

    def _within(self, holds: Callable[[], bool]) -> bool:
        """Wait until something holds; whether it did before `GIVE_UP_S` had passed, without starved time."""
        began = self._moment()
        while not (held := holds()) and self._since(began) < GIVE_UP_S:
            time.sleep(POLL_S)
        return held

    def _expect_dark(self, why: str) -> None:
        """Wait as long as it may shine on without its host; then it is dark."""
        self.judge.looked_at(Invariant.DARK)
        begun_s = time.monotonic()
        while self.sensor.lit():
            if time.monotonic() - begun_s > DARK_WITHIN_S:
                self.judge.broken(Invariant.DARK, f"the LEDs shine {DARK_WITHIN_S} s after {why}")
                return
            time.sleep(POLL_S)

    # ---- faults ----

    def _silence(self, fault: PlannedFault, _: Shift) -> None:
        def wait(seconds: float) -> None:
            begun_s = time.monotonic()
            self._expect_dark("the host fell silent")
            time.sleep(max(begun_s + seconds - time.monotonic(), 0.0))

        maltreat(self.sensor, fault, wait)

    def _wall_clock(self, fault: PlannedFault, _: Shift) -> None:
        self.clock.error_s += (2 * fault.strength - 1) * JUMP_S

    def _full_disk(self, fault: PlannedFault, shift: Shift) -> None:
        """Let files grow no more, which a program learns as it learns of a full disk: its write fails.

        Not while the sensor is calibrated: of the few frames that come then a chunk takes minutes.
        """
        if shift.working is not None:
            shift.working.rest()
        size = shift.recorder.path.stat().st_size
        if not self._within(lambda: shift.recorder.path.stat().st_size > size):
            self.judge.broken(Invariant.RECORDING, f"no chunk was recorded in {GIVE_UP_S:g} s")
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (shift.recorder.path.stat().st_size + 1, limits[1]))
        try:
            ended = self._within(lambda: shift.recorder.ended)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        if not ended:
            self.judge.broken(Invariant.RECORDING, "the disk was full, and the recorder did not say so")
        shift.record_anew()

    def _kill_reader(self, _fault: PlannedFault, shift: Shift) -> None:
        shift.reader.signal(signal.SIGKILL)
        shift.read_anew()
        if not shift.reader.wait_for_frames():
            self.judge.broken(Invariant.READER, "a new subscriber gets no frames")

    def _freeze_reader(self, fault: PlannedFault, shift: Shift) -> None:
        shift.reader.signal(signal.SIGSTOP)
        time.sleep(fault.seconds)
        shift.reader.signal(signal.SIGCONT)
        if not shift.reader.wait_for_frames():
            self.judge.broken(Invariant.READER, "a subscriber that stood still gets no more frames")

    def _kill_host(self, _fault: PlannedFault, _: Shift) -> None:
        board = TerminalBoard()
        try:
            with subprocess.Popen(
                [sys.executable, Path(__file__).with_name("holder.py"), board.path], stdout=subprocess.PIPE, text=True
            ) as holder:
                if not (holder.stdout and holder.stdout.readline().strip() == "lit"):
                    self.judge.broken(Invariant.RUNNING, "a program could not light its board")
                holder.kill()
            time.sleep(DARK_WITHIN_S)
            if board.light_at(board.virtual_us(time.monotonic())).any():
                self.judge.broken(Invariant.DARK, "the LEDs shine on after their host was killed")
        finally:
            board.close()

    # ---- what is left at the end ----

    def _sample(self) -> None:
        while not self._done.wait(1.0):
            self._samples.append(Holdings.now(time.monotonic() - self._begun_s))

    def _conclude(self) -> Report:
        report, judge = self.report, self.judge
        growth, allowed = memory_growth_mb(self._samples)
        if len(self._samples) >= FEWEST:
            judge.looked_at(Invariant.MEMORY)
        if growth > allowed:
            judge.broken(Invariant.MEMORY, f"{growth:.1f} MB more in the last quarter than in the third")
        if len(self._rests) > FIRST_RESTS:
            judge.looked_at(Invariant.HANDLES)
        if self._rests and (more := handle_growth(self._rests)):
            judge.broken(Invariant.HANDLES, f"more than after the first two daemons: {more}")
        report.wall_s, report.starved_s = time.monotonic() - self._begun_s, self.patience.starved_s
        report.memory_growth_mb = growth
        report.frames, report.labels = judge.frames, judge.labels
        report.violations, report.not_judged = list(judge.violations), judge.not_judged()
        return report


def soak(seed: int, hours: float, note: Callable[[str], object] = logger.info) -> Report:
    """Soak a simulated sensor for that many simulated hours; `note` is told of every fault.

    Then the faults that were made are made once more on virtual time, for labels.
    Raises InputError where no fault of the plan falls into that time: such a run would say nothing.
    """
    if not any(True for _ in plan(seed, hours)):
        raise InputError(f"no fault of seed {seed} falls into {hours:g} h: give more hours")
    with tempfile.TemporaryDirectory(prefix="gellight-soak-") as folder:
        report = Soak(seed, Path(folder), note).run(plan(seed, hours))
    report.add_labels(labels(seed, plan(seed, hours), note))
    return report


def labels(seed: int, faults: Iterable[PlannedFault], note: Callable[[str], object] = logger.info) -> Labelling:
    """Judge labels of light through those of the faults that are of the sensor, on virtual time."""
    with tempfile.TemporaryDirectory(prefix="gellight-labels-") as folder:
        labelling = Labelling(seed, Path(folder) / "bus", soak_bundle(Path(folder) / "bundle", PressedGel()))
        labelling.run(faults, note)
    return labelling


def soak_bundle(folder: Path, gel: PressedGel) -> Bundle:
    """Write the bundle of the sensor: its gel at rest, the LEDs and the network of the shipped simulated sensor."""
    shipped = ordinary()
    assert shipped.colours is not None
    times = {"readout_us": SHUTTER.readout_us, "delay_us": 0.0}
    untouched, draw = gel.picture(shipped.colours.astype(float)), np.random.default_rng(0)
    numbers = [0, 2**BITS - 1] * (REFERENCE_FRAMES // 2)  # of which the mean shows none
    frames = [marked(digitised(untouched, draw), number) for number in numbers]
    return write_bundle(
        folder, sensor=SERIAL, reference=np.mean(frames, axis=0), reference_frames=REFERENCE_FRAMES, noise_grey=1.0,
        pixel_size_mm=(PIXEL_MM, PIXEL_MM), network=shipped.network, metrics={}, led=shipped.manifest.led,
        camera={"exposure_us": SHUTTER.exposure_us, "white_balance_k": 4600.0, "format": "YUYV", **times},
    )  # fmt: skip
