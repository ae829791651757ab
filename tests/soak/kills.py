"""Faults drawn at random over everything that writes: `python -m tests.soak.kills FAULTS [SEED [KIND...]]`.

A process is killed or stopped at a random moment of its act, or its files may not grow beyond a random number of bytes,
as on a full disk. Afterwards what is there has to be old or new, the same act has to work at once, and a refusal has to
name the place. Ends with 1 where something did not hold. writers.py has the acts.
"""

import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from gellight.base.errors import GellightError
from tests.soak.writers import Writer, prepare, writers

PATIENCE_S = 60.0
DONE, REFUSED, FAULT = 0, 2, 3


class Blow(StrEnum):
    KILLED = "killed"
    STOPPED = "stopped, and another one meanwhile"
    NO_LARGER_FILE = "a file may not grow"


WEIGHTS = {Blow.KILLED: 6, Blow.NO_LARGER_FILE: 4}
"""how often a fault is drawn, if not once"""


class BrokenError(Exception):
    """Something did not hold."""


@dataclass
class Tally:
    tried: int = 0
    passed: int = 0
    worst_s: float = 0.0
    """the next start, from its beginning until its act was done"""
    broken: Counter[str] = field(default_factory=Counter)


class Child:
    """A process that does one thing, and what it said."""

    def __init__(self, act: Callable[[], object]) -> None:
        self._said = os.memfd_create("said")
        self.pid = os.fork()
        if self.pid == 0:
            status = FAULT
            try:
                status = self._do(act)
            finally:  # what is above is the parent's
                os._exit(status)

    def _do(self, act: Callable[[], object]) -> int:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        try:
            act()
        except (GellightError, OSError) as error:
            return self._say(f"{type(error).__name__}: {error}", REFUSED)
        except BaseException:
            return self._say(traceback.format_exc(), FAULT)
        return DONE

    def _say(self, text: str, status: int) -> int:
        with suppress(OSError):
            resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        os.write(self._said, text.encode())
        return status

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; the process is not waited for, so its number is still its own."""
        os.kill(self.pid, number)

    def wait(self) -> tuple[int, str]:
        """Return the exit status, negative for a signal, and what was said; BrokenError where it does not end."""
        patience_s = time.monotonic() + PATIENCE_S
        while (ended := os.waitpid(self.pid, os.WNOHANG))[0] == 0:
            if time.monotonic() > patience_s:
                self.signal(signal.SIGKILL)
                os.waitpid(self.pid, 0)
                raise BrokenError(f"does not end in {PATIENCE_S:g} s")
            time.sleep(0.0005)
        with os.fdopen(self._said, "r+b") as stream:
            stream.seek(0)
            return os.waitstatus_to_exitcode(ended[1]), stream.read().decode()


def without_growth(writer: Writer, home: Path, most: int) -> None:
    """Do the act where no file may be larger than `most` bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
    writer.act(home)


def did(act: Callable[[], object]) -> tuple[int, str]:
    """Do something in a process of its own; return its status and what it said."""
    return Child(act).wait()


class Faults:
    def __init__(
        self, seed: int, folder: Path,
        chosen: Callable[[Path], tuple[Writer, ...]] = writers, blows: tuple[Blow, ...] = tuple(Blow),
    ) -> None:  # fmt: skip
        """Write what the acts read, and measure how long each lasts undisturbed; chosen: makes the acts."""
        self._random, self._folder, self.blows = random.Random(seed), folder, blows
        (folder / "sources").mkdir()
        prepare(folder / "sources")
        self.writers = chosen(folder / "sources")
        self.tallies: dict[tuple[str, Blow], Tally] = {}
        self._lasts_s = {writer.name: min(self._undisturbed(writer) for _ in range(2)) for writer in self.writers}

    def _undisturbed(self, writer: Writer) -> float:
        home = self._home(writer)
        begun_s = time.monotonic()
        status, said = did(lambda: writer.act(home))
        lasted_s = time.monotonic() - begun_s
        if status != DONE or did(lambda: writer.judge(home))[0] != DONE:
            raise SystemExit(f"{writer.name} does not work undisturbed: {said}")
        return lasted_s

    def _home(self, writer: Writer) -> Path:
        shutil.rmtree(self._folder / "home", ignore_errors=True)
        home = self._folder / "home"
        home.mkdir()
        writer.begin(home)
        return home

    def one(self) -> None:
        (writer,) = self._random.choices(self.writers, [writer.weight for writer in self.writers])
        (blow,) = self._random.choices(self.blows, [WEIGHTS.get(blow, 1) for blow in self.blows])
        tally = self.tallies.setdefault((writer.name, blow), Tally())
        tally.tried += 1
        try:
            self._strike(writer, blow, tally)
            tally.passed += 1
        except BrokenError as error:
            tally.broken[str(error)] += 1

    def _strike(self, writer: Writer, blow: Blow, tally: Tally) -> None:
        home, moment_s = self._home(writer), self._random.uniform(0, 1.1) * self._lasts_s[writer.name]
        if blow is Blow.NO_LARGER_FILE:
            most = int(10 ** self._random.uniform(0, 5))
            self._refusal(*did(lambda: without_growth(writer, home, most)), home)
        else:
            struck = Child(lambda: writer.act(home))
            time.sleep(moment_s)
            struck.signal(signal.SIGKILL if blow is Blow.KILLED else signal.SIGSTOP)
            if blow is Blow.STOPPED:
                status, said = did(lambda: writer.act(home))
                struck.signal(signal.SIGCONT)
                self._no_fault("the other one", status, said)
            status, said = struck.wait()
            self._no_fault("the struck one", status, said)
        self._go_on(writer, home, tally)

    def _go_on(self, writer: Writer, home: Path, tally: Tally) -> None:
        """Judge what is there, do the act again, and judge again."""
        self._holds("what is left is neither old nor new", did(lambda: writer.judge(home)))
        begun_s = time.monotonic()
        status, said = did(lambda: writer.act(home))
        if not (status == REFUSED and "exists: " in said):  # it was done before the fault came
            self._holds("the next start fails", (status, said))
        tally.worst_s = max(tally.worst_s, time.monotonic() - begun_s)
        self._holds("after the next start it is neither old nor new", did(lambda: writer.judge(home)))

    def _refusal(self, status: int, said: str, home: Path) -> None:
        """Raise BrokenError for a refusal that names no place, and for another ending."""
        self._no_fault("the act", status, said)
        if status == REFUSED and str(home) not in said:
            raise BrokenError(f"a refusal names no place: {said}")

    @staticmethod
    def _no_fault(who: str, status: int, said: str) -> None:
        if status not in (DONE, REFUSED, -signal.SIGKILL):
            raise BrokenError(f"{who} ended with {status}: {(said.splitlines() or [''])[-1]}")

    @staticmethod
    def _holds(what: str, ended: tuple[int, str]) -> None:
        if ended[0] != DONE:
            raise BrokenError(f"{what}: {(ended[1].splitlines() or [str(ended[0])])[-1]}")


def table(tallies: dict[tuple[str, Blow], Tally]) -> str:
    lines = [f"{'act':20}{'fault':38}{'tried':>6}{'passed':>7}{'worst':>8}"]
    for (name, blow), one in sorted(tallies.items()):
        lines.append(f"{name:20}{blow:38}{one.tried:6d}{one.passed:7d}{one.worst_s:6.2f} s")
        lines += [f"    {count} x {text}" for text, count in one.broken.most_common(3)]
    tried, passed = (sum(getattr(one, what) for one in tallies.values()) for what in ("tried", "passed"))
    return "\n".join([*lines, f"{passed} of {tried} faults passed"])


def faults(count: int, seed: int, blows: tuple[Blow, ...]) -> dict[tuple[str, Blow], Tally]:
    """Make that many faults; return what became of them, by act and kind."""
    with tempfile.TemporaryDirectory(prefix="gellight-faults-") as folder:
        drawn = Faults(seed, Path(folder), blows=blows)
        for _ in range(count):
            drawn.one()
        return drawn.tallies


def main() -> int:
    """Make as many faults as are asked for, of the kinds that are named (`KILLED STOPPED`) or of all."""
    count, seed = (int(sys.argv[at]) if len(sys.argv) > at else least for at, least in ((1, 200), (2, 1)))
    found = faults(count, seed, tuple(Blow[name] for name in sys.argv[3:]) or tuple(Blow))
    print(table(found))
    return 0 if all(one.passed == one.tried for one in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
