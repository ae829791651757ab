"""Tactile frames of one smooth hill, as deep as is asked for."""

import numpy as np

from gellight.frames.frames import CameraFrame, Contact, Provenance, TactileFrame

SHAPE = (48, 64)
HILL = np.exp(-(((np.indices(SHAPE) - [[[24]], [[32]]]) / 10.0) ** 2).sum(axis=0))


def frame(deep_mm: float, noise: float = 0.0, seed: int = 0) -> TactileFrame:
    """Return the frame of the hill, with noise of the depth, mm."""
    depth = deep_mm * HILL + noise * np.random.default_rng(seed).standard_normal(SHAPE)
    none = np.zeros((*SHAPE, 3), np.float32)
    return TactileFrame(
        camera_frame=CameraFrame(image=none.astype(np.uint8), time_s=0.0, sequence=seed),
        difference=none,
        gradient_map=none[..., :2],
        depth_mm=depth.astype(np.float32),
        contact=Contact(mask=depth > 0.1, area_mm2=1.0, indentation_mm=deep_mm, centroid_mm=None),
        provenance=Provenance(calibration="a", zero="b", pixel_size_mm=(0.06, 0.06), unix_s=0.0, ages_s={}),
    )
