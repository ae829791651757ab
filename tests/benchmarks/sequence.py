"""Photometric stereo by a sliding window against a series that stops at every light, and against GelNet.

    python -m tests.benchmarks.sequence

A ball is pressed 1 mm deep into the simulated gel of the paper, at rest, and rolling at 5 mm/s. The light ring is the
emulated firmware; camera (30 Hz, rolling shutter, 640 x 480) and board are on virtual time, so rates and spans are the
same on every machine. Only the computing time is of the wall clock, as a ratio to GelNet's in the same run. Errors are
means over the contact, against the gel as it was when the newest (series: first) picture was taken.

The age of a result is counted from the start of the exposure of its newest and of its oldest picture to the moment when
it is computed: exposure, readout and transfer on virtual time, and the computing time.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import FramePath, Reconstructor
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame, ExposureSeries, TactileFrame
from gellight.frames.timing import CameraTiming
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.light_model import LightGroups
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.integration import angle_deg, normals
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera
from gellight.sensor.series_cameras import SeriesCamera
from gellight.sensor.window_camera import WindowCamera
from gellight.series.reconstructor import PhotometricReconstructor
from gellight.series.window import WindowReconstructor
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from tests.helpers.virtual_sensor import VirtualCamera, virtual_sensor

PLACES, STEP_MM = 16, 5.0 / 30
HELD_US, STREAMED_US, PLAIN_US = 25_200.0, 14_000.0, 8_000.0
WARM_UP, RESULTS = 16, 12
SCENE = Scene(SensorGeometry(), CameraResponse(noise_grey=1.0))
BUNDLE = load_bundle("synthetic")


@lru_cache(maxsize=PLACES)
def gel_at(place: int):  # type: ignore[no-untyped-def]
    """Return the gel and its light under the ball at one of its places; the light of each LED takes long."""
    return SCENE._compute(Press("BALL", 1.0, (place - PLACES / 2) * STEP_MM, -1.0))


class RollingCamera(VirtualCamera):
    """Sees the ball one step further with each frame, `PLACES` steps to and fro; at rest if not `rolling`."""

    image_shape = (480, 640)

    def prepare(self, exposure_us: float, rolling: bool) -> None:
        """Set it up."""
        self.rolling, self.places = rolling, {}
        self.shutter = replace(self.shutter, exposure_us=exposure_us)
        self.response = replace(SCENE.response, exposure=SCENE.response.exposure * exposure_us / PLAIN_US)

    def place(self, sequence: int) -> int:
        """Where the ball is in a frame."""
        turn = sequence % (2 * PLACES - 2)
        return min(turn, 2 * PLACES - 2 - turn) if self.rolling else PLACES // 2

    def picture(self, weights: NDArray[np.floating]) -> NDArray[np.uint8]:
        """(480, 640, 3) with noise."""
        lit = gel_at(self.place(self.count))
        before, SCENE.response, SCENE._lit = SCENE.response, self.response, lit
        try:
            light = weights[0] if weights.ndim == 3 and np.ptp(weights, axis=0).max() < 1e-9 else weights
            grey, _ = SCENE.show(lit[0], light)
        finally:
            SCENE.response = before
        return digitise(grey, 1.0, self.rng)


@dataclass
class Row:
    """What one way of measuring gives."""

    name: str
    compute_s: list[float] = field(default_factory=list)
    angle: list[float] = field(default_factory=list)
    depth_um: list[float] = field(default_factory=list)
    span_ms: list[float] = field(default_factory=list)
    flagged: list[float] = field(default_factory=list)
    age_ms: list[float] = field(default_factory=list)
    oldest_ms: list[float] = field(default_factory=list)
    rate: float = 0.0

    def note(self, felt: TactileFrame, place: int) -> None:
        """Compare with the truth."""
        _, surface, _ = gel_at(place)
        where = surface.contact
        self.angle.append(float(angle_deg(felt.normal_map, normals(surface.gradient_map))[where].mean()))
        self.depth_um.append(float(np.abs(felt.depth_mm - surface.depth_mm)[where].mean()) * 1e3)
        if felt.exposures:
            self.span_ms.append(felt.exposures.duration_s * 1e3)
            self.flagged.append(float(felt.exposures.moving[where].mean()))

    def note_age(self, frame: CameraFrame, felt: TactileFrame, done_s: float) -> None:
        """Note how old a result is that is there at `done_s`, on the clock of its frame."""
        newest_s = frame.closing.time_s if isinstance(frame, ExposureSeries) else frame.time_s
        self.age_ms.append((done_s - newest_s) * 1e3)
        self.oldest_ms.append(self.age_ms[-1] + (felt.exposures.duration_s * 1e3 if felt.exposures else 0.0))

    def text(self, network_s: float) -> str:
        """Return a line of the table."""
        span = f"{np.median(self.span_ms):4.0f} ms" if self.span_ms else "one frame"
        flagged = f"{np.mean(self.flagged):.0%}" if self.flagged else "-"
        return (
            f"{self.name:28} {self.rate:5.1f}/s  {span:>9}  age {np.median(self.age_ms):4.0f} ms,"
            f" of the oldest {np.median(self.oldest_ms):4.0f} ms  {np.mean(self.angle):6.3f} deg"
            f" {np.mean(self.depth_um):7.1f} um  flagged {flagged:>4}"
            f"  {np.median(self.compute_s) / network_s:5.1f} x GelNet"
        )


Way = tuple[str, float, bool, Callable[[VirtualCamera, NDArray[np.uint8]], Camera], Callable[[], FramePath]]


def ways() -> Iterator[Way]:
    """Name, exposure, strobe, camera and frame path of each way."""
    model = read_lights(BUNDLE)
    timing = CameraTiming(exposure_s=STREAMED_US * 1e-6, pulse_period_s=5e-4)

    def streamed(mode: LightMode) -> Callable[[VirtualCamera, NDArray[np.uint8]], Camera]:
        return lambda camera, groups: WindowCamera(
            SequencedCamera(camera, groups, mode=mode, timing=timing), groups, exposure_us=STREAMED_US
        )

    yield "GelNet", PLAIN_US, False, lambda camera, _: camera, lambda: Reconstructor(BUNDLE)
    for kind in LightGroups:
        lights = 12 if kind is LightGroups.SINGLES else 4
        yield (
            f"series, hold, {lights} lights", HELD_US, False,
            lambda camera, groups: SeriesCamera(camera, groups, exposure_us=None, frames=1),
            lambda kind=kind: PhotometricReconstructor(BUNDLE, model, kind),
        )  # fmt: skip
        for mode in (LightMode.FREE, LightMode.EXT):
            yield (
                f"window, {mode}, {lights} lights", STREAMED_US, mode is LightMode.EXT, streamed(mode),
                lambda kind=kind: WindowReconstructor(BUNDLE, model, kind),
            )  # fmt: skip


def measure(way: Way, rolling: bool) -> Row:
    """Measure one way."""
    name, exposure_us, strobe, wrapped, path = way
    row, kind = Row(name), LightGroups.SINGLES if "12" in name else LightGroups.TRIPLES
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.helpers.virtual_sensor.VirtualCamera", RollingCamera)
        inner = virtual_sensor(patch, strobe=strobe)
        assert isinstance(inner, RollingCamera)
        inner.prepare(exposure_us, rolling)
        inner.ring.light(BUNDLE.colours)
        with wrapped(inner, read_lights(BUNDLE).groups(kind)) as camera:
            frame_path, results = path(), RESULTS if exposure_us != HELD_US else RESULTS // 2
            for _ in range(WARM_UP if exposure_us == STREAMED_US else 1):
                frame_path.reconstruct(camera.read())
            begun_s = inner.clock.monotonic()
            frames = [(camera.read(), inner.clock.monotonic()) for _ in range(results)]
            row.rate = results / (inner.clock.monotonic() - begun_s)
            for frame, read_s in frames:
                started_s = time.perf_counter()
                felt = frame_path.reconstruct(frame)
                row.compute_s.append(time.perf_counter() - started_s)
                row.note_age(frame, felt, read_s + row.compute_s[-1])
                row.note(felt, inner.place(round((frame.time_s - inner.begin_s) / inner.period_s) + 1))
    return row


def main() -> None:
    """Print both tables."""
    for rolling in (False, True):
        print("a ball rolls at 5 mm/s" if rolling else "a ball rests", flush=True)
        network_s = 0.0
        for way in ways():
            row = measure(way, rolling)
            network_s = network_s or float(np.median(row.compute_s))
            print("  " + row.text(network_s), flush=True)


if __name__ == "__main__":
    main()
