"""The frame path of a bundle whose lights are shown in turn: GelNet over their channels, or least squares."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureReport, ExposureSeries, TactileFrame
from gellight.frames.status import PathStatus
from gellight.photometric.directions import FILE_NAME, LightDirections, levels_of, lights_of
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.perspective import Perspective, depth_seen, surface_seen
from gellight.reconstruction.smoothing import NARROWEST_PX, Smoother
from gellight.reconstruction.stages import Stages, tactile_frame
from gellight.series.channel_network import ChannelNetwork
from gellight.series.recorded import as_rgb
from gellight.series.summary import as_picture, exposure_report

Floats = NDArray[np.float32]


def has_single_lights(bundle: Bundle) -> bool:
    """Whether a bundle is of lights shown one after the other."""
    return FILE_NAME in bundle.files


def read_directions(bundle: Bundle) -> LightDirections:
    """Return the lights of such a bundle; BundleError where they are damaged or of another picture size."""
    try:
        lights = LightDirections.of_content(bundle.files[FILE_NAME], f"{bundle.source}/{FILE_NAME}")
    except InputError as error:
        raise BundleError(str(error)) from error
    if lights.image_shape != bundle.image_shape:
        raise BundleError(f"{bundle.source}: {FILE_NAME} is for pictures of another size: calibrate again")
    return lights


def slopes_by(bundle: Bundle, lights: LightDirections, mode: str, *, threads: int = 1) -> Callable[[Floats], Floats]:
    """Return what turns (K, H, W) grey levels into (H, W, 2) slopes: GelNet in mode "network", else least squares."""
    if mode == "network":
        return ChannelNetwork(bundle.network, lights.untouched, source=bundle.source, threads=threads).gradient_map
    return lambda levels: lights.gradient_map(levels)[0]


class SingleLightPath:
    """Reconstructs series of exposures under the light groups of a bundle. One path serves one thread."""

    def __init__(self, bundle: Bundle, mode: str, *, threads: int = 1, smoothing_px: int = NARROWEST_PX) -> None:
        """Prepare for mode "network" or "photometric".

        Raises BundleError where the bundle does not tell the light groups, or its network is of another form.
        """
        self.bundle, self.mode = bundle, mode
        self._lights = read_directions(bundle)
        if not len(self._lights.groups):
            raise BundleError(
                f"{bundle.source} is for recorded pictures of its lights, and does not tell how a ring shows them: use "
                "`gellight reconstruct`, or calibrate with `gellight calibrate channels --sensor`"
            )
        self._slopes = slopes_by(bundle, self._lights, mode, threads=threads)
        self._smoother = Smoother(smoothing_px)
        self._perspective = Perspective.of_bundle(bundle)
        self._measures = BundleMeasures(bundle, from_network=mode == "network")
        self._last: ExposureReport | None = None

    def status(self) -> PathStatus:
        """Return the mode, "single_light" for GelNet, and what the last series said about its scene, ready for JSON."""
        lights = len(lights_of(self._lights.groups))
        mode = "single_light" if self.mode == "network" else self.mode
        return {"mode": mode, "lights": lights, "exposures": self._last.as_json() if self._last else None}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Reconstruct one series; its picture shows the lights, in three groups, as red, green and blue.

        Raises InputError for what is no series, of other light groups or of another size.
        """
        lights, series, stages = self._lights, camera_frame, Stages()
        if not isinstance(series, ExposureSeries) or not np.array_equal(series.groups, lights.groups):
            raise InputError(f"{camera_frame.source or 'the image'} is no series of the lights of {self.bundle.source}")
        levels = levels_of(series.pictures, series.groups)
        if levels.shape != lights.untouched.shape:
            raise InputError(f"{camera_frame.source} is of another size than the calibration {self.bundle.source}")
        picture = np.clip(np.rint(as_rgb(levels)), 0, 255).astype(np.uint8)
        frame = as_picture(series, picture, light=None)
        difference = np.subtract(picture, self.bundle.reference, dtype=np.float32)
        stages.end("signals")
        gradient_map, noise = self._smoother.prefilter(np.ascontiguousarray(self._slopes(levels), np.float32))
        stages.end("slopes")
        size = self.bundle.pixel_size_mm
        depth_mm = depth_seen(gradient_map, size, self._perspective)
        gradient_map = surface_seen(self._smoother, depth_mm, size, gradient_map, noise, self._perspective)
        stages.end("depth")
        lit = (levels > 0).sum(axis=0, dtype=np.uint8)
        self._last = report = exposure_report(series, lit, noise_grey=self.bundle.manifest.noise_grey)
        stages.end("still")
        maps = difference, gradient_map, depth_mm
        return tactile_frame(frame, *maps, size, stages, report, measures=self._measures, perspective=self._perspective)
