"""Age of a frame on its way, from the start of its exposure: `python -m tests.benchmarks.latency [seconds [others]]`.

A simulated sensor (640 x 480, a ball 1 mm deep, steady light without a board) under `gellight run`, read by a
subscriber in this process that wants every frame; at 30 and at 60 frames a second. The camera is simulated on the same
cores, and its picture takes the whole frame time to be exposed and sent, as with a real one. In the same run: garbage
collection left out, and with service.realtime set, which the system has to allow; for `others` seconds each. 600
seconds give the 99.9th percentile a meaning.
"""

import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import DEVNULL

import numpy as np

import gellight
from gellight.base.errors import StreamError
from tests.helpers.children import started

WAYS: dict[str, tuple[str, list[str]]] = {
    "as it is": ("", []),
    "no garbage collection": ("import gc; gc.disable(); ", []),
    "realtime": ("", ["--set", "service.realtime=true"]),
}
"""what the daemon's process does first, and its further options"""
STAGES = ("taken", "reconstructed", "published", "received")
WARM_UP_S = 5.0


@contextmanager
def daemon(first: str, options: list[str], fps: int) -> Iterator[None]:
    """Run a daemon with `options` whose process does `first`, that publishes to this computer alone."""
    sensor = f"sim://?board=0&object=BALL&depth=1&fps={fps}"
    code = f"{first}import sys; from gellight.cli.main import run; sys.argv[0] = 'gellight'; run()"
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_RUNTIME_DIR"] = folder
        command = [sys.executable, "-c", code, "run", "--sensor", sensor, "--no-dashboard", "--json", *options]
        with started(command, stdout=DEVNULL, stderr=DEVNULL) as process:
            yield
            process.send_signal(signal.SIGTERM)
            process.wait(20)


def subscribed() -> gellight.Subscription:
    """Subscribe to the daemon as soon as it publishes."""
    given_up_s = time.monotonic() + 60.0
    while True:
        try:
            return gellight.subscribe("auto", every=True)
        except StreamError:
            if time.monotonic() > given_up_s:
                raise
            time.sleep(0.2)


def ages(seconds: float) -> tuple[np.ndarray, int]:
    """Return the (n, 4) ages in s of the frames that came, by stage, and how many were dropped."""
    found, dropped = [], 0
    with subscribed() as frames:
        end_s = time.monotonic() + WARM_UP_S + seconds
        for frame in frames:
            if time.monotonic() > end_s:
                break
            if time.monotonic() > end_s - seconds and frame.provenance is not None:
                found.append([frame.provenance.ages_s[stage] for stage in STAGES])
                dropped += frame.provenance.dropped
    return np.array(found), dropped


def main() -> None:
    """Print one line for each stage of each way."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    others = float(sys.argv[2]) if len(sys.argv) > 2 else seconds
    print("age in ms by stage                               p50     p95     p99   p99.9   worst  frames/s  dropped")
    for fps in (30, 60):
        for way, (first, options) in WAYS.items():
            lasting = seconds if not first and not options else others
            with daemon(first, options, fps):
                found, dropped = ages(lasting)
            for stage, one in zip(STAGES, found.T * 1e3, strict=True):
                figures = " ".join(f"{value:7.1f}" for value in np.percentile(one, [50, 95, 99, 99.9, 100]))
                print(
                    f"{fps} frames/s, {way:22} {stage:13} {figures} {len(found) / lasting:9.1f} {dropped:8d}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
