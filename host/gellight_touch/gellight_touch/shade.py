"""The light that cast shadows take from a picture, by the sweep of the frame path in C."""

from typing import Self

import cv2
import numpy as np

from gellight.base.errors import InputError
from gellight.reconstruction.cast_shadows import EDGE_MM
from gellight.reconstruction.led_light import LedLight
from gellight.reconstruction.native.library import Library, NativePathError, fitting_library
from gellight.reconstruction.native.native_shadows import rays_of, work_of
from gellight_touch.layer import Floats
from sim_reference.geometry import SensorGeometry, led_axes, led_positions
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.surface import untouched
from sim_reference.view import seen_height_mm

CELLS = 120, 160
"""rows and columns on which shadows are found"""


class Shade:
    """The cast shadows of one sensor's LEDs; it keeps working memory, so it serves one thread."""

    def __init__(self, geometry: SensorGeometry, library: Library) -> None:
        """Compute the light of each LED on the gel at rest."""
        (h, w), (rows, columns) = CELLS, geometry.image_shape
        self._c = library
        self._cell_mm = columns * geometry.pixel_size_mm / w, rows * geometry.pixel_size_mm / h
        self._x_mm, self._y_mm = (
            ((np.arange(n) - (n - 1) / 2) * size).astype(np.float32)
            for n, size in zip((w, h), self._cell_mm, strict=True)
        )
        leds = np.hstack([led_positions(geometry), led_axes(geometry)]).astype(np.float32)
        self._rest, shares = _at_rest(geometry)
        exponent, black = geometry.emission_exponent, np.zeros(3, np.float32)
        window_mm, height_mm = geometry.window_mm if geometry.window else 0.0, seen_height_mm(geometry)
        led_light = LedLight(leds, exponent, shares, black, gamma=1.0, window_mm=window_mm)
        light, self._nearness = led_light.on_cells(self._x_mm, self._y_mm, height_mm), 1 / height_mm
        self._leds = light.feet, light.light, rays_of(light), len(light.feet)
        self._lost, self._work = np.zeros((3, h, w), np.float32), np.zeros(work_of(h, w), np.float32)
        self._flags, self._near = np.zeros(w + h, np.uint8), np.ones((h, w), np.uint8)

    @classmethod
    def of(cls, geometry: SensorGeometry) -> Self:
        """Return that of a sensor; InputError where the library does not run on this computer."""
        try:
            return cls(geometry, fitting_library()[1])
        except NativePathError as error:
            raise InputError(f"cast shadows cannot be drawn here, give cast_shadows=False: {error}") from error

    def take_off(self, light: Floats, depth_mm: Floats, across: Floats, down: Floats) -> None:
        """Take what the shadows of a surface take off its light (3, H, W); depth and slopes are (H, W)."""
        h, w = CELLS
        depth, *slopes = (cv2.resize(plane, (w, h), interpolation=cv2.INTER_AREA) for plane in (depth_mm, across, down))
        given = (depth, np.stack(slopes), self._x_mm, self._y_mm, *self._leds)
        hide, by_depth = True, False
        kept = (self._nearness, *self._cell_mm, EDGE_MM, self._lost, self._work, self._flags)
        if self._c.call("lost_light", *given, *kept, self._near, hide, by_depth, w, h):
            for channel, lost in enumerate(self._lost):
                light[channel] -= cv2.resize(lost * self._rest[channel], light.shape[:0:-1])


def _at_rest(geometry: SensorGeometry) -> tuple[Floats, Floats]:
    """Return the light of each channel on cells of the gel at rest, (3, h, w), and each LED's share, (K, 3, h, w)."""
    h, w = CELLS
    flat, light = untouched(geometry), ring_light(geometry)
    alone = []
    for led in range(len(light)):
        only = np.zeros_like(light)
        only[led] = light[led]
        planes = np.moveaxis(ring_irradiance(flat, geometry, only), 2, 0)
        alone.append([cv2.resize(plane, (w, h), interpolation=cv2.INTER_AREA) for plane in planes])
    each = np.array(alone)
    rest = each.sum(axis=0)
    return rest.astype(np.float32), (each / np.maximum(rest, 1e-12)).astype(np.float32)
