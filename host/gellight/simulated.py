"""The simulated sensor: a camera that looks at a simulated gel, and a stage on which objects are pressed into it.

`sim://` opens it. What it shows is computed by the reference simulator: the gel's deformation by elastic contact, its
picture under the ring of LEDs with shadows, then the camera's crosstalk, gamma, noise and 8 bit. Frames come at the
camera's rate while the scene rests; a scene that changes takes as long as it takes to compute, and the frames carry the
time at which it was ready, so their age is true.

Parameters of the URL, all optional: `fps`, `seed`, `noise` (grey levels), `object`, `depth`, `x`, `y` (mm; a press held
from the start), `programme=0` (no presses by itself).
"""

import itertools
import threading
import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import hypot
from urllib.parse import parse_qsl, urlsplit

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.camera import Camera
from gellight.errors import CameraError, ConfigError, InputError
from gellight.frames import CameraFrame, GroundTruth
from gellight.selfcheck import SelfCheck
from sim_reference.camera import CameraResponse, digitise, exposure_for, linear_grey
from sim_reference.gel import Deformation
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.objects import OBJECT_NAMES
from sim_reference.surface import Surface, press_object, sample, untouched

BRIGHTEST_GREY = 200.0
"""of the untouched gel, at its brightest pixel: slopes that face the LEDs still do not clip"""
RETURN_FRAMES = 300
"""so long after a visitor's last touch the programme goes on"""
KEPT_DEFORMATIONS = 64


@dataclass(frozen=True)
class Press:
    """An object in the gel: how deep in mm, and where its centre is, in mm from the image centre."""

    object_name: str
    depth_mm: float
    x_mm: float = 0.0
    y_mm: float = 0.0


PROGRAMME = (
    Press("BALL", 1.0, 0.0, 0.0),
    Press("BALL", 1.5, -9.0, 4.0),
    Press("TSTEP", 0.8, 0.0, 0.0),
    Press("BALL", 0.7, 10.0, -5.0),
    Press("SINWAVE", 0.9, 0.0, 0.0),
    Press("CCONVEX", 0.9, 0.0, 0.0),
)


def programme_of_presses() -> Iterator[Press | None]:
    """Yield what a virtual hand does in each frame, for ever: press in, hold, release, pause."""
    for press in itertools.cycle(PROGRAMME):
        steps = np.linspace(0, 1, 6)[1:]
        ramp = [replace(press, depth_mm=round(float(press.depth_mm * step), 3)) for step in steps]
        yield from (step for step in ramp for _ in range(2))
        yield from itertools.repeat(press, 90)
        yield from (step for step in reversed(ramp[:-1]) for _ in range(2))
        yield from itertools.repeat(None, 15)


class Stage:
    """Presses objects into the gel, on behalf of a visitor or of the programme."""

    objects: tuple[str, ...] = OBJECT_NAMES

    def __init__(self, geometry: SensorGeometry, *, programme: bool = True) -> None:
        """Start with nothing in the gel; `programme` lets the virtual hand play while no visitor presses."""
        self._geometry = geometry
        self._lock = threading.Lock()
        self._wanted: Press | None = None
        self._programme = programme_of_presses() if programme else None
        self._frames_until_programme = 0

    @property
    def max_depth_mm(self) -> float:
        """Deepest press offered: the elastic layer is a small-strain model."""
        return 0.4 * self._geometry.gel_thickness_mm

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press `object_name` `depth_mm` into the gel at (x, y) from the image centre, until told otherwise.

        Raises InputError for an unknown object, a depth outside 0..max_depth_mm, or a place off the gel.
        """
        self._want(self._checked(object_name, depth_mm, x_mm, y_mm))

    def hold(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press for good: no programme plays afterwards. Raises as `press` does."""
        self._want(self._checked(object_name, depth_mm, x_mm, y_mm))
        self._programme = None

    def _checked(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> Press | None:
        if object_name not in self.objects:
            raise InputError(f"no object {object_name!r}: choose one of {', '.join(self.objects)}")
        if not 0 <= depth_mm <= self.max_depth_mm:
            raise InputError(f"press depth {depth_mm} mm: choose 0 to {self.max_depth_mm:g} mm")
        if not hypot(x_mm, y_mm) <= self._geometry.gel_diameter_mm / 2:
            raise InputError(
                f"a press at ({x_mm}, {y_mm}) mm is off the gel: stay within "
                f"{self._geometry.gel_diameter_mm / 2:g} mm of the centre"
            )
        return Press(object_name, round(depth_mm, 3), x_mm, y_mm) if depth_mm > 0 else None

    def release(self) -> None:
        """Lift the object off the gel."""
        self._want(None)

    def status(self) -> dict[str, object]:
        """Return what is pressed now: object, depth_mm, x_mm, y_mm, visitor (false: the programme plays)."""
        with self._lock:
            press, visitor = self._wanted, self._frames_until_programme > 0
        shown = press or Press("", 0.0)
        return {
            "object": shown.object_name,
            "depth_mm": shown.depth_mm,
            "x_mm": shown.x_mm,
            "y_mm": shown.y_mm,
            "visitor": visitor,
        }

    def next_press(self) -> Press | None:
        """Return what is in the gel during the next frame."""
        with self._lock:
            if self._frames_until_programme > 0:
                self._frames_until_programme -= self._wanted is None
            elif self._programme is not None:
                self._wanted = next(self._programme)
            return self._wanted

    def _want(self, press: Press | None) -> None:
        with self._lock:
            self._wanted = press
            self._frames_until_programme = RETURN_FRAMES


class Scene:
    """Computes what the camera would see without noise, and keeps what it will need again."""

    def __init__(self, geometry: SensorGeometry, response: CameraResponse) -> None:
        """Render the untouched gel and choose the exposure that makes its brightest pixel `BRIGHTEST_GREY`."""
        self.geometry = geometry
        self.light = ring_light(geometry)
        self._deformations: OrderedDict[tuple[str, float], Deformation] = OrderedDict()
        self._flat = untouched(geometry).single_precision()
        irradiance = ring_irradiance(self._flat, geometry, self.light)
        self.response = replace(response, exposure=exposure_for(irradiance, response, BRIGHTEST_GREY))
        self._untouched = linear_grey(irradiance, self.response).astype(np.float32)

    def show(self, press: Press | None) -> tuple[NDArray[np.float32], Surface]:
        """Return the picture before noise, (H, W, 3) grey levels, and the gel surface, under `press`."""
        if press is None:
            return self._untouched, self._flat
        surface = sample(self._deformation(press), self.geometry, press.x_mm, press.y_mm).single_precision()
        irradiance = ring_irradiance(surface, self.geometry, self.light)
        return linear_grey(irradiance, self.response).astype(np.float32), surface

    def _deformation(self, press: Press) -> Deformation:
        key = (press.object_name, press.depth_mm)
        if key not in self._deformations:
            self._deformations[key] = press_object(press.object_name, press.depth_mm, self.geometry)
        self._deformations.move_to_end(key)
        while len(self._deformations) > KEPT_DEFORMATIONS:
            self._deformations.popitem(last=False)
        return self._deformations[key]


class SimulatedCamera(Camera):
    """A camera on the simulated gel; a context manager like every camera."""

    def __init__(self, scene: Scene, stage: Stage, *, url: str = "sim://", fps: float = 30.0, seed: int = 0) -> None:
        """Look at `scene` while `stage` presses objects into it, `fps` times a second at most."""
        self.url = url
        self.stage = stage
        self.image_shape = scene.geometry.image_shape
        self._scene = scene
        self._period_s = 1 / fps
        self._rng = np.random.default_rng(seed)
        self._light = np.round(scene.light * 255).astype(np.uint8)
        self._shown: tuple[Press | None, NDArray[np.float32], GroundTruth] | None = None
        self._sequence = 0
        self._due_s = time.monotonic()
        self._closed = False

    def close(self) -> None:
        """Stop; `read` raises CameraError from now on."""
        self._closed = True

    def selfcheck(self, pixel_size_mm: tuple[float, float]) -> SelfCheck:
        """Return the judge of what is reconstructed from these frames: the simulator that made them."""
        return SelfCheck(self._scene.geometry, self._scene.response, pixel_size_mm)

    def read(self) -> CameraFrame:
        """Wait until the next frame is due, expose it and return it with its truth."""
        if self._closed:
            raise CameraError(f"{self.url} is closed: open it again")
        grey, truth = self._look(self.stage.next_press())
        self._due_s = max(self._due_s + self._period_s, time.monotonic())
        time.sleep(max(self._due_s - time.monotonic(), 0.0))
        exposed_s = time.monotonic()
        image = digitise(grey, self._scene.response.noise_grey, self._rng)
        self._sequence += 1
        return CameraFrame(
            image=image, time_s=exposed_s, sequence=self._sequence, source=self.url, light=self._light, truth=truth
        )

    def _look(self, press: Press | None) -> tuple[NDArray[np.float32], GroundTruth]:
        if self._shown is None or self._shown[0] != press:
            grey, surface = self._scene.show(press)
            truth = GroundTruth(
                depth_mm=surface.depth_mm.astype(np.float32, copy=False),
                gradient_map=surface.gradient_map.astype(np.float32, copy=False),
                contact=surface.contact,
            )
            self._shown = press, grey, truth
        return self._shown[1], self._shown[2]


class SimulatedUrl(BaseModel):
    """The parameters of a `sim://` URL."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    fps: float = Field(30.0, gt=0, le=1000)
    seed: int = Field(0, ge=0)
    noise: float = Field(1.0, ge=0, le=50)
    object_name: str = Field("", alias="object")
    depth: float = Field(0.0, ge=0)
    x: float = 0.0
    y: float = 0.0
    programme: bool = True


def open_simulated(url: str, geometry: Mapping[str, float | int | str] | None = None) -> SimulatedCamera:
    """Open a simulated sensor as `url` says; `geometry` is how it differs from the paper's.

    Raises InputError for a parameter that is unknown or out of range, ConfigError for a sensor that cannot be built.
    """
    try:
        wanted = SimulatedUrl.model_validate(dict(parse_qsl(urlsplit(url).query, strict_parsing=False)))
    except ValidationError as error:
        first = error.errors()[0]
        known = ", ".join(field.alias or name for name, field in SimulatedUrl.model_fields.items())
        raise InputError(f"{url}: {first['loc'][0]}: {first['msg']} (parameters: {known})") from None
    sensor = built(geometry or {})
    stage = Stage(sensor, programme=wanted.programme)
    if wanted.object_name or wanted.depth:
        stage.hold(wanted.object_name or "BALL", wanted.depth, wanted.x, wanted.y)
    scene = Scene(sensor, CameraResponse(noise_grey=wanted.noise))
    return SimulatedCamera(scene, stage, url=url, fps=wanted.fps, seed=wanted.seed)


def built(geometry: Mapping[str, float | int | str]) -> SensorGeometry:
    """Return the paper's sensor with the values of `geometry` instead of its own; ConfigError if it cannot be built."""
    try:
        return SensorGeometry(**geometry)  # type: ignore[arg-type]  # the names and types were checked by the settings
    except ValueError as error:
        raise ConfigError(f"the simulated sensor cannot be built: {error}") from None
