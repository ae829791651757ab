"""The frame path of a bundle whose lights are shown in turn: GelNet over their channels, or least squares."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureSeries, TactileFrame
from gellight.frames.image_files import read_grey
from gellight.frames.status import PathStatus
from gellight.photometric.directions import FILE_NAME, LightDirections, levels_of, lights_of
from gellight.reconstruction.gelnet import BLOCK_ROWS
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.network_session import NetworkSession
from gellight.reconstruction.perspective import Perspective, depth_seen, surface_seen
from gellight.reconstruction.smoothing import NARROWEST_PX, Smoother
from gellight.reconstruction.stages import Stages, tactile_frame
from gellight.series.summary import as_picture, as_rgb, exposure_report

Floats = NDArray[np.float32]


def change_percent(levels: Floats, untouched: Floats) -> Floats:
    """(K, H, W) grey levels -> (H * W, K) by how much each differs from the untouched gel, per cent of that."""
    change = 100 * (levels / untouched - 1)
    return np.ascontiguousarray(change.reshape(len(levels), -1).T, np.float32)


class ChannelNetwork:
    """The network of a bundle with K channels, for pictures of one size."""

    def __init__(self, network: bytes, untouched: Floats, *, source: str) -> None:
        """Load an ONNX file for lights under which the untouched gel shows (K, H, W) grey levels.

        source: the name of the bundle, for messages. Raises BundleError for a network of another form.
        """
        self._untouched = untouched
        self._session = NetworkSession(network, source=source, channels=len(untouched))
        rows, columns = np.indices(untouched.shape[1:], dtype=np.float32)
        self._places = np.stack([columns.ravel(), rows.ravel()], axis=1)
        self._zero = self._answers(np.zeros((len(self._places), len(untouched)), np.float32))

    def gradient_map(self, levels: Floats) -> Floats:
        """(K, H, W) grey levels, one picture a light -> (H, W, 2) slopes."""
        slopes = self._answers(change_percent(levels, self._untouched)) - self._zero
        return slopes.reshape(*levels.shape[1:], 2)

    def _answers(self, change: Floats) -> Floats:
        parts = [slice(start, start + BLOCK_ROWS) for start in range(0, len(change), BLOCK_ROWS)]
        rows = (np.concatenate([change[part], self._places[part]], axis=1) for part in parts)
        return np.concatenate([self._session.slopes(block) for block in rows])


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


def slopes_by(bundle: Bundle, lights: LightDirections, mode: str) -> Callable[[Floats], Floats]:
    """Return what turns (K, H, W) grey levels into (H, W, 2) slopes: GelNet in mode "network", else least squares."""
    if mode == "network":
        return ChannelNetwork(bundle.network, lights.untouched, source=bundle.source).gradient_map
    return lambda levels: lights.gradient_map(levels)[0]


class SingleLightPath:
    """Reconstructs series of exposures under the light groups of a bundle. One path serves one thread."""

    def __init__(self, bundle: Bundle, mode: str, *, smoothing_px: int = NARROWEST_PX) -> None:
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
        self._slopes = slopes_by(bundle, self._lights, mode)
        self._smoother = Smoother(smoothing_px)
        self._perspective = Perspective.of_bundle(bundle)
        self._measures = BundleMeasures(bundle, from_network=mode == "network")

    def status(self) -> PathStatus:
        """Return the mode, "single_light" for GelNet, and how many lights there are, ready for JSON."""
        mode = "single_light" if self.mode == "network" else self.mode
        return {"mode": mode, "lights": len(lights_of(self._lights.groups))}

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
        picture = _picture(levels)
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
        report = exposure_report(series, lit, noise_grey=self.bundle.manifest.noise_grey)
        stages.end("still")
        maps = difference, gradient_map, depth_mm
        return tactile_frame(frame, *maps, size, stages, report, measures=self._measures, perspective=self._perspective)


def frame_of_lights(bundle: Bundle, mode: str, paths: Sequence[Path], white: float | None = None) -> TactileFrame:
    """Reconstruct gradient, normal and depth map and the contact from one picture under each light, in their order.

    mode: "network" or "photometric". white: see `read_grey`. The picture of the frame shows the lights, in three
    groups, as red, green and blue. Raises InputError for another number or size of pictures.
    """
    lights = read_directions(bundle)
    if len(paths) != len(lights.untouched):
        raise InputError(f"{len(paths)} images and {len(lights.untouched)} lights: give one image for each light")
    pictures = [read_grey(path, white) for path in paths]
    if len({picture.shape for picture in pictures}) > 1:
        raise InputError(f"the images beside {paths[0]} have several sizes: give those of one camera setting")
    slopes, stages, levels = slopes_by(bundle, lights, mode), Stages(), np.stack(pictures)
    if levels.shape != lights.untouched.shape:
        height, width = lights.image_shape
        raise InputError(f"the images beside {paths[0]} are no pictures of {width} x {height} px, as the lights are of")
    gradient_map = slopes(levels)
    stages.end("slopes")
    size = (lights.pixel_size_mm, lights.pixel_size_mm)
    seen = Perspective.over(lights.image_shape, size, lights.camera_height_mm)
    depth_mm = depth_seen(np.asarray(gradient_map, np.float32), size, seen)
    stages.end("depth")
    frame = CameraFrame(image=_picture(levels), time_s=0.0, sequence=0, source=str(paths[0]))
    maps = as_rgb(levels) - as_rgb(lights.untouched), gradient_map, depth_mm
    measures = BundleMeasures(bundle, from_network=mode == "network")
    return tactile_frame(frame, *maps, size, stages, measures=measures, perspective=seen)


def _picture(levels: Floats) -> NDArray[np.uint8]:
    return np.clip(np.rint(as_rgb(levels)), 0, 255).astype(np.uint8)
