"""The frame path: camera frame in, tactile frame out."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Protocol

import numpy as np

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.status import PathStatus
from gellight.photometric.directions import FILE_NAME
from gellight.reconstruction.cast_shadows import CastShadows
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.lens.undistortion import Undistortion, read_undistortion
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.native.judge import refuse_disagreement
from gellight.reconstruction.native.library import NativePathError, fitting_library
from gellight.reconstruction.native.native_path import NativePath
from gellight.reconstruction.numpy_path import NumpyPath
from gellight.reconstruction.perspective import Perspective
from gellight.reconstruction.skirt import with_true_skirts
from gellight.reconstruction.smoothing import NARROWEST_PX
from gellight.reconstruction.stages import NetworkRows, TactilePath

logger = logging.getLogger(__name__)


class FramePath(Protocol):
    """What turns the frames of one sensor into tactile frames."""

    bundle: Bundle

    def reconstruct(self, camera_frame: CameraFrame, /) -> TactileFrame:
        """Return the maps and the contact of one frame."""

    def status(self) -> PathStatus:
        """Return `mode`, and what else is known of the way it is computed, ready for JSON."""


class Reconstructor:
    """Everything that stays the same between the frames of one sensor.

    Nothing that was returned changes later: each result owns its arrays, but for the maps of untouched gel, which are
    read-only and shared. One reconstructor serves one thread.
    """

    def __init__(
        self,
        bundle: Bundle,
        *,
        smoothing_px: int = NARROWEST_PX,
        masked: bool = True,
        undistorted: bool = True,
        cast_shadows: bool = True,
        native: bool = True,
    ) -> None:
        """Prepare for the frames of the calibrated sensor; takes one dense run of the network.

        smoothing_px: half width of the narrowest filter that smooths the gradient map. masked: run the network only
        where the image differs from the reference; without, everywhere.
        undistorted: take the lens out of the maps where the bundle has one; without, they lie over the picture, as
        labels do. cast_shadows: give pixels the light back that the surface keeps from them, where the bundle knows
        its LEDs. native: compute in C, the network at the means of cells (`native.cells`); without, and where no
        library fits this machine, in NumPy at every touched pixel. On a ball both agree within 0.1 degrees and a
        micrometre in every pixel. Raises BundleError.
        """
        _refuse_series(bundle)
        self.bundle = bundle
        self._measures = BundleMeasures(bundle)
        self._perspective = Perspective.of_bundle(bundle)
        self.network = GradientNetwork.of_bundle(bundle)
        lens = read_undistortion(bundle) if undistorted else None
        shadows = CastShadows.of_bundle(bundle, self.network, wanted=cast_shadows)
        self.cast_shadows = shadows is not None and shadows.hide
        numpy_path = NumpyPath(bundle, self.network, lens, shadows, smoothing_px=smoothing_px, masked=masked)
        self._path: TactilePath = numpy_path
        self._computed_by = "NumPy"
        if native and masked:
            self._go_native(numpy_path, lens, shadows, smoothing_px)

    def _go_native(
        self, judge: NumpyPath, lens: Undistortion | None, shadows: CastShadows | None, smoothing_px: int
    ) -> None:
        """Compute natively where a library fits this machine and answers as NumPy does; else say so in the log."""
        try:
            name, library = fitting_library()
            path = NativePath(library, self.bundle, self.network, lens, shadows, smoothing_px=smoothing_px)
            refuse_disagreement(path, judge, self.bundle)
        except NativePathError as reason:
            logger.warning("frames are computed by NumPy, which takes longer: %s", reason)
            return
        self._path, self._computed_by = path, f"C, {name}"

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Reconstruct gradient, normal and depth map and the contact from one frame.

        Depth is 0 where the gel is at rest: see `at_rest.far_from_touch`, and `reconstruction.integrate` for a view
        that is touched all over. Raises InputError for an image of another size or type than the calibration's.
        """
        check_image(camera_frame, self.bundle)
        frame, manifest = self._path.reconstruct(camera_frame), self.bundle.manifest
        if manifest.skirt_share != 1:
            how = manifest.skirt_share, manifest.pixel_size_mm, self._perspective
            frame = with_true_skirts(frame, *how, bulge=manifest.bulge)
        return replace(frame, measures=self._measures)

    def status(self) -> PathStatus:
        """Return the mode and what computes, ready for JSON."""
        return {"mode": "network", "computed_by": self._computed_by}

    @property
    def network_rows(self) -> NetworkRows:
        """How often the network was asked for the latest frame."""
        return self._path.network_rows


def _refuse_series(bundle: Bundle) -> None:
    if FILE_NAME in bundle.files:
        raise BundleError(
            f"{bundle.source} is of lights shown one after the other ({FILE_NAME}), a single picture says nothing: "
            "give `gellight run` or `reconstruct` a series of them, or the bundle of a calibration by colours"
        )


def check_image(camera_frame: CameraFrame, bundle: Bundle) -> None:
    """Raise InputError unless an image is of the size and type of a calibration."""
    image, name = camera_frame.image, camera_frame.source or "the image"
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise InputError(f"{name} is {image.shape} {image.dtype}: give (H, W, 3) uint8, RGB")
    if image.shape[:2] != bundle.image_shape:
        height, width = bundle.image_shape
        raise InputError(
            f"{name} is {image.shape[1]} x {image.shape[0]} px, the calibration {bundle.source} is for "
            f"{width} x {height} px: set the camera to that size or use the calibration of this sensor"
        )
