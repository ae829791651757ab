"""The frame path in NumPy, SciPy and OpenCV: the form to read, and the one that the native path is checked against."""

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.pixel_grid import spread_blocks
from gellight.reconstruction.cast_shadows import CastShadows
from gellight.reconstruction.gelnet import CELL_PX, GradientNetwork
from gellight.reconstruction.integration import far_from_touch, integrate, rest_level
from gellight.reconstruction.lens.undistortion import Undistortion
from gellight.reconstruction.light_drift import difference_of
from gellight.reconstruction.perspective import Perspective
from gellight.reconstruction.rest_plane import RestPlane, tilt
from gellight.reconstruction.smoothing import Smoother
from gellight.reconstruction.stages import STAGES, FlatMaps, NetworkRows, Stages, tactile_frame

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]


class NumpyPath:
    """From a camera frame to a tactile frame; keeps working memory, so it serves one thread."""

    def __init__(
        self,
        bundle: Bundle,
        network: GradientNetwork,
        undistortion: Undistortion | None,
        shadows: CastShadows | None,
        *,
        smoothing_px: int,
        masked: bool,
    ) -> None:
        """Take the parts; see `pipeline.Reconstructor`."""
        self._bundle, self._network = bundle, network
        self._undistortion, self._shadows = undistortion, shadows
        self._smoother = Smoother(smoothing_px)
        self._masked = masked
        self._perspective = Perspective.of_bundle(bundle)
        self._plane = RestPlane() if bundle.manifest.level_plane else None
        self.network_rows = NetworkRows()
        self._flat = FlatMaps(bundle.image_shape, stages=STAGES if undistortion is None else (*STAGES, "lens"))

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Return the maps and the contact of a frame of the bundle's size."""
        stages = Stages()
        follow = self._bundle.manifest.follow_light
        difference = difference_of(camera_frame.image, self._bundle.reference, follow_light=follow)
        stages.end("difference")
        cells = self._network.touched_cells(difference)
        stages.end("mask")
        if self._masked and not cells.any():
            return self._flat.frame(camera_frame, difference, stages)
        touched = spread_blocks(cells, CELL_PX, self._bundle.image_shape)
        answered = self._network.gradient_map(difference, touched if self._masked else None)
        if self._shadows and (change := self._shadows.change(difference, answered, cells)) is not None:
            answered += change
        # The slopes are smoothed and not the image: blurring colours across a rim before a non-linear map costs depth.
        slopes, noise = self._smoother.prefilter(answered)
        stages.end("gradient")
        if self._undistortion is not None:
            slopes, touched = self._undistortion.apply(slopes, touched)
            stages.end("lens")
        if self._perspective:
            slopes = self._perspective.seen(slopes)
        depth_mm = self._depth(slopes, touched, camera_frame.time_s)
        stages.end("depth")
        where = touched if self._masked else None
        gradient_map = self._smoother.of_surface(depth_mm, self._bundle.pixel_size_mm, slopes, noise, where=where)
        if self._perspective:
            depth_mm, gradient_map = self._perspective.depth_mm(depth_mm), self._perspective.slopes(gradient_map)
        if self._undistortion is not None:
            depth_mm[~self._undistortion.seen], gradient_map[~self._undistortion.seen] = 0, 0
        pixels, seen = self._bundle.pixel_size_mm, self._perspective
        maps = difference, gradient_map, depth_mm
        return tactile_frame(camera_frame, *maps, pixels, stages, touched=where, perspective=seen)

    def _depth(self, slopes: Floats, touched: Bools, time_s: float) -> Floats:
        """Integrate the measured slopes; where the sensor tilts, take the plane at rest off both."""
        manifest, at_rest = self._bundle.manifest, far_from_touch(touched)
        depth_mm = integrate(slopes, manifest.pixel_size_mm, at_rest=at_rest, bulge=manifest.bulge)
        if self._plane:
            plane = self._plane.following(depth_mm, touched, time_s)
            slopes -= np.asarray(plane / manifest.pixel_size_mm, np.float32)
            depth_mm = depth_mm - tilt(plane, depth_mm.shape)
            depth_mm -= rest_level(depth_mm, at_rest, manifest.bulge)
        return depth_mm.astype(np.float32, copy=False)
