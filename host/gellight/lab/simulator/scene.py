"""What a simulated camera looks at: the gel under a press, lit by the ring, before the noise of the camera."""

import threading
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gellight.frames.shear import ShearTruth
from gellight.lab.simulator.bodies import BODY_NAMES, body
from gellight.lab.simulator.dragging import Motion, Sheared, sheared
from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.simulator.objects import press_object
from gellight.lab.simulator.printed_dots import PrintedDots, paint, seen_px
from sim_reference import gel
from sim_reference.camera import WHITE, CameraResponse, exposure_for, linear_grey
from sim_reference.deformation import Deformation, GelModel
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.imaging import led_irradiance, ring_light
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE, Surface, sample, shape_at, untouched

Array = NDArray[np.float64]
BRIGHTEST_GREY = 200.0
"""of the untouched gel, at its brightest pixel: slopes that face the LEDs still do not clip"""
SPACING_MM = GRID_EXTENT_MM / GRID_SIZE
MARGIN_MM = 15.0
"""of gel around a body: three thicknesses of the default gel"""
READY = 2
"""presses computed ahead that are kept, 15 MB each"""


@dataclass(frozen=True)
class Press:
    """An object in the gel: how deep in mm, and where its centre is, in mm from the image centre."""

    object_name: str
    depth_mm: float
    x_mm: float = 0.0
    y_mm: float = 0.0
    path: tuple[Motion, ...] = ()
    """along which it was then moved sideways"""
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """about x, y and z at once: the axis of the turn, as long as its angle; about the object's origin"""
    within_mm: float = 0.0
    """radius of the circle that the object is cut by; 0: it is whole"""

    @property
    def place(self) -> Motion:
        """x, y mm from the image centre and the turn, rad, of the object now."""
        x, y, turn = self.path[-1] if self.path else (0.0, 0.0, 0.0)
        return self.x_mm + x, self.y_mm + y, turn

    @property
    def is_body(self) -> bool:
        """Whether it is pressed as a mesh: turned, cut, or known as a mesh alone."""
        return any(self.turn_rad) or self.within_mm > 0 or self.object_name in BODY_NAMES

    @property
    def pose(self) -> Array:
        """(4, 4) carries points of the object, mm, to x right, y down, z towards the camera from the image centre."""
        x, y, dragged_rad = self.place
        rotation = (Rotation.from_rotvec([0, 0, dragged_rad]) * Rotation.from_rotvec(self.turn_rad)).as_matrix()
        top_mm = self.upper_side[1] if self.is_body else 0.0
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, (x, y, self.depth_mm - top_mm)
        return pose

    @property
    def upper_side(self) -> tuple[Array, float]:
        """What of the body meets the gel, on a grid of its own, and its top: see `Body.upper_side`."""
        return _upper_side(self.object_name, self.within_mm, self.turn_rad)


@dataclass(frozen=True, kw_only=True)
class Printed:
    """Dots on the gel, and how an object drags it."""

    dots: PrintedDots
    friction: float = 0.6
    """coefficient between object and gel"""


@lru_cache(maxsize=2)
def _upper_side(name: str, within_mm: float, turn_rad: tuple[float, float, float]) -> tuple[Array, float]:
    """Return the height of a turned body on a grid of its own, and its top: see `Body.upper_side`."""
    turned = body(name, within_mm)
    most = round(min(GRID_SIZE, 2 * (turned.reach_mm + MARGIN_MM) / SPACING_MM))
    size = min(GRID_SIZE, scipy.fft.next_fast_len(most, real=True))
    return turned.upper_side(Rotation.from_rotvec(turn_rad).as_matrix(), size, SPACING_MM)


@lru_cache(maxsize=16)
def deformed(name: str, depth_mm: float, geometry: SensorGeometry, model: GelModel) -> Deformation:
    """Return what a press does to the gel: the same for every scene, and wherever it happens."""
    return _as(np.float32, press_object(name, depth_mm, geometry, model))


@lru_cache(maxsize=64)
def deformed_by_body(press: Press, geometry: SensorGeometry, model: GelModel) -> Deformation:
    """Press a body, wherever that happens: `press` lies in the middle."""
    return _as(np.float32, model(press.upper_side[0], SPACING_MM, press.depth_mm, geometry))


def _as(kind: type[np.floating], deformation: Deformation) -> Deformation:
    """Return it in that precision: float32, in which it is kept, rounds by 1e-7 of the depth and halves the memory."""
    return replace(deformation, depth_mm=deformation.depth_mm.astype(kind), pressure=deformation.pressure.astype(kind))


@lru_cache(maxsize=4)
def _in_use(kept: Deformation) -> Deformation:
    """Return a deformation whose spline, twice as large as what is kept, lives as long as it is looked at."""
    return _as(np.float64, kept)


Lit = tuple[Press | None, Surface, NDArray[np.float32]]
"""a press, the gel under it, and (12, H, W) its irradiance by every LED, full on"""


class Scene:
    """Computes what the camera would see without noise, and keeps what it will need again."""

    def __init__(
        self,
        geometry: SensorGeometry,
        response: CameraResponse,
        led_gain: Array | None = None,
        *,
        model: GelModel = gel.press,
        printed: Printed | None = None,
        measured: MeasuredLight | None = None,
    ) -> None:
        """Render the untouched gel and choose the exposure that makes its brightest pixel `BRIGHTEST_GREY`.

        led_gain: (12,) how bright each LED really is, as a share of its nominal brightness; it does not move the
        exposure. `model` computes the gel. printed: the dots on it; without, nothing is computed along the gel.
        measured: the light of a real unit in place of the ring's: red, green and blue as three LEDs, exposed as given.
        """
        self.geometry = geometry
        self.measured = measured
        self.light = np.eye(3) if measured else ring_light(geometry)
        self._model, self.printed = model, printed
        self.led_gain = np.ones(len(self.light)) if led_gain is None else led_gain
        self._gel = SensorGeometry(
            gel_diameter_mm=geometry.gel_diameter_mm,
            gel_thickness_mm=geometry.gel_thickness_mm,
            poisson_ratio=geometry.poisson_ratio,
            coating_smoothing_mm=geometry.coating_smoothing_mm,
        )
        """what a deformation depends on"""
        self._flat = untouched(geometry).single_precision()
        self._lit: Lit = None, self._flat, self._light_up(self._flat, None)
        self._untouched_lit = self._lit
        self._ready: dict[Press, Lit] = {}
        self._keeping = threading.Lock()
        self.response = response
        if measured is None:
            irradiance = under_light(self._lit[2], self.light)
            self.response = replace(response, exposure=exposure_for(irradiance, response, BRIGHTEST_GREY))

    def show(self, press: Press | None, light: Array | None = None) -> tuple[NDArray[np.float32], Surface]:
        """Return the picture before noise, (H, W, 3) grey levels, and the gel surface, under `press`.

        `light` is (12, 3), or (H, 12, 3) where rows see different light, 0 to 1; default: the ring as designed.
        """
        self.prepare(press)
        shown = (self.light if light is None else light) * self.led_gain[:, None]
        irradiance = under_light(self._lit[2], shown)
        return linear_grey(irradiance, self.response).astype(np.float32), self._lit[1]

    def prepare(self, press: Press | None) -> None:
        """Do what takes long, unless it was done ahead: deform the gel and light it with every LED."""
        if press is None:
            self._lit = self._untouched_lit
        elif self._lit[0] != press:
            self._lit = self._ready.get(press) or self._compute(press)

    def prepare_ahead(self, press: Press) -> None:
        """Do what takes long for a press that will be shown; any thread may, while others show something else."""
        if self.is_ready(press):
            return
        lit = self._compute(press)
        with self._keeping:
            kept = list(self._ready.items())[1 - READY :]
            self._ready = {**dict(kept), press: lit}

    def is_ready(self, press: Press | None) -> bool:
        """Whether a press can be shown at once."""
        return press in (None, self._lit[0]) or press in self._ready

    def deformation(self, press: Press) -> Deformation:
        """Return what the press does to the gel, on the grid of the object."""
        if press.is_body:
            return _in_use(deformed_by_body(replace(press, x_mm=0.0, y_mm=0.0, path=()), self._gel, self._model))
        return _in_use(deformed(press.object_name, press.depth_mm, self._gel, self._model))

    def shear(self, press: Press | None) -> ShearTruth | None:
        """Return how the gel is moved along itself; None where no dots are printed on it."""
        if self.printed is None:
            return None
        dots_px, dots_mm = self._dots(press)
        x, y = pixel_grid(self.geometry)
        shape = self.geometry.image_shape
        moved, sticks, share, force = np.zeros((*shape, 2), np.float32), np.zeros(shape, bool), 0.0, (0.0, 0.0, 0.0)
        if press is not None:
            gel_now = self._sheared(press)
            grid_x, grid_y = np.broadcast_arrays(x - press.x_mm, y - press.y_mm)
            moved = gel_now.moved_mm(grid_x, grid_y).astype(np.float32)
            sticks = gel_now.sampled(gel_now.gel.sticks.astype(np.float64), grid_x, grid_y, order=0) > 0
            share, force = gel_now.sticking_share, gel_now.force()
        modulus = FemGel().shear_modulus_mpa(self.geometry)
        return ShearTruth(
            dots_px=dots_px,
            dots_mm=dots_mm,
            field_mm=moved,
            force_n=(force[0] * modulus, force[1] * modulus),
            torque_nmm=force[2] * modulus,
            sticks=sticks,
            sticking_share=share,
        )

    def _sheared(self, press: Press) -> Sheared:
        assert self.printed is not None
        return sheared(self.deformation(press), self._gel, self.printed.friction, press.path)

    def _dots(self, press: Press | None) -> tuple[Array, Array]:
        """(N, 2) px of the dots in the picture and (N, 2) mm by which the gel has moved them along itself."""
        assert self.printed is not None
        places = self.printed.dots.places_mm
        moved, depth = np.zeros_like(places), np.zeros(len(places))
        if press is not None:
            moved = self._sheared(press).moved_mm(places[:, 0] - press.x_mm, places[:, 1] - press.y_mm)
            now = places + moved
            depth = shape_at(self.deformation(press), now[:, 0], now[:, 1], *press.place)[0]
        return seen_px(places + moved, depth, self.geometry), moved

    def _compute(self, press: Press) -> Lit:
        surface = sample(self.deformation(press), self.geometry, *press.place).single_precision()
        return press, surface, self._light_up(surface, press)

    def _light_up(self, surface: Surface, press: Press | None) -> NDArray[np.float32]:
        """(12, H, W) irradiance of every LED, full on, or (3, H, W) measured light, darkened by the dots."""
        if self.measured is not None:
            grey = self.measured.grey(surface.gradient_map[..., 0], surface.gradient_map[..., 1])
            pictures = np.moveaxis(grey, 2, 0) / np.float32(WHITE)
        else:
            pictures = np.empty((len(self.light), *self.geometry.image_shape), np.float32)
            for led, picture in enumerate(pictures):
                picture[:] = led_irradiance(surface, self.geometry, led)
        if self.printed is not None:
            dots, size = self.printed.dots, self.geometry.pixel_size_mm
            paint(pictures, self._dots(press)[0][dots.printed], dots.diameter_mm / size, dots.albedo)
        return pictures


def under_light(lit: NDArray[np.float32], light: Array) -> Array:
    """(H, W, 3) sum of (12, H, W) irradiances under light (12, 3), or (H, 12, 3) where rows see different light."""
    total = np.zeros((*lit.shape[1:], 3), np.float32)
    for led, channel in np.argwhere(light.reshape(-1, *light.shape[-2:]).any(axis=0)):
        share = light[..., led, channel].astype(np.float32)
        total[..., channel] += lit[led] * (share[:, None] if share.ndim else share)
    return np.asarray(total)
