"""A simulated sensor that feels whatever a robot simulator presses into it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gellight.base.allowed import nearest
from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.lab.simulator.printed_dots import PrintedDots, paint, seen_px
from gellight.lab.simulator.shutter import ReadNoise
from gellight.lab.simulator.unit import GEL, Unit
from gellight_touch.layer import NOTHING, Floats, Layer
from gellight_touch.picture import Pictures, UnitPictures
from gellight_touch.traction import Sheared, Traction, check_grid
from sim_reference.camera import CameraResponse
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import AS_BUILT, SensorGeometry, pixel_grid
from sim_reference.surface import GRID_EXTENT_MM

SINKING_ERROR = 1e-3
"""of the force that a layer is to carry"""
MOST_SINKING = 40
"""solutions of the layer until it carries a force"""


@dataclass(frozen=True, eq=False)
class Felt:
    """A gel under what presses it, on the layer's grid: rows along y, columns along x, from the gel's centre."""

    pressure_mpa: Floats
    """(n, n), 0 outside of the contact"""
    depth_mm: Floats
    """(n, n) positive into the sensor, of the coated gel"""
    at_mm: NDArray[np.float64]
    """(n,) coordinates of rows and columns"""

    @property
    def contact(self) -> NDArray[np.bool_]:
        """(n, n) where something touches."""
        return np.asarray(self.pressure_mpa > 0)

    @property
    def force_n(self) -> float:
        """The normal force, N."""
        return float(self.pressure_mpa.sum(dtype=np.float64)) * float(self.at_mm[1] - self.at_mm[0]) ** 2

    @property
    def centre_mm(self) -> tuple[float, float]:
        """Where the normal force acts, (x, y) mm; the middle of the gel where nothing touches."""
        total = float(self.pressure_mpa.sum(dtype=np.float64))
        if total == 0:
            return 0.0, 0.0
        along_x, along_y = self.pressure_mpa.sum(axis=0), self.pressure_mpa.sum(axis=1)
        return float(along_x @ self.at_mm) / total, float(along_y @ self.at_mm) / total


class TouchSensor:
    """One gel and its camera; it draws the noise of its camera, so it serves one gel and one thread."""

    def __init__(
        self,
        sensor: SensorGeometry | Bundle | None = None,
        *,
        size: int = 128,
        extent_mm: float | None = None,
        youngs_modulus_mpa: float | None = None,
        response: CameraResponse | None = None,
        cast_shadows: bool = True,
        seed: int = 0,
        gel: Mapping[str, float] | None = None,
        dots: PrintedDots | None = None,
    ) -> None:
        """Prepare a gel of `size` x `size` points over `extent_mm` mm, default: 64, of a bundle what its view needs.

        sensor: how it is built, default: as in the paper; or the bundle of a real unit that was calibrated from
        presses, whose pictures are then drawn by the light they measured, without cast shadows. response: of the
        camera; a bundle has its own. Without cast_shadows steep walls cast none. gel: what you know of a unit's gel
        better than its bundle, by the names of `simulator.unit.GEL`. dots: printed on the gel. Raises InputError for a
        grid or gel that cannot be, and BundleError for a bundle that keeps no presses.
        """
        self.geometry, unit = _built(sensor, gel or {})
        self.light = unit.light if unit else None
        """what its presses showed, for a real unit"""
        if extent_mm is None:
            extent_mm = _reach_mm(self.geometry) if unit else GRID_EXTENT_MM
        if youngs_modulus_mpa is None:
            youngs_modulus_mpa = unit.youngs_modulus_mpa if unit else FemGel.youngs_modulus_mpa
        _check_grid(size, extent_mm, youngs_modulus_mpa)
        shear_modulus_mpa = youngs_modulus_mpa / 2 / (1 + self.geometry.poisson_ratio)
        self.layer = Layer(self.geometry, size, extent_mm, shear_modulus_mpa)
        self._traction = Traction(
            self.layer.at_mm, self.geometry.gel_thickness_mm, self.geometry.poisson_ratio, shear_modulus_mpa
        )
        self._shadows, self.dots = cast_shadows, dots
        self._response = response or (unit.response() if unit else CameraResponse())
        self._pictures: Pictures | UnitPictures | None = None
        self._noise = ReadNoise(np.random.default_rng(seed))

    def seed(self, seed: int) -> None:
        """Begin the noise of the pictures anew: the same seed and the same touches give the same bytes."""
        self._noise = ReadNoise(np.random.default_rng(seed))

    def feel(self, gap_mm: Floats) -> Felt:
        """Return the gel under objects at the distance `gap_mm` (n, n) from its surface at rest, mm.

        A gap is negative where an object would penetrate, `layer.NOTHING` where none is. Raises ValueError for a gap
        that is none, an object deeper than 60 % of the gel, or a contact nearer than two gel thicknesses to the border
        of the grid, and NotConverged.
        """
        pressure = self.layer.pressure_mpa(gap_mm)
        return Felt(pressure, self.layer.depth_mm(pressure), self.layer.at_mm)

    def drag(
        self, felt: Felt, motion: tuple[float, float, float], *, friction: float = 0.8, before: Sheared | None = None
    ) -> Sheared:
        """Return the traction when what presses has moved along the gel by `motion` since it touched.

        motion: x mm, y mm, and rad from x to y about the gel's centre. friction: Coulomb's coefficient. before: the
        step before on a path that turns. Raises InputError for what is negative or not finite, and NotConverged.
        """
        return self._traction.drag(felt.pressure_mpa, motion, friction, before)

    def go_on(
        self, felt: Felt, moved_mm: NDArray[np.float64], *, friction: float = 0.8, before: Sheared | None = None
    ) -> Sheared:
        """Return the traction when what lies on each point has gone by `moved_mm` (n, n, 2) since `before`.

        For a path, and for objects that move otherwise than each other; raises as `drag`.
        """
        return self._traction.go_on(felt.pressure_mpa, moved_mm, friction, before)

    def pull(
        self, felt: Felt, force_n: tuple[float, float], torque_nmm: float = 0.0, *, friction: float = 0.8
    ) -> Sheared:
        """Return the traction when what presses was moved along the gel until it carries a load.

        force_n: on the gel along x and y; torque_nmm: about the gel's centre, from x to y. What is more than friction
        holds slips everywhere, along the load. Raises InputError for what is negative or not finite, and NotConverged.
        """
        return self._traction.pull(felt.pressure_mpa, felt.centre_mm, (*force_n, torque_nmm), friction)

    def sink(self, gap_mm: Floats, force_n: float) -> Felt:
        """Return the gel under objects that were moved along its normal until it carries `force_n` N.

        The force of a contact with a flat gel is monotonous in depth, so a secant within bounds finds it. Raises
        ValueError where the force is negative or beyond what the gel carries at its deepest, where nothing lies before
        the gel, and as `feel`.
        """
        if not force_n >= 0:
            raise ValueError(f"a force of {force_n:g} N: give 0 or more")
        gap = self.layer.before(gap_mm)
        nearest = float(gap.min())
        if force_n == 0:
            return self.feel(gap - min(nearest, 0))
        if nearest == NOTHING:
            raise ValueError(f"nothing lies before the gel that could press it with {force_n:.3g} N")
        low, high, at_low, at_high = 0.0, self.geometry.deepest_press_mm, -force_n, None
        depth = min(max(-nearest, 0.05), high)
        for _ in range(MOST_SINKING):
            felt = self.feel(gap - np.float32(nearest + depth))
            over = felt.force_n - force_n
            if abs(over) <= SINKING_ERROR * force_n:
                return felt
            if over < 0:
                if depth >= self.geometry.deepest_press_mm:
                    raise ValueError(
                        f"the gel carries {felt.force_n:.3g} N at its deepest, {force_n:.3g} N are too much"
                    )
                low, at_low = depth, over
            else:
                high, at_high = depth, over
            depth = 2 * depth if at_high is None else _between(low, high, at_low, at_high)
            depth = min(depth, self.geometry.deepest_press_mm)
        raise ValueError(f"no depth was found at which the gel carries {force_n:.3g} N")

    def picture(self, felt: Felt, sheared: Sheared | None = None, *, noise: bool = True) -> NDArray[np.uint8]:
        """Return what the camera sees, (H, W, 3) uint8 RGB; sheared: from `drag`, it moves the dots."""
        grey = self.grey(felt, sheared)
        return self._noise.digitise(grey, self._response.noise_grey if noise else 0.0)

    def grey(self, felt: Felt, sheared: Sheared | None = None) -> Floats:
        """Return the picture before noise, (H, W, 3) grey levels."""
        grey = self._drawing(felt).grey(felt.depth_mm)
        if self.dots is not None:
            albedo = self.dots.albedo ** (1 / self._response.gamma)
            diameter_px = self.dots.diameter_mm / self.geometry.pixel_size_mm
            paint(np.moveaxis(grey, 2, 0), self.dots_px(felt, sheared), diameter_px, albedo)
        return grey

    def dots_px(self, felt: Felt, sheared: Sheared | None = None) -> NDArray[np.float64]:
        """Return (N, 2) x, y px of the dots on the gel, beside whose grid it rests.

        Without `sheared` it was pressed and not dragged. Raises InputError where it has no dots.
        """
        if self.dots is None:
            raise InputError("no dots are printed on this gel: give TouchSensor(dots=PrintedDots(columns=9, rows=7))")
        moved = (sheared or self._traction.pressed(felt.pressure_mpa)).tangential_mm
        places = self.dots.places_mm[self.dots.printed]
        now = places + np.stack([_sampled(moved[..., axis], places, felt.at_mm) for axis in (0, 1)], axis=1)
        return seen_px(now, _sampled(felt.depth_mm, now, felt.at_mm), self.geometry)

    def depth_map_mm(self, felt: Felt) -> Floats:
        """Return the depth on the pixels of the camera, (H, W) mm."""
        return self.surface(felt)[0]

    def surface(self, felt: Felt) -> tuple[Floats, Floats, Floats]:
        """Return depth (mm) and its slopes along x and y on the pixels of the camera, (H, W) each."""
        return self._drawing(felt).surface(felt.depth_mm)

    def pressure_map_mpa(self, felt: Felt) -> NDArray[np.float32]:
        """Return the pressure (H, W), MPa, on the pixels: that of the nearest point of the grid, 0 beyond it."""
        spacing_mm, at_mm = self.layer.spacing_mm, self.layer.at_mm
        x, y = (np.rint((at.ravel() - at_mm[0]) / spacing_mm).astype(int) for at in pixel_grid(self.geometry))
        inside = [(at >= 0) & (at < len(at_mm)) for at in (y, x)]
        nearest = felt.pressure_mpa[np.ix_(*(np.clip(at, 0, len(at_mm) - 1) for at in (y, x)))]
        return np.where(np.outer(*inside), nearest, 0).astype(np.float32)

    def _drawing(self, felt: Felt) -> Pictures | UnitPictures:
        """Prepare the tables of the light when the first picture is asked for."""
        check_grid(len(felt.depth_mm), self.layer.size)
        if self._pictures is None and self.light is not None:
            self._pictures = UnitPictures(self.geometry, self.layer.at_mm, self.light)
        elif self._pictures is None:
            self._pictures = Pictures(self.geometry, self.layer.at_mm, self._response, cast_shadows=self._shadows)
        return self._pictures


def _sampled(values: Floats, places_mm: NDArray[np.float64], at_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) values (n, n) at places x, y, linear between the points of the grid."""
    rows_columns = (places_mm[:, ::-1].T - at_mm[0]) / (at_mm[1] - at_mm[0])
    return np.asarray(map_coordinates(np.asarray(values, np.float64), rows_columns, order=1))


def _built(sensor: SensorGeometry | Bundle | None, gel: Mapping[str, float]) -> tuple[SensorGeometry, Unit | None]:
    """Return how a sensor is built, and the real unit that a bundle is of."""
    if not isinstance(sensor, Bundle):
        if gel:
            raise InputError(f"gel = {dict(gel)} corrects a bundle: give one, or a SensorGeometry that says so itself")
        if sensor is not None and not isinstance(sensor, SensorGeometry):
            raise InputError(f"TouchSensor({sensor!r}): give a SensorGeometry, or a bundle by gellight.load_bundle")
        return sensor or AS_BUILT, None
    for name in gel:
        if name not in GEL:
            raise InputError(f"a gel has no {name}: {nearest(name, GEL)}")
    return Unit(sensor).geometry(gel), Unit(sensor)


def _check_grid(size: int, extent_mm: float, youngs_modulus_mpa: float) -> None:
    if size < 16 or not extent_mm > 0 or not youngs_modulus_mpa > 0:
        raise InputError(
            f"a grid of {size} points over {extent_mm:g} mm, Young's modulus {youngs_modulus_mpa:g} MPa: give 16 "
            "points or more, and lengths and moduli above 0"
        )


def _reach_mm(geometry: SensorGeometry) -> float:
    """Return the side of a grid that holds the gel and two gel thicknesses around it, mm."""
    return geometry.gel_diameter_mm + 4 * geometry.gel_thickness_mm


def _between(low: float, high: float, at_low: float, at_high: float) -> float:
    """Return where a line through both ends is 0, but no nearer to either than a twentieth of the way."""
    share = -at_low / (at_high - at_low)
    return low + (high - low) * min(max(share, 0.05), 0.95)
