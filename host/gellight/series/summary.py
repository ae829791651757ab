"""What a series of exposures says as a whole: its picture, and whether the scene rested meanwhile."""

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame, ExposureReport, ExposureSeries
from gellight.frames.pixel_grid import spread_blocks
from gellight.photometric import static_scene
from gellight.photometric.solver import LEAST_LIGHTS


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


_RGB_OF = 3  # the colours that a picture has


def as_rgb(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """(K, H, W) to (H, W, 3): means of three groups of neighbouring lights."""
    return np.stack([group.mean(axis=0) for group in np.array_split(levels, _RGB_OF)], axis=2)
