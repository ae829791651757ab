"""A starter bundle: learnt on presses of other units of the same kind of sensor, for one that nobody calibrated.

It shows contact and shape at once, and says that it is not of this unit: light differs from unit to unit, so depth and
normals are off by much more than after a calibration.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import OTHER_UNITS, Bundle, write_bundle
from gellight.lab.training.child import Progress, silent
from gellight.lab.training.table import COLOURS, PressTable
from gellight.lab.training.training import Reference, TrainingOptions, train


def pooled(bundles: Sequence[Bundle], image_shape: tuple[int, int]) -> PressTable:
    """Join the tables that bundles learnt from; places are scaled to pictures of `image_shape` (H, W).

    Raises BundleError for a bundle without presses, InputError for one whose channels are not red, green and blue.
    """
    rows, images, seen = [], [], 0
    for bundle in bundles:
        table = PressTable.of(bundle)
        if table.rows.shape[1] != COLOURS + 4:
            raise InputError(f"{bundle.source} has a channel for each of {table.rows.shape[1] - 4} lights: give others")
        scaled, last = table.rows.copy(), np.subtract(image_shape[::-1], 1)
        scaled[:, COLOURS : COLOURS + 2] *= np.divide(last, np.subtract(table.image_size, 1)).astype(np.float32)
        scaled[:, COLOURS : COLOURS + 2] = np.minimum(scaled[:, COLOURS : COLOURS + 2], last)
        rows.append(scaled)
        images.append(table.image + seen)
        seen += int(table.image.max()) + 1
    return PressTable(
        rows=np.concatenate(rows),
        image=np.concatenate(images).astype(np.int32),
        image_size=(image_shape[1], image_shape[0]),
    )


def make_starter(
    bundles: Sequence[Bundle],
    reference: Reference,
    pixel_size_mm: float,
    out: Path,
    *,
    options: TrainingOptions,
    overwrite: bool = False,
    progress: Progress = silent,
) -> Bundle:
    """Train on the presses of `bundles` and write the starter bundle `out` for the unit that `reference` shows.

    Raises as `pooled`, TrainingError, and BundleError where `out` cannot be written; then it is as it was.
    """
    table = pooled(bundles, reference.image_shape)
    network, record = train(table, options, untouched=reference.image, progress=progress)
    names = [bundle.manifest.sensor for bundle in bundles]
    return write_bundle(
        out, sensor="not calibrated: learnt on other units", overwrite=overwrite,
        reference=reference.image, reference_frames=reference.frames, noise_grey=reference.noise_grey,
        rest_grey=max(bundle.manifest.rest_grey for bundle in bundles), follow_light=True, network=network,
        pixel_size_mm=(pixel_size_mm, pixel_size_mm), camera_height_mm=_height_mm(bundles), presses=table.arrays(),
        metrics={OTHER_UNITS: names, "training": record},
    )  # fmt: skip


def _height_mm(bundles: Sequence[Bundle]) -> float:
    """Return the mean of what is told of the camera's height; 0 where one of them does not tell."""
    heights = [bundle.manifest.camera_height_mm for bundle in bundles]
    return float(np.mean(heights)) if all(heights) else 0.0
