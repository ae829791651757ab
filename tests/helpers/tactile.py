"""Tactile frames of maps that a test knows, and of one smooth hill, as deep as is asked for."""

from dataclasses import replace

import numpy as np

from gellight.frames.frames import CameraFrame, Contact, Provenance, TactileFrame


def tactile(
    depth_mm: np.ndarray, gradient_map: np.ndarray | None = None, mask: np.ndarray | None = None, sequence: int = 0
) -> TactileFrame:
    """A frame of these maps, (H, W) and (H, W, 2), whose picture is black; touched is what is deep or in `mask`."""
    none = np.zeros((*depth_mm.shape, 3), np.float32)
    touched = depth_mm > 0 if mask is None else mask
    return TactileFrame(
        camera_frame=CameraFrame(image=none.astype(np.uint8), time_s=0.0, sequence=sequence),
        difference=none,
        gradient_map=none[..., :2] if gradient_map is None else gradient_map.astype(np.float32),
        depth_mm=depth_mm.astype(np.float32),
        contact=Contact(mask=touched, area_mm2=1.0, indentation_mm=float(depth_mm.max()), centroid_mm=None),
    )


HILL = np.exp(-(((np.indices((48, 64)) - [[[24]], [[32]]]) / 10.0) ** 2).sum(axis=0))


def hill_frame(deep_mm: float, noise: float = 0.0, seed: int = 0) -> TactileFrame:
    """Return the frame of the hill, with noise of the depth, mm."""
    depth = deep_mm * HILL + noise * np.random.default_rng(seed).standard_normal(HILL.shape)
    felt = tactile(depth, mask=depth > 0.1, sequence=seed)
    made = Provenance(calibration="a", zero="b", pixel_size_mm=(0.06, 0.06), unix_s=0.0, ages_s={})
    return replace(felt, contact=replace(felt.contact, indentation_mm=deep_mm), provenance=made)
