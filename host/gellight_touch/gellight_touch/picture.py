"""The picture of a gel surface, in milliseconds: what `simulator.scene` computes, from tables of the light.

A surface is a cubic spline over the layer's grid: at the pixels' places on the gel at rest that is a product with two
fixed matrices, and what a pinhole sees of it lies linearly between them. Equation 3 of the paper, summed over the LEDs
of a channel, is linear in the slopes; over the depth each coefficient is a parabola through three depths. What a LED
cannot reach is taken off: gel that is turned away from it, pixel by pixel where the slope is that steep, and cast
shadows, found on 160 x 120 cells by the sweep of the frame path.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from gellight.lab.simulator.measured_light import MeasuredLight
from gellight.lab.simulator.scene import BRIGHTEST_GREY
from gellight_touch.layer import Floats
from gellight_touch.shade import Shade
from sim_reference.camera import CameraResponse, exposure_for, linear_grey
from sim_reference.geometry import SensorGeometry, led_positions, pixel_grid
from sim_reference.imaging import arriving_light, ring_light
from sim_reference.refraction import medium_of
from sim_reference.surface import LEAST_RISING
from sim_reference.view import falloff, places, tangents

TRACE = 1e-12
"""below which the weight of a point changes no depth"""
DEPTHS_MM = (0.0, 1.0, 2.0)
"""where the light is computed; between and beyond it is a parabola"""
STEPS = 2
"""of Newton's method between the pixels, after one at the pixel's own place"""


class Tables:
    """Coefficients of the light at every pixel, for the light of the ring as designed."""

    def __init__(self, geometry: SensorGeometry) -> None:
        """Compute them for all LEDs of each channel."""
        self._geometry, self._light = geometry, ring_light(geometry)
        self._leds, self._medium = led_positions(geometry), medium_of(geometry)
        self._x, self._y = np.broadcast_arrays(*pixel_grid(geometry))
        self._passing = falloff(geometry) if geometry.perspective else np.ones(geometry.image_shape)
        """(H, W) share of its light that the view leaves each pixel"""
        sampled = np.stack([self._coefficients(depth) for depth in DEPTHS_MM])
        through = np.linalg.inv(np.vander(DEPTHS_MM, increasing=True))
        self._powers = np.einsum("kd,d...->k...", through, sampled).astype(np.float32)
        """(3, 3, 3, H, W): power of the depth; constant, d/dx and d/dy; channel"""
        self.least_turned = self._least_turned()

    def irradiance(self, depth_mm: Floats, across: Floats, down: Floats) -> Floats:
        """Return the light in each channel, (3, H, W), without cast shadows; depth and slopes are (H, W)."""
        a, b, c = self._powers
        fixed, on_x, on_y = (a[term] + depth_mm * (b[term] + depth_mm * c[term]) for term in range(3))
        light = fixed + on_x * across + on_y * down
        turned = np.flatnonzero(across**2 + down**2 > self.least_turned**2)
        if len(turned):
            self._take_off(light.reshape(3, -1), turned, depth_mm.ravel(), across.ravel(), down.ravel())
        light /= np.sqrt(1 + across**2 + down**2)
        return np.asarray(light)

    def _coefficients(self, depth_mm: float) -> NDArray[np.float64]:
        """(3, 3, H, W): the terms of the light at one depth, for each channel."""
        total = np.zeros((3, 3, *self._geometry.image_shape))
        depth = np.full(self._geometry.image_shape, depth_mm)
        at = places(depth, self._geometry)
        for led in range(len(self._leds)):
            to_x, to_y, to_z, strength = self._led(led, *at, depth)
            strength = strength * self._passing
            terms = np.stack([strength * to_z, -strength * to_x, -strength * to_y])
            total += terms[:, None] * self._light[led][:, None, None]
        return total

    def _led(self, led: int, x: Floats, y: Floats, depth_mm: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the way to where a LED seems to stand, and its light on a surface that faces it, over that length."""
        led_x, led_y, led_z = self._leds[led].tolist()
        to_x, to_y = led_x - x, led_y - y
        strength, to_z = arriving_light(self._geometry, led, to_x, to_y, depth_mm, self._medium)
        return to_x, to_y, to_z, led_z**2 * strength

    def _least_turned(self) -> float:
        """Return the slope below which no pixel is turned away from any LED, down to the deepest press."""
        far = max(np.hypot(led[0] - self._x, led[1] - self._y).max() for led in self._leds)
        return float((self._leds[:, 2].min() - self._geometry.deepest_press_mm) / far)

    def _take_off(self, light: Floats, at: NDArray[np.int64], depth: Floats, across: Floats, down: Floats) -> None:
        """Take off what LEDs behind the surface would give: negative light."""
        shape = self._geometry.image_shape
        x, y = (np.broadcast_to(axis, shape).ravel()[at] for axis in places(depth.reshape(shape), self._geometry))
        for led in range(len(self._leds)):
            to_x, to_y, to_z, strength = self._led(led, x, y, depth[at])
            behind = np.minimum(to_z - across[at] * to_x - down[at] * to_y, 0) * strength * self._passing.ravel()[at]
            for channel in np.flatnonzero(self._light[led]):
                light[channel, at] -= behind * self._light[led, channel]


def _without_traces(weights: NDArray[np.float64]) -> Floats:
    """Return weights without those that change nothing.

    A point counts a quarter as much as the one before it, so far ones are denormal numbers, with which an Intel
    processor multiplies 25 times as slowly.
    """
    return np.where(np.abs(weights) < TRACE, 0, weights).astype(np.float32)


class View:
    """The pixels of a pinhole: where on the gel at rest their rays meet gel that is pressed in."""

    def __init__(self, geometry: SensorGeometry) -> None:
        """Keep, in pixels, how far each ray goes over the gel for a mm that it goes down."""
        height, width = geometry.image_shape
        self._tangents = np.moveaxis(tangents(geometry), 2, 0).astype(np.float32)
        self._px = np.float32(1 / geometry.pixel_size_mm)
        self._column, self._row = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))

    def seen(self, depth_mm: Floats, across: Floats, down: Floats) -> tuple[Floats, Floats, Floats]:
        """Return depth and slopes that the pixels see, for those at their places on the gel at rest, (H, W) each.

        Of f(d) = depth(p - d T) - d for a ray with the tangents T the derivative is -(slopes . T) - 1.
        """
        at_rest, (t_x, t_y) = cv2.merge([depth_mm, across, down]), self._tangents
        least = np.float32(LEAST_RISING)
        met = depth_mm / np.maximum(1 + across * t_x + down * t_y, least)
        for _ in range(STEPS):
            depth, on_x, on_y = cv2.split(self._met(at_rest, met))
            met += (depth - met) / np.maximum(1 + on_x * t_x + on_y * t_y, least)
        depth, on_x, on_y = cv2.split(self._met(at_rest, met))
        return depth, on_x, on_y

    def _met(self, at_rest: Floats, depth_mm: Floats) -> Floats:
        """Return what is (H, W, 3) at the places that rays reach `depth_mm` below the gel at rest."""
        down = depth_mm * self._px
        x, y = self._column - down * self._tangents[0], self._row - down * self._tangents[1]
        return np.asarray(cv2.remap(at_rest, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


class Splines:
    """Surfaces that are given on the layer's grid, at the pixels."""

    def __init__(self, geometry: SensorGeometry, grid_mm: NDArray[np.float64]) -> None:
        """Prepare for depth maps on a square grid with coordinates `grid_mm` (n,); beyond it the gel is flat."""
        x, y = pixel_grid(geometry)
        self._view = View(geometry) if geometry.perspective else None
        spline = make_interp_spline(grid_mm, np.eye(len(grid_mm)), k=3, bc_type="natural")
        self._across, self._d_across, self._down, self._d_down = (
            _without_traces(spline(at, order) * (np.abs(at) <= grid_mm[-1])[:, None])
            for at in (x[0], y[:, 0])
            for order in (0, 1)
        )

    def surface(self, depth_mm: Floats) -> tuple[Floats, Floats, Floats]:
        """Return depth (mm) and slopes in x and y on the pixels, (H, W) each, of a depth map (n, n) on the grid."""
        rows, d_rows = self._down @ depth_mm, self._d_down @ depth_mm
        at_rest = rows @ self._across.T, rows @ self._d_across.T, d_rows @ self._across.T
        return self._view.seen(*at_rest) if self._view else at_rest


class Pictures(Splines):
    """Pictures under the ring, as one camera shows them."""

    def __init__(
        self,
        geometry: SensorGeometry,
        grid_mm: NDArray[np.float64],
        response: CameraResponse,
        *,
        cast_shadows: bool = True,
    ) -> None:
        """Prepare as `Splines`; the brightest pixel of the untouched gel gets `BRIGHTEST_GREY`."""
        super().__init__(geometry, grid_mm)
        self.tables = Tables(geometry)
        self._shade = Shade.of(geometry) if cast_shadows else None
        rest = np.moveaxis(self.irradiance(np.zeros((len(grid_mm),) * 2, np.float32)), 0, 2)
        self._response = replace(response, exposure=exposure_for(rest, response, BRIGHTEST_GREY))

    def grey(self, depth_mm: Floats) -> Floats:
        """Return the picture before noise, (H, W, 3) grey levels, of a depth map (n, n) on the grid."""
        light = np.moveaxis(self.irradiance(depth_mm), 0, 2)
        return linear_grey(light, self._response).astype(np.float32)

    def irradiance(self, depth_mm: Floats) -> Floats:
        """Return the light in each channel, (3, H, W), of a depth map (n, n) on the grid."""
        depth, across, down = self.surface(depth_mm)
        light = self.tables.irradiance(depth, across, down)
        if self._shade is not None and np.hypot(across, down).max() > self.tables.least_turned:
            self._shade.take_off(light, depth, across, down)
        return np.maximum(light, 0)


class UnitPictures(Splines):
    """Pictures of a real unit, by the light that its calibration measured."""

    def __init__(self, geometry: SensorGeometry, grid_mm: NDArray[np.float64], light: MeasuredLight) -> None:
        """Prepare as `Splines`."""
        super().__init__(geometry, grid_mm)
        self._light = light

    def grey(self, depth_mm: Floats) -> Floats:
        """Return the picture before noise, (H, W, 3) grey levels, of a depth map (n, n) on the grid."""
        return self._light.grey(*self.surface(depth_mm)[1:])
