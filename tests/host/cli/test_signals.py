"""Ctrl-C and SIGTERM: every verb that runs long ends soon, with its status, without children, its LEDs dark."""

import os
import signal
import sys
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from subprocess import PIPE, STDOUT

import pytest

from tests.helpers.children import GELLIGHT, started
from tests.helpers.waiting import eventually

GUARD_S, READY_S = 100.0, 150.0
"""2 s are promised to end of a machine that is not busy with other tests; the time is printed"""
UNTIL_THEN = {signal.SIGINT: 0, signal.SIGTERM: 0}
"""status of a verb that runs until it is ended"""
BEFORE_DONE = {signal.SIGINT: 130, signal.SIGTERM: 143}


def family(mark: str) -> set[int]:
    """Return the processes that have `mark` in their environment; one that has ended has none any more."""
    found = set()
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (place / "environ").read_text(errors="replace"):
                found.add(int(place.name))
        except OSError:
            continue
    return found


@dataclass(frozen=True)
class Running:
    """A verb that runs: the processes that it started count, too."""

    process: int
    mark: str
    shown: Path


Ready = Callable[[Running], bool]


def printed(words: str) -> Ready:
    return lambda verb: words in verb.shown.read_text(errors="replace")


def children(count: int) -> Ready:
    return lambda verb: len(family(verb.mark)) > count


def written(file: str) -> Ready:
    return lambda verb: (verb.shown.parent / file).exists()


CASES = [
    (("demo", "--set", "dashboard.port=0", "--no-browser"), UNTIL_THEN, printed("dashboard: ")),
    (("demo", "--frames", "100000"), BEFORE_DONE, printed("dashboard: ")),
    (("run", "--sensor", "sim://?board=0", "--no-dashboard", "--json"), UNTIL_THEN, printed('"frames"')),
    (("ring", "set", "ff0000", "--url", "sim://"), UNTIL_THEN, printed("lit")),
    (("optimize", "coarse", "--workers", "2"), BEFORE_DONE, children(4)),
    (("calibrate", "--auto", "--sensor", "sim://?board=0"), BEFORE_DONE, written("calibration.state/presses")),
]  # fmt: skip


pause = partial(time.sleep, 0.05)
"""between looks through all processes"""
BY_CTRL_C = (CASES[0], CASES[3], CASES[-1])
"""one that runs until it is ended, one with a board, one with a child: a keyboard's signal takes the same way in all"""


def name(value: object) -> str:
    return " ".join(value) if isinstance(value, tuple) else ""


@pytest.mark.parametrize(
    ("arguments", "statuses", "ready", "number"),
    [(*case, signal.SIGTERM) for case in CASES] + [(*case, signal.SIGINT) for case in BY_CTRL_C],
    ids=lambda value: getattr(value, "name", name(value)),
)
def test_a_signal_ends_a_verb(
    arguments: tuple[str, ...], statuses: dict[int, int], ready: Ready, number: int, tmp_path: Path
) -> None:
    """Where the tests run in the background, and so ignore Ctrl-C, too."""
    mark, shown = f"gellight-{uuid.uuid4().hex}", tmp_path / "shown"
    environment = os.environ | {"TEST_MARK": mark, "PYTHONUNBUFFERED": "1"}
    environment |= {f"XDG_{kind}_HOME": str(tmp_path / kind) for kind in ("CACHE", "DATA", "STATE")}
    with (
        shown.open("wb") as output,
        started(
            [*GELLIGHT, *arguments],
            stdin=PIPE,
            stdout=output,
            stderr=STDOUT,
            env=environment,
            cwd=tmp_path,
            preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_IGN),
        ) as verb,  # fmt: skip
    ):
        running = Running(verb.pid, mark, shown)
        eventually(lambda: ready(running) or verb.poll() is not None or pause(), READY_S)
        assert verb.poll() is None, shown.read_text()
        begun_s = time.monotonic()
        verb.send_signal(number)
        status = verb.wait(GUARD_S)
        print(f"{' '.join(arguments)}: ended after {time.monotonic() - begun_s:.2f} s")
        text = shown.read_text(errors="replace")
        assert status == statuses[number], text
        assert "Traceback" not in text
        assert "Error:" not in text
        try:
            eventually(lambda: not family(mark) or pause(), READY_S)  # a child may be ending
        except AssertionError:
            left = {one: Path(f"/proc/{one}/cmdline").read_text().replace("\0", " ") for one in family(mark)}
            raise AssertionError(f"left: {left}") from None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_makes_the_leds_of_a_board_dark(number: int, tmp_path: Path) -> None:
    """The board is another process, which prints what its LEDs show."""
    shown = tmp_path / "shown"
    with (
        shown.open("wb") as output,
        started([sys.executable, "-m", "tests.helpers.terminal_board"], stdout=output) as board,
    ):
        eventually(lambda: "\n" in shown.read_text())
        path = shown.read_text().split()[0]
        with started([*GELLIGHT, "ring", "set", "102030", "--url", path], stdout=PIPE, text=True) as ring:
            eventually(lambda: lit(shown))
            assert "Ctrl-C ends" in ring.stdout.readline()
            ring.send_signal(number)
            assert ring.wait(GUARD_S) == 0
        # Not by the rule that a board darkens its LEDs when the computer is silent: that takes a second.
        eventually(lambda: not lit(shown))
        board.kill()


def lit(shown: Path) -> bool:
    """Whether the last line that a simulated board printed shows light."""
    colours = shown.read_text().rstrip("\n").splitlines()[-1].partition(" s  ")[2]
    return bool(set(colours) - set("0 "))
