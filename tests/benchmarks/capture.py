"""Figures of capture: `python -m tests.benchmarks.capture`, with `--device /dev/video0` also those of a real camera.

Frame age is the time from a picture's stamp in the kernel to its delivery, without decoding, for a reader that rests
after each picture. On the fake kernel time is virtual and the figures are exact; on a device our stream and
`cv2.VideoCapture` with its default queue take turns at the same camera in the same run.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from gellight.frames.camera import ReconnectingError
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.decoding import decode
from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.formats import Mode, Wanted
from gellight.sensor.v4l2.stream import Stream
from tests.helpers.fake_kernel import FakeCamera, FakeKernel
from tests.helpers.v4l2_pictures import coded_jpeg, scene

PAUSES_S = (0.0, 0.05, 0.12, 0.3)
WARM_UP = 6
ALTERNATIONS = 3
Figures = dict[str, float]


def summary(values: list[float]) -> Figures:
    """Median and 95th percentile in ms."""
    median, p95 = np.percentile(np.array(values) * 1e3, [50, 95])
    return {"median_ms": round(float(median), 2), "p95_ms": round(float(p95), 2)}


def ages(deliver: Callable[[], float], clock: Callable[[], float], rest: Callable[[float], object], pause_s: float,
         count: int) -> list[float]:  # fmt: skip
    """Take `count` pictures, resting after each; `deliver` returns the stamp of one. The first ones are warm-up."""
    found = []
    for _ in range(WARM_UP + count):
        stamp_s = deliver()
        found.append(clock() - stamp_s)
        rest(pause_s)
    return found[WARM_UP:]


def oldest_first(device: Device) -> Callable[[], float]:
    """Read a queue of four buffers in order, as OpenCV does by default."""
    device.start(buffers=4)

    def deliver() -> float:
        buffer = v.Buffer(type=v.CAPTURE, memory=v.MMAP)
        assert device.kernel.poll(device._descriptor, 5.0)
        device.ask(v.DQBUF, buffer)
        device.ask(v.QBUF, v.Buffer(index=buffer.index, type=v.CAPTURE, memory=v.MMAP))
        return float(buffer.timestamp.seconds + buffer.timestamp.microseconds * 1e-6)

    return deliver


def newest_first(stream: Stream) -> Callable[[], float]:
    """Read as GelLight does."""
    return lambda: stream.newest(5.0).stamp_s


def age_on_the_fake_kernel(count: int = 200) -> dict[str, dict[str, Figures | float]]:
    """Frame age of a 30 fps camera by the reader's rest, ours and a queue's, in virtual time."""
    figures: dict[str, dict[str, Figures | float]] = {}
    for pause_s in PAUSES_S:
        found: dict[str, list[float]] = {}
        for name in ("ours", "queue of 4"):
            kernel = FakeKernel({"camera": FakeCamera()})
            with Device("camera", kernel=kernel) as device:
                device.configure(Wanted(width=640, height=480, fps=30))
                deliver = newest_first(device.start()) if name == "ours" else oldest_first(device)
                found[name] = ages(deliver, kernel.clock, kernel.sleep, pause_s, count)
        ratio = float(np.median(found["ours"]) / np.median(found["queue of 4"]))
        figures[f"rest {pause_s * 1e3:.0f} ms"] = {
            **{n: summary(a) for n, a in found.items()},
            "ratio": round(ratio, 3),
        }
    return figures


def age_on_a_device(path: str, wanted: Wanted, pause_s: float, count: int) -> dict[str, object]:
    """Frame age of a real camera, ours and `cv2.VideoCapture` with its default queue in turns."""
    found: dict[str, list[float]] = {"ours": [], "cv2": []}
    for _ in range(ALTERNATIONS):
        with Device(path) as device:
            mode = device.configure(wanted)
            found["ours"] += ages(newest_first(device.start()), time.monotonic, time.sleep, pause_s, count)
        found["cv2"] += opencv_ages(path, mode, pause_s, count)
    medians = {name: float(np.median(values)) for name, values in found.items()}
    return {
        "mode": str(mode), "rest_ms": pause_s * 1e3, **{name: summary(values) for name, values in found.items()},
        "ratio": round(medians["ours"] / medians["cv2"], 3),
    }  # fmt: skip


def opencv_ages(path: str, mode: Mode, pause_s: float, count: int) -> list[float]:
    """Frame age through OpenCV, undecoded; its position in ms is the kernel's stamp."""
    capture = cv2.VideoCapture(path, cv2.CAP_V4L2)
    settings = ((cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*mode.letters)), (cv2.CAP_PROP_FRAME_WIDTH, mode.width),
                (cv2.CAP_PROP_FRAME_HEIGHT, mode.height), (cv2.CAP_PROP_FPS, mode.fps),
                (cv2.CAP_PROP_CONVERT_RGB, 0))  # fmt: skip
    try:
        for name, value in settings:
            capture.set(name, value)

        def deliver() -> float:
            assert capture.grab(), f"OpenCV gets no picture from {path}"
            return capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3

        return ages(deliver, time.monotonic, time.sleep, pause_s, count)
    finally:
        capture.release()


def decoding(rounds: int = 40) -> dict[str, object]:
    """CPU time of decoding one noisy 640x480 picture, one thread, the formats in turns, and OpenCV's part of it."""
    image = scene()
    cv2.setNumThreads(1)
    raw = cv2.cvtColor(image, cv2.COLOR_RGB2YUV_YUYV).tobytes()
    pictures = {"MJPG 4:2:2": coded_jpeg(image, "4:2:2"), "MJPG 4:2:0": coded_jpeg(image, "4:2:0"), "YUYV": raw}
    times: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, data in pictures.items():
            mode = Mode(letters=name[:4], width=640, height=480, fps=30)
            _timed(times.setdefault(name, []), lambda data=data, mode=mode: decode(data, mode))  # type: ignore[misc]
            if mode.letters == "MJPG":
                alone = times.setdefault(f"{name}, OpenCV alone", [])
                _timed(alone, lambda data=data: cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB))  # type: ignore[misc]
    medians = {name: float(np.median(values)) for name, values in times.items()}
    return {
        **{name: summary(values) for name, values in times.items()},
        "bytes": {name: len(data) for name, data in pictures.items()},
        "YUYV / MJPG 4:2:2": round(medians["YUYV"] / medians["MJPG 4:2:2"], 3),
        **{f"{name} / OpenCV alone": round(medians[name] / medians[f"{name}, OpenCV alone"], 2)
           for name in pictures if name != "YUYV"},
    }  # fmt: skip


def _timed(times: list[float], work: Callable[[], object]) -> None:
    begun_s = time.thread_time()
    work()
    times.append(time.thread_time() - begun_s)


def recovery(rounds: int = 50) -> Figures:
    """Virtual time from the moment a sensor is plugged in again, at a random phase of our looking, to its first frame.

    Enumeration by the kernel comes on top; exposure, latency and 20 ms until the LEDs are lit are within.
    """
    from tests.helpers.sensor_bench import Bench

    rng, found = np.random.default_rng(0), []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder) / "computer")
        bench.plug("1-2", "GL0001")
        with bench.open("auto?format=YUYV&width=32&height=24") as camera:
            for _ in range(rounds):
                camera.read()
                bench.unplug("1-2")
                plugged_s = bench.kernel.now_s + 1 + float(rng.random())
                bench.kernel.at(plugged_s, lambda: bench.plug("1-2", "GL0001") and None)
                while True:
                    try:
                        camera.read()
                        break
                    except ReconnectingError:
                        continue
                found.append(bench.kernel.now_s - plugged_s)
    return summary(found)


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", help="path of a real camera")
    parser.add_argument("--rest-ms", type=float, default=120.0)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--format", default="MJPG")
    chosen = parser.parse_args()
    figures: dict[str, object] = {"age, fake kernel": age_on_the_fake_kernel(), "decoding": decoding()}
    figures["recovery, fake kernel"] = recovery()
    if chosen.device:
        wanted = Wanted(width=640, height=480, letters=chosen.format, fps=30)
        figures["age, device"] = age_on_a_device(chosen.device, wanted, chosen.rest_ms * 1e-3, chosen.count)
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
