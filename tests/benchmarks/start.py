"""Processor seconds of a start, medians of fresh processes: `python -m tests.benchmarks.start [URL] [--times 9]`.

imports   of the running half, without the simulator
connect   camera, bundle, network, its judge, the watch; with sim:// the simulator's imports too
frame     from then to the first frame with depth
"""

import argparse
import json
import subprocess
import sys

import numpy as np

CHILD = """
import json, sys, time
begun = time.process_time()
import gellight
import gellight.daemon.assembly, gellight.opening, gellight.stream.sensor
imported = time.process_time()
sensor = gellight.connect(sys.argv[1])
connected = time.process_time()
sensor.next_frame()
shown = time.process_time()
sensor.close()
print(json.dumps({
    "imports": imported - begun, "connect": connected - imported, "frame": shown - connected,
}))
"""


def once(url: str) -> dict[str, float]:
    """Start one process, and return the processor seconds of each stage."""
    done = subprocess.run([sys.executable, "-c", CHILD, url], check=True, stdout=subprocess.PIPE, text=True)
    figures: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return figures


def main() -> None:
    """Print the median and the range of each stage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("url", nargs="?", default="sim://?object=BALL&depth=1")
    parser.add_argument("--times", type=int, default=9)
    given = parser.parse_args()
    starts = [once(given.url) for _ in range(given.times)]
    for stage in starts[0]:
        seconds = [start[stage] for start in starts]
        print(f"{stage:8} {np.median(seconds):6.2f} s   {min(seconds):.2f} to {max(seconds):.2f}")
    first = [sum(start.values()) for start in starts]
    print(f"{'in all':8} {np.median(first):6.2f} s   {min(first):.2f} to {max(first):.2f}")


if __name__ == "__main__":
    main()
