"""The simulated sensor: a camera that looks at a simulated gel, and a stage on which objects are pressed into it.

`sim://` opens it. What it shows is computed by the reference simulator: the gel's deformation by elastic contact, its
picture under the ring of LEDs with shadows, then the camera's crosstalk, gamma, noise and 8 bit. The ring is lit by the
core of the firmware: what it sends to the LEDs, pulsed and seen by a rolling shutter. Frames come at the camera's rate
while the scene rests; a scene that changes takes as long as it takes to compute, and the frames carry the time at which
it was ready, so their age is true.

Parameters of the URL, all optional: `fps`, `seed`, `noise` (grey levels), `object`, `depth`, `x`, `y` (mm; a press held
from the start), `programme=0` (no presses by itself), `board=0` (steady light without a board), `strobe=1` (each frame
begins with a strobe on the trigger pin of the board, for the light mode ext), `ring_c` (the ring has an NTC of so many
degrees Celsius; by default it has none); and what makes one sensor differ from another: `crosstalk` (share of the other
colours in a channel), `led_spread` (standard deviation of the LEDs' brightness, as a share), `dim` (all LEDs darker by
this share). `dots=9x7` prints columns and rows of marker dots on the gel, `dot_pitch` and `dot_diameter` mm, of
`dot_albedo`, of which the share `dots_missing` has come off; `friction` is its coefficient for what is dragged over
such a gel.
`camera=parallel` sees the gel along parallel rays, not from the height of the camera, and `window=none` lights and
sees it straight, not through gel and acrylic, which bend light.
`sequence=FILE` moves an object as the file says, a step a frame, there and back: see `sequence.py`.
`bundle=BUNDLE` draws the pictures of a real unit, with the light that its calibration measured: see `unit.py`. Its
light is steady, and what tells one simulated sensor from another does not apply.
"""

import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from gellight.base.allowed import query_of
from gellight.base.errors import BoardError, CameraError, ConfigError, InputError
from gellight.base.leds import MOST_LEDS
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, CameraTiming, ReconnectingError
from gellight.frames.dots import find_dots
from gellight.frames.frames import CameraFrame, GroundTruth
from gellight.frames.picture import FILE_NAME as PICTURE_STEPS
from gellight.frames.picture import PictureSteps
from gellight.lab.core_board.simulated_board import SimulatedBoard
from gellight.lab.simulator.printed_dots import known_force
from gellight.lab.simulator.scene import Array, Press, Scene
from gellight.lab.simulator.sequence import read_sequence
from gellight.lab.simulator.shutter import ReadNoise, Shutter, SimulatedControls, row_weights
from gellight.lab.simulator.simulated_url import SimulatedUrl
from gellight.lab.simulator.stage import Stage
from gellight.lab.simulator.unit import CalibratedControls, Unit
from gellight.ring.light_ring import LightRing
from sim_reference.camera import WHITE
from sim_reference.deformation import NotConverged
from sim_reference.geometry import AS_BUILT, SensorGeometry

logger = logging.getLogger(__name__)
DARK_S = 5.0
"""LEDs that the board has made dark are lit again within this time, or never"""

BUFFERS = 3
"""frames that wait for who reads late, as those of a V4L2 camera do"""
CLOSE_S = 1.0
"""as long `close` waits for a press that is computed ahead"""


class SimulatedCamera(Camera):
    """A camera on the simulated gel; a context manager like every camera."""

    def __init__(self, scene: Scene, stage: Stage, *, ring: LightRing | None = None, url: str = "sim://",
                 fps: float = 30.0, seed: int = 0, strobe: bool = False,
                 bundle: Bundle | None = None) -> None:  # fmt: skip
        """Look at `scene` while `stage` presses objects into it, `fps` times a second at most.

        `ring` lights the scene through its simulated board, and is closed with the camera; without it the light is
        steady. With `strobe` each frame begins with an edge on the trigger pin of that board. bundle: of the real
        unit whose light the scene shows; its pictures are drawn as they are after preparing.
        """
        self.url, self.ring = url, ring
        self.stage: Stage = stage
        self.image_shape = scene.geometry.image_shape
        self._scene = scene
        stage.prepare_ahead = scene.prepare_ahead
        self._ahead: threading.Thread | None = None
        self._left_out: set[Press] = set()
        """presses of the programme that cannot be computed"""
        self._press: Press | None = None
        """what the newest frame shows"""
        self._shutter = Shutter()
        self._response = scene.response
        self.bundle = bundle
        self.controls = CalibratedControls(bundle.controls) if bundle else SimulatedControls(self._take_controls)
        self._period_s, self._strobe = 1 / fps, strobe
        self.waiting = 0 if strobe else BUFFERS
        """frames that wait for who reads late: none with a strobe, whose frames begin when they are read"""
        self._noise = ReadNoise(np.random.default_rng(seed))
        self._phases_us = self._shutter.pulse_period_us * np.random.default_rng([seed, 1]).random(len(scene.light))
        self._shown: tuple[Press | None, bytes, NDArray[np.float32], GroundTruth] | None = None
        self._sequence = 0
        self._set_s = -inf
        self._due_s = time.monotonic()
        self._closed = False

    def close(self) -> None:
        """Stop, with the LEDs dark; `read` raises CameraError from now on."""
        self._closed = True
        if self.ring is not None:
            self.ring.close()
        if self._ahead is not None:
            self._ahead.join(CLOSE_S)

    @property
    def bundle_files(self) -> Mapping[str, bytes]:
        """The force of its gel; of a unit, how its pictures were prepared."""
        if self.bundle is None:
            return known_force(self._scene.geometry)
        return {name: content for name, content in self.bundle.files.items() if name == PICTURE_STEPS}

    @property
    def picture_files(self) -> Mapping[str, bytes]:
        """Where its marker dots are; nothing where it has none."""
        if self._scene.printed is None:
            return {}
        untouched = np.clip(self._scene.show(None)[0], 0, WHITE)
        steps = PictureSteps.of(self._scene.geometry.image_shape, None, find_dots(untouched))
        return steps.files() if steps else {}

    def _take_controls(self, exposure_us: float, channel_gain: tuple[float, float, float]) -> None:
        """Set the exposure from the next frame on, and amplify each channel; the noise is amplified with it."""
        base = self._response
        ratio = exposure_us / Shutter().exposure_us
        rows = np.array(base.crosstalk) * np.array(channel_gain)[:, None]
        self._scene.response = replace(
            base,
            exposure=base.exposure * ratio,
            crosstalk=tuple(tuple(row) for row in rows.tolist()),
            noise_grey=base.noise_grey * channel_gain[1],
        )
        self._shutter = replace(self._shutter, exposure_us=exposure_us)
        self._set_s = time.monotonic()

    @property
    def timing(self) -> CameraTiming:
        """When the rows are exposed."""
        shutter = self._shutter
        return CameraTiming(
            exposure_s=shutter.exposure_us * 1e-6,
            readout_s=shutter.readout_us * 1e-6,
            period_s=max(self._period_s, self._least_period_s()),
            pulse_period_s=shutter.pulse_period_us * 1e-6,
        )

    def _least_period_s(self) -> float:
        """Rows are exposed while others are read; a frame that a strobe begins starts when the last one has come."""
        shutter = self._shutter
        return (shutter.duration_us + shutter.transfer_us if self._strobe else shutter.exposure_us) * 1e-6

    def read(self) -> CameraFrame:
        """Wait until the next frame is due, expose it and return it with its truth.

        As from a real sensor, frames come that began after its controls were set and its ring was lit.
        """
        if self._closed:
            raise CameraError(f"{self.url} is closed: open it again")
        press = self._press = self._next_press()
        begun_s, weights, colours = self._expose()
        grey, truth = self._look(press, weights)
        image = self._noise.digitise(grey, self._scene.response.noise_grey)
        self._sequence += 1
        return CameraFrame(image=image, time_s=begun_s, sequence=self._sequence, source=self.url, light=colours,
                           truth=truth)  # fmt: skip

    def _next_press(self) -> Press | None:
        """Return what the next frame shows, computed; while a press of the programme is computed, what is there."""
        press = self.stage.next_press()
        if press is None or self._scene.is_ready(press):
            self._scene.prepare(press)
            return press
        if self.stage.plays:
            if press not in self._left_out and (self._ahead is None or not self._ahead.is_alive()):
                # Python waits for it at its end, and would abort where a thread of a daemon is in a library's code
                self._ahead = threading.Thread(target=self._prepare_ahead, args=(press,), name="scene", daemon=False)
                self._ahead.start()
            return self._press
        with self.stage.computing(press):
            self._scene.prepare(press)
        self._due_s = time.monotonic()
        return press

    def _prepare_ahead(self, press: Press) -> None:
        try:
            self._scene.prepare_ahead(press)
        except NotConverged as error:
            self._left_out.add(press)
            logger.warning("the programme leaves out %s, %g mm deep: %s", press.object_name, press.depth_mm, error)

    def _expose(self) -> tuple[float, Array, NDArray[np.uint8] | None]:
        """Return when the next frame that is due began, and its light as `_light_since` does."""
        given_up_s = time.monotonic() + DARK_S
        while time.monotonic() < given_up_s:
            self._wait_until_due()
            begun_s = self._begin()
            seen = self._light_since(begun_s)
            lit_s = self.ring.lit_since_s() + self._shutter.pulse_period_us * 1e-6 if self.ring else 0.0
            if begun_s >= max(self._set_s, lit_s):
                return begun_s, *seen
        assert self.ring is not None  # without one no frame waits for its light
        why = self.ring.heat.why_dark(self.url)
        raise (
            BoardError(why) if self.ring.dimmed else ReconnectingError(why)
        )  # a busy computer is quiet again some time

    def _wait_until_due(self) -> None:
        """Wait for the next frame. The schedule stays: `waiting` frames wait for who reads late, no others."""
        late = int((time.monotonic() - self._due_s) / self._period_s) - self.waiting
        self._due_s += self._period_s * max(late, 1)
        if not self.waiting:
            self._due_s = max(self._due_s, time.monotonic())
        time.sleep(max(self._due_s - time.monotonic(), 0.0))

    def _begin(self) -> float:
        """Return when the frame that now is due began (`time.monotonic`); with a strobe, begin it and wait."""
        taken_s = (self._shutter.duration_us + self._shutter.transfer_us) * 1e-6
        if not self._strobe:
            return self._due_s - taken_s
        begun_s = self._board().strobe()
        time.sleep(max(begun_s + taken_s - time.monotonic(), 0.0))
        return begun_s

    def _board(self) -> SimulatedBoard:
        """Return the board of the ring; CameraError where it is gone."""
        board = self.ring.transport if self.ring else None
        if not getattr(board, "running", False):
            raise CameraError(f"{self.url}: the board of the light ring is gone, and the gel is dark: start again")
        return cast(SimulatedBoard, board)

    def _light_since(self, begun_s: float) -> tuple[Array, NDArray[np.uint8] | None]:
        """(12, 3) or (H, 12, 3) light of the exposure that began then, and the colours that were latched then."""
        if self.bundle is not None:
            return self._scene.light, None
        if self.ring is None:
            return self._scene.light, np.round(self._scene.light * 255).astype(np.uint8)
        source = self._board()
        start_us = source.virtual_us(begun_s)
        lights = source.light_during(start_us - self._shutter.pulse_period_us, start_us + self._shutter.duration_us)
        weights = row_weights(lights, start_us, self.image_shape[0], self._phases_us, self._shutter)
        same = np.ptp(weights, axis=0).max() < 1e-9
        return (weights[0] if same else weights), source.light_at(start_us)

    def _look(self, press: Press | None, light: Array) -> tuple[NDArray[np.float32], GroundTruth]:
        key = light.round(9).tobytes() + repr(self._scene.response).encode()
        if self._shown is None or self._shown[:2] != (press, key):
            grey, surface = self._scene.show(press, light)
            truth = GroundTruth(
                depth_mm=surface.depth_mm.astype(np.float32, copy=False),
                gradient_map=surface.gradient_map.astype(np.float32, copy=False),
                contact=surface.contact,
                object_name=press.object_name if press else "",
                press_depth_mm=press.depth_mm if press else 0.0,
                place_mm=press.place[:2] if press else (0.0, 0.0),
                shear=self._scene.shear(press),
                pose=press.pose if press else None,
            )
            self._shown = press, key, grey, truth
        return self._shown[2], self._shown[3]


def open_simulated(url: str, geometry: Mapping[str, float | int | str] | None = None) -> SimulatedCamera:
    """Open a simulated sensor as `url` says; `geometry` is how it differs from the default one.

    Raises InputError for a parameter that is unknown or out of range and for finite elements that do not fit the
    memory, ConfigError for a sensor that cannot be built, and BundleError for a bundle that keeps no presses.
    """
    wanted = query_of(url, SimulatedUrl)
    unit = wanted.unit()
    sensor = built({**(geometry or {}), **wanted.optics()}, unit)
    stage = Stage(sensor, programme=wanted.programme)
    if wanted.model_fields_set & {"object_name", "depth", "x", "y"}:
        stage.hold(wanted.object_name or "BALL", wanted.depth, wanted.x, wanted.y)
    if wanted.sequence:
        stage.play(read_sequence(Path(wanted.sequence), sensor).presses)
    scene = _scene(wanted, sensor, unit)
    if wanted.strobe and not wanted.board:
        raise InputError(f"{url}: a strobe needs the board whose light it moves on: leave out board=0, or strobe=1")
    if wanted.ring_c is not None and not wanted.board:
        raise InputError(f"{url}: it is the board that reads the ring's temperature: leave out board=0, or ring_c")
    if wanted.board and unit is None:
        check_drivable(len(scene.light))
    colours = np.round(scene.light * 255).astype(np.uint8)
    ring = lit_ring(colours, wanted.ring_c) if wanted.board and unit is None else None
    return SimulatedCamera(scene, stage, ring=ring, url=url, fps=wanted.fps, seed=wanted.seed,
                           strobe=wanted.strobe, bundle=unit.bundle if unit else None)  # fmt: skip


def _scene(wanted: SimulatedUrl, sensor: SensorGeometry, unit: Unit | None) -> Scene:
    """Return what the camera looks at."""
    printed = wanted.printed()
    if unit is not None:
        response = unit.response(wanted.noise if "noise" in wanted.model_fields_set else None)
        return Scene(sensor, response, printed=printed, measured=unit.light)
    gain = wanted.led_gain(len(sensor.led_colours))
    return Scene(sensor, wanted.response(), gain, printed=printed)


def check_drivable(leds: int) -> None:
    """Raise ConfigError for more LEDs than the board of the light ring can drive."""
    if leds > MOST_LEDS:
        raise ConfigError(
            f"the sensor has {leds} LEDs, the board of the light ring drives {MOST_LEDS} at most: give fewer "
            "led_colours, or use sim://?board=0 for steady light without a board"
        )


def lit_ring(colours: NDArray[np.uint8], ring_c: float | None = None) -> LightRing:
    """Start a board with as many LEDs as (n, 3) `colours`, and an NTC so warm, and light them."""
    ring = LightRing(SimulatedBoard(leds=len(colours), ring_c=ring_c), timeout_s=1.0)
    try:
        ring.light(colours)
    except BaseException:
        ring.close()
        raise
    return ring


def built(geometry: Mapping[str, float | int | str], unit: Unit | None = None) -> SensorGeometry:
    """Return the default sensor, or a unit, with the values of `geometry` instead; ConfigError if it cannot be."""
    if unit is not None:
        return unit.geometry(geometry)
    try:
        return replace(AS_BUILT, **geometry)  # type: ignore[arg-type]  # the names and types were checked by the settings
    except ValueError as error:
        raise ConfigError(f"the simulated sensor cannot be built: {error}") from None
