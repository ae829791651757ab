"""What a frame costs in other sizes, and of several sensors: `python -m tests.benchmarks.sizes [--rounds 15]`.

Processor time of the frame path, the least of some rounds in turn, on the scenes of `frame_times` from 160 x 120 to
1920 x 1440 pixels: in ms, and in ns a pixel, which must not grow with the size. The bundle is the shipped one with its
reference image and the places of its network scaled, and without its LEDs, so without cast shadows. Then one to four
sensors of 640 x 480 in one process, a thread each, every one given the ball 30 times: ms of processor a frame, which
must not grow with their number.
"""

import argparse
import threading
import time

import cv2
import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from tests.benchmarks.frame_times import over, scenes

SIZES = ((160, 120), (320, 240), (640, 480), (1280, 960), (1920, 1440))
SENSORS = (1, 2, 3, 4)
FRAMES = 30


def least_ms(reconstructor: Reconstructor, frame: CameraFrame, rounds: int) -> float:
    """Return the least processor time of some rounds."""
    times = []
    for _ in range(rounds + 1):
        begun_s = time.process_time()
        reconstructor.reconstruct(frame)
        times.append(time.process_time() - begun_s)
    return min(times[1:]) * 1e3


def by_size(rounds: int) -> None:
    """Print a line for each scene and size."""
    bundle = load_bundle("synthetic")
    for width, height in SIZES:
        sized = over(bundle, cv2.resize(bundle.reference, (width, height), interpolation=cv2.INTER_AREA))
        reconstructor = Reconstructor(sized)
        for scene, image in scenes(sized).items():
            cost_ms = least_ms(reconstructor, CameraFrame(image=image, time_s=0.0, sequence=0), rounds)
            each_ns = cost_ms * 1e6 / (width * height)
            print(f"{width:5} x {height:<5} {scene:20} {cost_ms:8.2f} ms {each_ns:7.1f} ns a pixel", flush=True)


def by_sensors() -> None:
    """Print a line for each number of sensors."""
    bundle = load_bundle("synthetic")
    frame = CameraFrame(image=scenes(bundle)["ball"], time_s=0.0, sequence=0)
    for count in SENSORS:
        used_s: list[float] = []

        def run(used_s: list[float] = used_s) -> None:
            reconstructor = Reconstructor(bundle)
            reconstructor.reconstruct(frame)
            for _ in range(FRAMES):
                begun_s = time.thread_time()
                reconstructor.reconstruct(frame)
                used_s.append(time.thread_time() - begun_s)

        threads = [threading.Thread(target=run) for _ in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        print(f"{count} sensor(s), ball: {np.median(used_s) * 1e3:6.2f} ms a frame (median)", flush=True)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    by_size(given.rounds)
    by_sensors()


if __name__ == "__main__":
    main()
