"""What a second sensor in the same daemon costs the first: `python -m tests.benchmarks.several [seconds]`.

One and two simulated sensors (640 x 480, 30 frames a second, steady light without an emulated board), each in a process
of its own under one `gellight run`. Rates and ages are those of the status at the end; processor time is of all
processes of the daemon, as a share of one core. Only the ratios mean something on a machine that does other work too.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from tests.helpers.children import GELLIGHT, started


def measure(count: int, seconds: float) -> tuple[list[dict[str, Any]], float]:
    """Return the last status of each sensor, and the processor's share."""
    sensors = [word for seed in range(count) for word in ("--sensor", f"sim://?board=0&seed={seed}")]
    with tempfile.TemporaryDirectory() as folder:
        before = os.times()
        environment = os.environ | {"XDG_RUNTIME_DIR": folder}
        command = [*GELLIGHT, "run", *sensors, "--port", "0", "--json"]
        with started(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment) as daemon:
            begun_s = time.monotonic()
            last: dict[str, Any] = {}
            while time.monotonic() - begun_s < seconds:
                said = json.loads(daemon.stdout.readline())
                last = said if count > 1 else {"1": said}
            daemon.send_signal(signal.SIGTERM)
            daemon.stdout.read()
            daemon.wait(20)
        after = os.times()
    used_s = after.children_user + after.children_system - before.children_user - before.children_system
    return list(last.values()), used_s / seconds


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
