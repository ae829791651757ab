"""Frames a second, and who takes the processor: `python -m tests.benchmarks.rate [--seconds 20] [--only WORD]`.

A simulated sensor (640 x 480, steady light without a board) with its page's server in a process of its own:
BALL and WAVE at 60 frames a second, BALL with the page open in Chromium, and nothing that touches at 30, without and
with the page. The same at rest with pictures as cameras send them, which come through a simulated kernel and are
decoded: no simulation takes part in that. Rates mean something on a quiet machine alone. Processor time is of the
threads, as a share of one core and of a frame; "without the simulation" leaves out the threads `capture` and `check`
(its self-check), so with a simulated kernel read the share itself. `MB/h` is the slope of the memory, which 3600
seconds give a meaning.
"""

import argparse
import json
import os
import shutil
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE

import numpy as np

from gellight.daemon.assembly import open_session
from gellight.dashboard.server import DashboardServer
from tests.benchmarks.kernel_session import session_at_rest
from tests.helpers.children import started
from tests.helpers.settings import loaded

SENSOR = "sim://?board=0"
CASES = {
    "BALL, 60 asked": (f"{SENSOR}&object=BALL&depth=1&fps=60", False),
    "WAVE, 60 asked": (f"{SENSOR}&object=WAVE&depth=0.8&fps=60", False),
    "BALL, 60 asked, page": (f"{SENSOR}&object=BALL&depth=1&fps=60", True),
    "at rest, 30 asked": (f"{SENSOR}&programme=0&fps=30", False),
    "at rest, 30 asked, page": (f"{SENSOR}&programme=0&fps=30", True),
    "at rest, MJPG": ("MJPG", False),
    "at rest, MJPG, page": ("MJPG", True),
    "at rest, YUYV": ("YUYV", False),
    "at rest, YUYV, page": ("YUYV", True),
}
"""URL or what a camera behind a simulated kernel sends, and whether a page is open"""
WARM_UP_S = 5.0
NAMED = ("capture", "reconstruct", "check", "watch_now_and_then", "dashboard")


def by_thread() -> Counter[str]:
    """Return the processor seconds of this process so far, by thread; others are those of libraries."""
    used: Counter[str] = Counter()
    names = {thread.native_id: thread.name for thread in threading.enumerate()}
    for task in Path("/proc/self/task").iterdir():
        fields = (task / "stat").read_text().rpartition(")")[2].split()
        name = next((one for one in NAMED if names.get(int(task.name), "").startswith(one)), "others")
        used[name] += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # type: ignore[assignment]
    used["all"] = time.process_time()  # type: ignore[assignment]
    return used


def memory_mb() -> float:
    """Return the memory of this process that is in use."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def serve(url: str, seconds: float, realtime: bool) -> None:
    """Be the daemon: print the page's address, wait for a line, and print the figures of so many seconds."""
    settings = loaded({"sensor.url": url, "service.realtime": realtime} if "://" in url else {})
    opened = open_session(settings) if "://" in url else session_at_rest(url)
    with opened as daemon, DashboardServer(daemon, port=0) as server:
        daemon.wait_frame(0, 60)
        print(server.url, flush=True)
        sys.stdin.readline()
        time.sleep(WARM_UP_S)
        before, frames, begun_s = by_thread(), daemon.status()["frames"], time.monotonic()
        memory = []
        while time.monotonic() < begun_s + seconds:
            time.sleep(min(seconds / 20, 10.0))
            memory.append((time.monotonic(), memory_mb()))
        took_s, used, status = time.monotonic() - begun_s, by_thread() - before, daemon.status()
        given = status["frames"] - frames
        slope = np.polyfit(*np.array(memory).T, 1)[0] * 3600
        print(json.dumps({
            "fps": given / took_s, "age_ms": status["frame_age_ms"], "priority": status["priority"],
            "share": used["all"] / took_s, "frame_ms": used["all"] / given * 1e3, "memory_mb_h": slope,
            "ms": {name: used[name] / given * 1e3 for name in (*NAMED, "others")}, "stage_ms": status["stage_ms"],
        }), flush=True)  # fmt: skip


@contextmanager
def page_open(url: str) -> Iterator[None]:
    """Have the page open in a browser, in this process."""
    from playwright.sync_api import sync_playwright

    from tests.helpers.browsing import FLAGS, NO_GL

    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS + NO_GL)
        browser.new_page(viewport={"width": 1366, "height": 768}).goto(url)
        yield
        browser.close()


def measure(case: str, seconds: float, realtime: bool) -> None:
    """Run one case in a process of its own and print its lines."""
    url, page = CASES[case]
    command = [sys.executable, "-m", "tests.benchmarks.rate", "--serve", url, "--seconds", str(seconds)]
    with started(command + ["--realtime"] * realtime, stdin=PIPE, stdout=PIPE, text=True) as child:
        address = child.stdout.readline().strip()
        if page:
            with page_open(address):
                found = figures_of(child)
        else:
            found = figures_of(child)
    ages = " to ".join(f"{ms:.0f}" for ms in found["age_ms"].values())
    own = found["share"] - found["fps"] * (found["ms"]["capture"] + found["ms"]["check"]) / 1e3
    print(
        f"{case:24} {found['fps']:5.1f} frames/s, age {ages} ms (median, 95 %), {found['share']:.1%} of a core, "
        f"{own:.1%} without the simulation, {found['memory_mb_h']:.1f} MB/h, priority: {found['priority']}"
    )
    threads = ", ".join(f"{name} {ms:.2f}" for name, ms in found["ms"].items())
    print(f"{'':24} ms of processor a frame: {found['frame_ms']:.2f}; {threads}", flush=True)


def figures_of(child):  # type: ignore[no-untyped-def]  # a process of text, and whatever JSON it prints
    """Let the daemon begin, and return what it prints."""
    child.stdin.write("\n")
    child.stdin.flush()
    return json.loads(child.stdout.readline())


def main() -> None:
    """Print two lines for each case, or be a daemon."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--only", default="", help="cases whose name has this in it")
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve, given.seconds, given.realtime)
        return
    for case in CASES:
        if given.only in case:
            measure(case, given.seconds, given.realtime)


if __name__ == "__main__":
    main()
