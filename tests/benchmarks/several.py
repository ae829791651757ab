"""What a second sensor in the same daemon costs the first: `python -m tests.benchmarks.several [seconds]`.

One and two simulated sensors (640 x 480, 30 frames a second, steady light without an emulated board), each in a process
of its own under one `gellight run`. Rates and ages are those of the status at the end; processor time is of all
processes of the daemon, as a share of one core. Only the ratios mean something on a machine that does other work too.
"""

import json
import os
import signal
import sys
import tempfile
import time
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import Any

from tests.helpers.children import GELLIGHT, started


def measure(count: int, seconds: float) -> tuple[list[dict[str, Any]], float]:
    """Return the last status of each sensor, and the processor's share."""
    sensors = [word for seed in range(count) for word in ("--sensor", f"sim://?board=0&seed={seed}")]
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"XDG_RUNTIME_DIR": folder}
        command = [*GELLIGHT, "run", *sensors, "--port", "0", "--json"]
        with started(command, stdout=PIPE, stderr=DEVNULL, text=True, env=environment) as daemon:
            last, begun_s, used_s = statuses(daemon, count), time.monotonic(), processor_s(daemon.pid)
            while not all(one.get("frames") for one in last) or time.monotonic() - begun_s < seconds:
                if not all(one.get("frames") for one in last):
                    begun_s, used_s = time.monotonic(), processor_s(daemon.pid)
                last = statuses(daemon, count)
            took_s, used_s = time.monotonic() - begun_s, processor_s(daemon.pid) - used_s
            daemon.send_signal(signal.SIGTERM)
            daemon.stdout.read()
            daemon.wait(20)
    return last, used_s / took_s


def statuses(daemon: Any, count: int) -> list[dict[str, Any]]:
    """Return the next statuses of all sensors."""
    said = json.loads(daemon.stdout.readline())
    return list(said.values()) if count > 1 else [said]


def processor_s(process: int) -> float:
    """Return the processor time of a process and of those that it has started, so far."""
    place = Path(f"/proc/{process}")
    fields = (place / "stat").read_text().rpartition(")")[2].split()
    own = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    children = (place / "task" / str(process) / "children").read_text().split()
    return own + sum(processor_s(int(child)) for child in children)


def main() -> None:
    """Print one line for each number of sensors."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 25.0
    for count in (1, 2):
        sensors, share = measure(count, seconds)
        rates = ", ".join(f"{one['fps']:.1f}" for one in sensors)
        ages = ", ".join(f"{one['frame_age_ms'].get('median', 0):.0f}" for one in sensors)
        print(f"{count} sensor(s): {rates} frames/s, age {ages} ms, {share:.2f} cores", flush=True)


if __name__ == "__main__":
    main()
