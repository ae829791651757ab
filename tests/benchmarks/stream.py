"""What it costs to give frames to other programs, at 640 x 4860 frames a second; one run, ways side by side.

    .venv/bin/python -m tests.benchmarks.stream [seconds]

Three ways are compared, each with 1 and 4 readers in processes of their own: GelLight's publisher with shared memory,
the same over TCP on this computer, and a plain TCP socket with pickled NumPy arrays, whose reader gets the same maps.
The latency is from the moment before encoding to the moment when the reader has the arrays, of the slowest reader. The
processor's share is of one core. Readers take every frame; those that did not come are lost.

Before that: what recording costs, in processor time and as megabytes a second of one thread, and how old a frame of a
simulated sensor is when another process has it, counted from the start of its exposure. A run takes two minutes.
"""

import json
import os
import pickle
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import gellight
from gellight.base.errors import StreamError
from gellight.base.mailbox import Mailbox
from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import EncodedImage, Provenance, TactileFrame
from gellight.stream import network
from gellight.stream.publisher import Publisher
from gellight.stream.shared_memory import FrameMemory
from gellight.stream.subscription import Subscription
from gellight.stream.wire import encode, encoded
from tests.helpers.dashboard_source import bump

FPS = 60.0
LENGTH = 8


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


def read_zenoh(endpoint: str, memory: str, seconds: float) -> None:
    ages: list[float] = []
    session = network.subscribing_session(endpoint, config=None)
    with Subscription(session, "bench", memory=memory, every=True, patience_s=0.2) as frames:
        begun = processor_s()
        print("ready", flush=True)
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            with suppress(StreamError):  # none came
                frame = frames.next_frame()
                ages.append(time.monotonic() - frame.camera_frame.time_s)
    report(ages, processor_s() - begun, seconds)
    os._exit(0)


def read_socket(port: int, seconds: float) -> None:
    ages: list[float] = []
    with socket.create_connection(("127.0.0.1", port)) as wire, wire.makefile("rb", 1 << 20) as stream:
        begun = processor_s()
        print("ready", flush=True)
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            size = int.from_bytes(stream.read(LENGTH), "little")
            if size == 0:  # nothing more comes
                break
            frame = pickle.loads(stream.read(size))
            ages.append(time.monotonic() - frame["time_s"])
    report(ages, processor_s() - begun, seconds)
    os._exit(0)


def report(ages: list[float], processor: float, seconds: float) -> None:
    """Print the figures of a reader as JSON."""
    p50, p99 = np.percentile(np.array(ages) * 1e3, [50, 99]) if ages else (np.nan, np.nan)
    print(json.dumps({"frames": len(ages), "p50_ms": p50, "p99_ms": p99, "cpu": processor / seconds}), flush=True)


# ---- the side that gives ----


@contextmanager
def over_memory() -> Iterator[tuple[str, Callable[[TactileFrame], None]]]:
    with closing(FrameMemory()) as memory, publishing("note") as (endpoint, put):
        yield f"zenoh {endpoint} {memory.path}", lambda frame: put(memory.write(encoded(frame)))


@contextmanager
def over_network() -> Iterator[tuple[str, Callable[[TactileFrame], None]]]:
    with publishing("frame") as (endpoint, put):
        yield f"zenoh {endpoint} -", lambda frame: put(encode(frame))


@contextmanager
def publishing(part: str) -> Iterator[tuple[str, Callable[[bytes], None]]]:
    session, endpoint = network.publishing_session(lan=False, config=None)
    publisher = session.declare_publisher(
        network.key("bench", part), congestion_control=network.zenoh.CongestionControl.DROP
    )
    yield endpoint, publisher.put
    network.close(session)


@contextmanager
def over_socket() -> Iterator[tuple[str, Callable[[TactileFrame], None]]]:
    """Send to each reader from a thread of its own, which takes the newest message: careful, but plain."""
    box: Mailbox[bytes] = Mailbox()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve(wire: socket.socket) -> None:
            number = 0
            try:
                while True:
                    number, message = box.take(number, 5)
                    wire.sendall(len(message).to_bytes(LENGTH, "little"))
                    wire.sendall(message)
            except (OSError, TimeoutError):
                wire.close()

        def accept() -> None:
            while True:
                try:
                    threading.Thread(target=serve, args=(server.accept()[0],), daemon=True).start()
                except OSError:
                    return

        threading.Thread(target=accept, daemon=True).start()

        def give(frame: TactileFrame) -> None:
            maps = {"time_s": frame.camera_frame.time_s, "image": frame.camera_frame.image, "depth": frame.depth_mm,
                    "gradient": frame.gradient_map, "contact": frame.contact.mask}  # fmt: skip
            box.put(pickle.dumps(maps, protocol=5))

        yield f"socket {server.getsockname()[1]}", give


def measure(name: str, way: Callable[[], object], readers: int, seconds: float) -> None:
    """Give frames in one way to that many readers; print a line of figures."""
    base = bump(0.8, 1.0, 0.0)
    with way() as (where, give):  # type: ignore[attr-defined]
        command = [sys.executable, "-m", "tests.benchmarks.stream", *where.split(), str(seconds + 1.5)]
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
        f"{name:24} {readers} readers: p50 {worst['p50_ms']:6.2f} ms, p99 {worst['p99_ms']:6.2f} ms, "
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
                    writer.add_felt(frame)
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
    """Measure every way, or be a reader of one."""
    if sys.argv[1:2] == ["zenoh"]:
        read_zenoh(sys.argv[2], sys.argv[3].strip("-"), float(sys.argv[4]))
    if sys.argv[1:2] == ["socket"]:
        read_socket(int(sys.argv[2]), float(sys.argv[3]))
    if sys.argv[1:2] == ["subscribe"]:
        read_ages(int(sys.argv[2]))
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 6.0
    print(f"{len(encode(frame_of(0, bump(0.8, 1.0, 0.0)))) / 1e6:.2f} MB a frame, {os.getloadavg()[0]:.1f} load")
    recording_costs()
    ages_at_a_reader()
    for readers in (1, 4):
        measure("note, shared memory", over_memory, readers, seconds)
        measure("zenoh, TCP", over_network, readers, seconds)
        measure("socket, pickled NumPy", over_socket, readers, seconds)


if __name__ == "__main__":
    main()
