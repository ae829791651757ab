"""A daemon with all that stands around it: a recording, a reader in a process of its own, and the judge."""

import os
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import GellightError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import Camera
from gellight.recording.recording_file import Recording
from gellight.ring.light_groups import colour_triples
from gellight.sensor.lighting.sequenced import SequencedCamera
from gellight.sensor.sensor_camera import open_sensor
from gellight.stream.publisher import Publisher
from gellight.stream.recorder import Recorder
from gellight.watch.monitor import SensorWatch
from tests.helpers.sessions import session_of
from tests.soak.hardware import SERIAL, SoakSensor
from tests.soak.judging import Invariant, Judge
from tests.soak.pressed_gel import read_number
from tests.soak.working import IN_FLIGHT, Calibrating, Work, Working

KEPT_FRAMES = 64
POLL_S = 0.2
DARK_GREY = 5.0
READER_S = 20.0
"""a reader is started, and has its first frames, within this"""


class Reader:
    """A program that receives frames: `reader.py` in a process of its own."""

    def __init__(self, name: str, judge: Judge) -> None:
        """Start it; `name` is that of the sensor."""
        self.frames = 0
        self._judge = judge
        self._process = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("reader.py"), name], stdout=subprocess.PIPE, text=True
        )
        self._listener = threading.Thread(target=self._listen, name="reader", daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        for line in self._process.stdout or ():
            word, _, rest = line.strip().partition(" ")
            if word == "frames":
                self.frames = int(rest)
                self._judge.looked_at(Invariant.READER)
            elif word in ("bad", "ended"):  # it ends after the daemon alone, and is closed before that
                self._judge.broken(Invariant.READER, rest)

    def wait_for_frames(self) -> bool:
        """Wait until it has frames; whether it got some."""
        before, end_s = self.frames, time.monotonic() + READER_S
        while self.frames == before and time.monotonic() < end_s:
            time.sleep(POLL_S)
        return self.frames > before

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._listener.join()
        if self._process.stdout:
            self._process.stdout.close()


class Shift:
    """A running daemon, recorded, published and judged; a context manager."""

    def __init__(self, sensor: SoakSensor, bundle: Bundle, judge: Judge, folder: Path, *, sequenced: bool,
                 work: Work | None = None) -> None:  # fmt: skip
        """Run the sensor that is plugged in; sequenced: under a sequence of lights, else under the bundle's.

        work: where to note what somebody does who calibrates it; None: nobody does.
        """
        self._sensor, self._bundle, self.judge, self._folder = sensor, bundle, judge, folder
        self._work, self.sequenced = work, sequenced
        self.working: Working | None = None
        self._recordings = 0
        self._known_from = 0
        """number of the first frame whose light no calibration can have set"""
        self._ended = threading.Event()
        self._until = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            camera = stack.enter_context(self._opened())
            assert self._bundle.colours is not None
            watch = None if self.sequenced else SensorWatch(self._bundle, rezero=True)
            self.judge.begin_stream()
            self.daemon = stack.enter_context(session_of(camera, Reconstructor(self._bundle), watch=watch))
            self.daemon.track(on=True)
            publisher = stack.enter_context(Publisher(self.daemon, name=f"{SERIAL}-{os.getpid()}-{id(self):x}"))
            self.name = publisher.name
            thread = threading.Thread(target=self._judge_frames, name="judge", daemon=True)
            thread.start()
            stack.callback(thread.join)
            stack.callback(self._ended.set)
            self._begin_recording()
            stack.callback(self.end_recording)
            if self._work is not None:
                self.working = stack.enter_context(self._worker(self._work))
            self.reader = Reader(self.name, self.judge)
            stack.callback(lambda: self.reader.close())
            self._until = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop everything; then the LEDs are dark, and the recording can be read."""
        self._until.close()

    def _worker(self, work: Work) -> Working:
        gel = self._sensor.gel
        return Working(gel, Calibrating(gel, self.daemon, self.judge, self._folder, work), self.judge)

    def _light(self, sequence: int) -> NDArray[np.uint8] | None:
        """Return the light that a frame was exposed under; None where it is one of several."""
        if self.sequenced:
            return None
        if self.working is not None and self.working.calibrating:
            self._known_from = sequence + IN_FLIGHT
        return self._bundle.colours if sequence >= self._known_from else None

    def _opened(self) -> Camera:
        camera = open_sensor(f"sensor://{SERIAL}", bundle=self._bundle, surroundings=self._sensor.surroundings)
        if not self.sequenced:
            return camera
        assert self._bundle.colours is not None
        self._groups = colour_triples(self._bundle.colours)
        try:
            return SequencedCamera(camera, self._groups)
        except BaseException:
            camera.close()
            raise

    def _judge_frames(self) -> None:
        number, groups = 0, self._groups if self.sequenced else None
        with self.daemon.delivered.subscribe(KEPT_FRAMES) as frames:
            while not self._ended.is_set():
                try:
                    number, felt = frames.take(number, POLL_S)
                except TimeoutError:
                    continue
                except Exception as error:
                    if not self._ended.is_set():
                        self.judge.broken(Invariant.RUNNING, f"no more frames: {error}")
                    return
                light = self._light(felt.camera_frame.sequence)
                self.judge.frame(felt.camera_frame, light=light, groups=groups)
                self.judge.pose(felt.camera_frame.sequence, felt.pose)

    # ---- recordings ----

    def _begin_recording(self) -> None:
        self._recordings += 1
        self.recorder = Recorder(self.daemon, self._folder / f"{self.name}-{self._recordings}.mcap", name=SERIAL)
        self.recorder.__enter__()

    def end_recording(self) -> None:
        """Finish the recording, and judge what can be read of it."""
        self.recorder.__exit__()
        self.judge.looked_at(Invariant.RECORDING)
        path = self.recorder.path
        sequence, numbers = [], []
        try:
            for record in Recording(path).frames():
                sequence.append(record.info.sequence)
                image = record.image(path.name)
                number = read_number(image)
                if image.mean() > DARK_GREY:  # dark pictures that are sent again cannot be told from new ones
                    numbers.append(number)
        except GellightError as error:
            self.judge.broken(Invariant.RECORDING, str(error))
            return
        finally:
            path.unlink()
        if any(np.diff(sequence) <= 0) or any(np.diff(numbers) <= 0):
            self.judge.broken(Invariant.RECORDING, f"{path.name}: the frames are not in order")
        if not sequence or (not self.recorder.ended and len(sequence) != self.recorder.status.frames):
            read, written = len(sequence), self.recorder.status.frames
            self.judge.broken(Invariant.RECORDING, f"{path.name}: {read} of {written} frames can be read")

    def record_anew(self) -> None:
        self.end_recording()
        self._begin_recording()

    def read_anew(self) -> None:
        """Start another reader in the place of the one there is."""
        self.reader.close()
        self.reader = Reader(self.name, self.judge)
