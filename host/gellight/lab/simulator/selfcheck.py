"""The host judged by the reference simulator, while it streams.

Three comparisons, each against something the host did not compute:

- depth and normals against the gel surface that the simulator pressed;
- the host's integral (cosine transform) against the reference's (sparse least squares) of the same gradient map, which
  seen from a height is that of the logarithm of the distance to the camera;
- the picture against the reference's rendering of the depth that the host measured. This one needs no truth but the
  light: it also tells when a calibration does not fit its sensor.

The pictures are compared at a quarter of the resolution, so that a check costs a fraction of a frame's time a second.
"""

from dataclasses import replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import SelfCheckResult, TactileFrame
from gellight.frames.pixel_grid import block_means
from gellight.lab.simulator.scene import Scene
from gellight.lab.simulator.selfcheck_bounds import bounds_of
from sim_reference.camera import linear_grey
from sim_reference.geometry import pixel_grid
from sim_reference.imaging import normals, ring_irradiance, ring_light
from sim_reference.integration import integrate
from sim_reference.metrics import angular_error
from sim_reference.surface import Surface
from sim_reference.view import seen_height_mm

SHRINK = 4
"""pictures and integrals are compared on blocks of 4 x 4 pixels"""


class SelfCheck:
    """Compares tactile frames of a simulated sensor with the reference simulator."""

    def __init__(self, scene: Scene, pixel_size_mm: tuple[float, float]) -> None:
        """Judge the sensor of `scene`, also after its camera is set anew; the host takes pixels as `pixel_size_mm`."""
        self._scene = scene
        self._pixel_size_mm = pixel_size_mm
        geometry = scene.geometry
        self._small = replace(
            geometry,
            image_width_px=geometry.image_width_px // SHRINK,
            image_height_px=geometry.image_height_px // SHRINK,
            pixel_size_mm=geometry.pixel_size_mm * SHRINK,
        )

    def compare(self, frame: TactileFrame) -> SelfCheckResult:
        """Compare one frame that carries its truth; raises InputError for one that does not."""
        truth = frame.camera_frame.truth
        if truth is None:
            raise InputError(f"frame {frame.camera_frame.sequence} carries no truth: only simulated sensors can check")
        where = truth.contact if truth.contact.any() else np.ones_like(truth.contact)
        depth_error = (frame.depth_mm - truth.depth_mm)[where]
        angles = np.degrees(angular_error(frame.normal_map, normals(truth.gradient_map.astype(np.float64))))
        bounds, not_judged = bounds_of(truth, self._scene.geometry)
        return SelfCheckResult(
            sequence=frame.camera_frame.sequence,
            depth_error_mm=float(np.abs(depth_error).mean()),
            shape_error_mm=float(np.abs(depth_error - np.median(depth_error)).mean()),
            normal_error_deg=float(angles.mean()),
            contact_normal_error_deg=float(angles[where].mean()),
            integral_error_mm=self._integral_error_mm(frame),
            picture_error_grey=self._picture_error_grey(frame),
            indentation_mm=frame.contact.indentation_mm,
            true_indentation_mm=float(truth.depth_mm.max()),
            bounds=bounds,
            not_judged=not_judged,
        )

    def _integral_error_mm(self, frame: TactileFrame) -> float:
        x_mm, y_mm = (size * SHRINK for size in self._pixel_size_mm)
        seen, depth = frame.gradient_map.astype(np.float64), frame.depth_mm.astype(np.float64)
        height_mm = seen_height_mm(self._scene.geometry)
        if isfinite(height_mm):  # of ln Z over the picture, Z the distance to the camera
            x, y = pixel_grid(self._scene.geometry)
            seen = seen / (1 + (x * seen[..., 0] + y * seen[..., 1]) / height_mm)[..., None]
            depth = -height_mm * np.log1p(-depth / height_mm)
        difference = _shrunken(depth) - integrate(_shrunken(seen), (x_mm, y_mm))
        return float(np.abs(difference - np.median(difference)).mean())

    def _picture_error_grey(self, frame: TactileFrame) -> float:
        light = frame.camera_frame.light
        lit = (ring_light(self._small) if light is None else light / 255.0) * self._scene.led_gain[:, None]
        depth, gradient = _shrunken(frame.depth_mm), _shrunken(frame.gradient_map)
        surface = Surface(depth, gradient, np.zeros(depth.shape, bool))
        rendered = linear_grey(ring_irradiance(surface, self._small, lit), self._scene.response)
        return float(np.abs(rendered - _shrunken(frame.camera_frame.image)).mean())


def _shrunken(image: NDArray[np.generic]) -> NDArray[np.float64]:
    """(H, W, ...) to a quarter of the size, by means."""
    return np.asarray(block_means(image.astype(np.float64), SHRINK))
