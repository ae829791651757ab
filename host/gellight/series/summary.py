"""What a series of exposures says as a whole: its picture, and whether the scene rested meanwhile."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame, ExposureReport, ExposureSeries, TactileFrame
from gellight.frames.image_files import read_grey
from gellight.frames.measures import FrameMeasures
from gellight.frames.pixel_grid import spread_blocks
from gellight.photometric import static_scene
from gellight.photometric.directions import LightDirections
from gellight.photometric.solver import LEAST_LIGHTS
from gellight.reconstruction.perspective import Perspective, depth_seen
from gellight.reconstruction.stages import Stages, tactile_frame


def as_picture(series: ExposureSeries, image: NDArray[np.uint8], light: NDArray[np.uint8] | None) -> CameraFrame:
    """Return a series as one camera frame that shows `image`, taken under `light`."""
    same = {each.name: getattr(series, each.name) for each in fields(CameraFrame)}
    return CameraFrame(**{**same, "image": image, "light": light, "encoded": None})


def exposure_report(
    series: ExposureSeries, lights: NDArray[np.uint8], *, noise_grey: float, misfit: float = 0.0
) -> ExposureReport:
    """Return whether the scene rested, by the light that was shown twice and by `static_scene.misfit`.

    lights: (H, W) how many each pixel was solved with. noise_grey: of one pixel of one picture.
    """
    change = static_scene.change_of_repetition(series.opening.image, series.closing.image)
    limit = static_scene.repetition_limit(noise_grey)
    return ExposureReport(
        exposures=len(series.groups),
        duration_s=series.closing.time_s - series.opening.time_s,
        moved=bool((change > limit).any()) or misfit > 1,
        repetition_grey=float(change.max()),
        repetition_limit_grey=limit,
        misfit=misfit,
        lights=lights,
        moving=spread_blocks(change > limit, static_scene.BLOCK_PX, (lights.shape[0], lights.shape[1])),
        least_lights=LEAST_LIGHTS,
    )


_RGB_OF = 3


def frame_of_lights(
    lights: LightDirections,
    paths: Sequence[Path],
    white: float | None = None,
    *,
    slopes: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    measures: FrameMeasures,
) -> TactileFrame:
    """Reconstruct gradient, normal and depth map and the contact from one picture under each light, in their order.

    white: see `read_grey`. slopes: of (K, H, W) grey levels, see `slopes_by`. measures: of the bundle. The picture of
    the frame shows the lights, in three groups, as red, green and blue. Raises InputError for another number or size of
    pictures.
    """
    if len(paths) != len(lights.untouched):
        raise InputError(f"{len(paths)} images and {len(lights.untouched)} lights: give one image for each light")
    pictures = [read_grey(path, white) for path in paths]
    if len({picture.shape for picture in pictures}) > 1:
        raise InputError(f"the images beside {paths[0]} have several sizes: give those of one camera setting")
    stages = Stages()
    levels = np.stack(pictures)
    if levels.shape != lights.untouched.shape:
        height, width = lights.image_shape
        raise InputError(f"the images beside {paths[0]} are no pictures of {width} x {height} px, as the lights are of")
    gradient_map = slopes(levels)
    stages.end("slopes")
    size = (lights.pixel_size_mm, lights.pixel_size_mm)
    seen = Perspective.over(lights.image_shape, size, lights.camera_height_mm)
    depth_mm = depth_seen(np.asarray(gradient_map, np.float32), size, seen)
    stages.end("depth")
    image, untouched = as_rgb(levels), as_rgb(lights.untouched)
    shown = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    frame = CameraFrame(image=shown, time_s=0.0, sequence=0, source=str(paths[0]))
    maps = image - untouched, gradient_map, depth_mm
    return tactile_frame(frame, *maps, size, stages, measures=measures, perspective=seen)


def as_rgb(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """(K, H, W) to (H, W, 3): means of three groups of neighbouring lights."""
    return np.stack([group.mean(axis=0) for group in np.array_split(levels, _RGB_OF)], axis=2)
