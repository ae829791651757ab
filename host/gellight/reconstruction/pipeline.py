"""The frame path: camera frame in, tactile frame out."""

import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureReport, TactileFrame
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.integration import integrate, normals
from gellight.reconstruction.lens.lens_file import has_lens, read_undistortion
from gellight.reconstruction.light_drift import difference_of
from gellight.reconstruction.smoothing import NARROWEST_PX, Smoother

STAGES = ("difference", "mask", "gradient", "depth", "normals", "contact")
"""Keys of `TactileFrame.stage_seconds`, in the order of the path; `lens` follows `gradient` where there is one."""

_CELL_PX = 8
Floats = NDArray[np.float32]


class FramePath(Protocol):
    """What turns the frames of one sensor into tactile frames."""

    bundle: Bundle

    def reconstruct(self, camera_frame: CameraFrame, /) -> TactileFrame:
        """Return the maps and the contact of one frame."""

    def status(self) -> dict[str, object]:
        """Return `mode`, and what else is known of the way it is computed, ready for JSON."""


class Reconstructor:
    """Everything that stays the same between the frames of one sensor.

    Each result owns its arrays; nothing that was returned changes later. One reconstructor serves one thread.
    """

    def __init__(
        self,
        bundle: Bundle,
        *,
        threads: int = 1,
        smoothing_px: int = NARROWEST_PX,
        masked: bool = True,
        undistorted: bool = True,
    ) -> None:
        """Prepare for the frames of the calibrated sensor; takes one dense run of the network.

        threads: of the network. smoothing_px: half width of the narrowest window that smooths the gradient map. masked:
        run the network only where the image differs from the reference; without, everywhere. undistorted: take the lens
        out of the maps where the bundle has one; without, they lie over the picture, as labels do. Raises BundleError.
        """
        self.bundle = bundle
        self.masked = masked
        self._smoother = Smoother(smoothing_px)
        self._undistortion = read_undistortion(bundle) if undistorted and has_lens(bundle) else None
        self._network = GradientNetwork(
            bundle.network,
            bundle.image_shape,
            noise_grey=bundle.manifest.noise_grey,
            threads=threads,
            source=bundle.source,
        )

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Reconstruct gradient, normal and depth map and the contact from one frame.

        Depth is 0 where the gel is at rest: see `far_from_touch`, and `reconstruction.integrate` for a view that is
        touched all over. Raises InputError for an image of another size or type than the calibration's.
        """
        self._check(camera_frame)
        stages = Stages()
        follow = self.bundle.manifest.follow_light
        difference = difference_of(camera_frame.image, self.bundle.reference, follow_light=follow)
        stages.end("difference")
        touched = self._network.touched(difference)
        stages.end("mask")
        slopes = self._network.gradient_map(difference, touched if self.masked else None)
        # The slopes are smoothed and not the image: blurring colours across a rim before a non-linear map costs depth.
        slopes, noise = self._smoother.narrow(slopes)
        stages.end("gradient")
        if self._undistortion is not None:
            slopes, touched = self._undistortion.apply(slopes, touched)
            stages.end("lens")
        depth_mm = self._depth(slopes, touched)
        stages.end("depth")
        where = touched if self.masked else None
        gradient_map = self._smoother.of_surface(depth_mm, self.bundle.pixel_size_mm, slopes, noise, where=where)
        if self._undistortion is not None:
            depth_mm[~self._undistortion.seen], gradient_map[~self._undistortion.seen] = 0, 0
        return tactile_frame(camera_frame, difference, gradient_map, depth_mm, self.bundle.pixel_size_mm, stages)

    def _depth(self, slopes: Floats, touched: NDArray[np.bool_]) -> Floats:
        manifest = self.bundle.manifest
        depth_mm = integrate(slopes, manifest.pixel_size_mm, at_rest=far_from_touch(touched), bulge=manifest.bulge)
        return depth_mm.astype(np.float32, copy=False)

    def status(self) -> dict[str, object]:
        """Return the mode, ready for JSON."""
        return {"mode": "network"}

    def touched(self, difference: Floats) -> NDArray[np.bool_]:
        """Mark the (H, W) pixels that go through the network; see `gelnet.GradientNetwork`."""
        return self._network.touched(difference)

    def _check(self, camera_frame: CameraFrame) -> None:
        image, name = camera_frame.image, camera_frame.source or "the image"
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise InputError(f"{name} is {image.shape} {image.dtype}: give (H, W, 3) uint8, RGB")
        if image.shape[:2] != self.bundle.image_shape:
            height, width = self.bundle.image_shape
            raise InputError(
                f"{name} is {image.shape[1]} x {image.shape[0]} px, the calibration {self.bundle.source} is for "
                f"{width} x {height} px: set the camera to that size or use the calibration of this sensor"
            )


def far_from_touch(touched: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the quarter of the untouched (H, W) pixels that is farthest from any touched one.

    Gel that is pressed down in one place bulges out around it, with slopes too gentle to show in the image, and comes
    to rest some thicknesses of the gel farther out. The median over all untouched pixels would put 5 micrometres of
    bulge under a ball that is pressed 1 mm deep. Distances are chess-board distances between cells of 8 x 8 pixels.
    """
    free = ~touched
    cells = free[4::_CELL_PX, 4::_CELL_PX]
    if cells.all() or not cells.any():
        return free
    distance = ndimage.distance_transform_cdt(cells, metric="chessboard")
    far = distance >= max(1, np.quantile(distance[cells], 0.75))
    height, width = free.shape
    rows = np.minimum(np.arange(height) // _CELL_PX, far.shape[0] - 1)
    columns = np.minimum(np.arange(width) // _CELL_PX, far.shape[1] - 1)
    return np.asarray(free & far[rows[:, None], columns[None, :]])


class Stages:
    """The wall time of each stage of one frame."""

    def __init__(self) -> None:
        """Begin the first stage."""
        self.seconds: dict[str, float] = {}
        self._began = time.perf_counter()

    def end(self, stage: str) -> None:
        """Record the time since the stage before ended."""
        now = time.perf_counter()
        self.seconds[stage] = now - self._began
        self._began = now


def tactile_frame(
    camera_frame: CameraFrame,
    difference: Floats,
    gradient_map: Floats,
    depth_mm: Floats,
    pixel_size_mm: tuple[float, float],
    stages: Stages,
    exposures: ExposureReport | None = None,
) -> TactileFrame:
    """Do the last two stages, normals and contact, and put the frame together."""
    normal_map = normals(gradient_map)
    stages.end("normals")
    contact = find_contact(depth_mm, pixel_size_mm)
    stages.end("contact")
    return TactileFrame(
        camera_frame=camera_frame,
        difference=difference,
        gradient_map=gradient_map,
        normal_map=normal_map,
        depth_mm=depth_mm,
        contact=contact,
        exposures=exposures,
        stage_seconds=stages.seconds,
    )
