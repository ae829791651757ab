"""What it costs to give frames to other programs, at 640 x 480 and 60 frames a second.

    .venv/bin/python -m tests.benchmarks.stream [seconds]

GelLight's publisher with shared memory gives to 1 and to 4 readers in processes of their own. The latency is from the
moment before encoding to the moment when the reader has the arrays, of the slowest reader. The processor's share is of
one core. Readers take every frame; those that did not come are lost.

Before that: what recording costs, in processor time and as megabytes a second of one thread, and how old a frame of a
simulated sensor is when another process has it, counted from the start of its exposure. A run takes two minutes.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import gellight
from gellight.base.errors import StreamError
from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import EncodedImage, Provenance, TactileFrame
from gellight.stream import network
from gellight.stream.publisher import Publisher
from gellight.stream.shared_memory import FrameMemory
from gellight.stream.subscription import Subscription
from gellight.stream.wire import encode, encoded
from tests.helpers.dashboard_source import bump

FPS = 60.0


def frame_of(sequence: int, base: TactileFrame) -> TactileFrame:
    """Return the frame, taken now."""
    now_s = time.monotonic()
    provenance = Provenance(
        calibration="0" * 16, zero="0" * 16, pixel_size_mm=(0.05, 0.05), unix_s=time.time(), ages_s={}
    )
    return replace(
        base, camera_frame=replace(base.camera_frame, sequence=sequence, time_s=now_s), provenance=provenance
    )


def processor_s() -> float:
    """Return the processor time of this process so far."""
    times = os.times()
    return times.user + times.system


# ---- readers, each a process of its own ----


def take(endpoint: str, memory: str, seconds: float) -> None:
    ages: list[float] = []
    session = network.subscribing_session(endpoint, config=None)
    with Subscription(session, "bench", memory_path=memory, every=True, patience_s=0.2) as frames:
        begun = processor_s()
        print("ready", flush=True)
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            with suppress(StreamError):  # none came
                frame = frames.next_frame()
                ages.append(time.monotonic() - frame.camera_frame.time_s)
    report(ages, processor_s() - begun, seconds)
    os._exit(0)


def report(ages: list[float], processor: float, seconds: float) -> None:
    """Print the figures of a reader as JSON."""
    p50, p99 = np.percentile(np.array(ages) * 1e3, [50, 99]) if ages else (np.nan, np.nan)
    print(json.dumps({"frames": len(ages), "p50_ms": p50, "p99_ms": p99, "cpu": processor / seconds}), flush=True)


# ---- the side that gives ----


@contextmanager
def giving() -> Iterator[tuple[list[str], Callable[[TactileFrame], None]]]:
    """Give what a reader is told, and how a frame is given."""
    session, endpoint = network.publishing_session(lan=False, config=None)
    drop = network.zenoh.CongestionControl.DROP
    publisher = session.declare_publisher(network.key("bench", "note"), congestion_control=drop)
    with closing(FrameMemory()) as memory:
        yield ["take", endpoint, memory.path], lambda frame: publisher.put(memory.write(encoded(frame)))
    network.close(session)


def measure(readers: int, seconds: float) -> None:
    """Give frames to that many readers; print a line of figures."""
    base = bump(0.8, 1.0, 0.0)
    with giving() as (where, give):
        command = [sys.executable, "-m", "tests.benchmarks.stream", *where, str(seconds + 1.5)]
        children = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(readers)]
        for child in children:
            assert child.stdout
            assert child.stdout.readline() == "ready\n"
        time.sleep(0.5)  # until zenoh knows that they read
        begun, due_s, end_s, given = processor_s(), time.monotonic(), time.monotonic() + seconds, 0
        while time.monotonic() < end_s:
            due_s += 1 / FPS
            time.sleep(max(due_s - time.monotonic(), 0))
            given += 1
            give(frame_of(given, base))
        cost = (processor_s() - begun) / seconds
        figures = [json.loads(child.stdout.read()) for child in children if child.stdout]
    worst = {key: max(one[key] for one in figures) for key in ("p50_ms", "p99_ms", "cpu")}
    lost = max(given - min(one["frames"] for one in figures), 0)
    print(
        f"{readers} readers: p50 {worst['p50_ms']:6.2f} ms, p99 {worst['p99_ms']:6.2f} ms, "
        f"giving {cost:6.1%}, reading {worst['cpu']:6.1%} each, {lost} of {given} frames lost"
    )


def recording_costs(frames: int = 100) -> None:
    """Print what it costs to record a frame, with the camera's JPEG and with RGB, without and with depth."""
    from gellight.frames.frames import CaptureStamp
    from gellight.recording.depth_kind import DepthKind
    from gellight.recording.recording_file import RecordingWriter

    bundle, base = load_bundle("synthetic"), bump(0.8, 1.0, 0.0)
    image = base.camera_frame.image
    jpeg = EncodedImage(data=cv2.imencode(".jpg", image)[1].tobytes(), letters="MJPG", line_bytes=0)
    for kind, raw in (("JPEG", jpeg), ("RGB", None)):
        for depth in DepthKind:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "a.mcap"
                writer = RecordingWriter(path, "bench", depth=depth)
                begun, begun_s = processor_s(), time.monotonic()
                for number in range(frames):
                    frame = frame_of(number, base)
                    camera_frame = replace(frame.camera_frame, encoded=raw)
                    writer.add(camera_frame, CaptureStamp(zeroed=bundle, unix_s=time.time()))
                    writer.add_tactile(frame)
                writer.close()
                cost_ms = (processor_s() - begun) / frames * 1e3
                size_mb, took_s = path.stat().st_size / 1e6, time.monotonic() - begun_s
            print(
                f"record {kind:4} depth {depth:8}: {cost_ms:5.2f} ms of processor a frame, {size_mb / frames:.2f} MB; "
                f"{size_mb / took_s:.0f} MB/s, {frames / took_s:.0f} frames/s"
            )


def ages_at_a_reader(frames: int = 60) -> None:
    """Print how old the frames of a simulated sensor are in another process, since the start of their exposure."""
    with gellight.connect("sim://?object=BALL&depth=1&fps=20") as sensor, Publisher(sensor.daemon, name="bench"):
        sensor.next_frame()
        command = [sys.executable, "-m", "tests.benchmarks.stream", "subscribe", str(frames)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    for stage, ages_ms in json.loads(done.stdout).items():
        p50, p99 = np.percentile(ages_ms, [50, 99])
        print(f"age since the start of the exposure, {stage:13}: p50 {p50:6.1f} ms, p99 {p99:6.1f} ms")


def read_ages(frames: int) -> None:
    """Be the reader of `ages_at_a_reader`: print the ages at each stage, ms."""
    with gellight.subscribe("bench") as source:
        given = [source.next_frame().provenance for _ in range(frames)]
    ages = [provenance.ages_s for provenance in given if provenance is not None]
    print(json.dumps({stage: [age[stage] * 1e3 for age in ages] for stage in ages[0]}))


def main() -> None:
    """Measure, or be a reader."""
    if sys.argv[1:2] == ["take"]:
        take(sys.argv[2], sys.argv[3], float(sys.argv[4]))
    if sys.argv[1:2] == ["subscribe"]:
        read_ages(int(sys.argv[2]))
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 6.0
    print(f"{len(encode(frame_of(0, bump(0.8, 1.0, 0.0)))) / 1e6:.2f} MB a frame, {os.getloadavg()[0]:.1f} load")
    recording_costs()
    ages_at_a_reader()
    for readers in (1, 4):
        measure(readers, seconds)


if __name__ == "__main__":
    main()
