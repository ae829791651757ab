"""The placeholder for the bundle of a sensor that was never calibrated: it can be shown and calibrated, not felt."""

import numpy as np

from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.bundle.manifest import METRICS


def placeholder(image_shape: tuple[int, int]) -> Bundle:
    """Return a bundle for pictures (H, W) that has no network, in memory only; its reference image is black.

    The light is that of the simulated sensor's bundle, for a sensor with our ring. Nothing in it was measured: a pixel
    counts as 1 mm.
    """
    manifest = load_bundle(SYNTHETIC).manifest.model_copy(
        update={
            "sensor": "not calibrated",
            "image_width_px": image_shape[1],
            "image_height_px": image_shape[0],
            "pixel_size_mm": (1.0, 1.0),
            "gel_thickness_mm": 0.0,
        }
    )
    empty = Bundle(manifest=manifest, files={METRICS: b"{}", manifest.network: b""}, source="no calibration")
    return empty.with_reference(np.zeros((*image_shape, 3)), frames=1)
