"""The check of the native path against the NumPy form, before it is used: one made-up frame through both."""

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.reconstruction.integration import angle_deg
from gellight.reconstruction.native.library import NativePathError
from gellight.reconstruction.stages import TactilePath

NORMALS_DEG = 0.2
"""the largest mean angle between the normals; C asks the network at cells, which costs 0.01 degrees and 1 µm"""
DEPTH_MM = 5e-3
"""the largest mean difference of the depth"""
_STRONGEST_GREY = 40.0


def refuse_disagreement(path: TactilePath, judge: TactilePath, bundle: Bundle) -> None:
    """Raise NativePathError where a path answers otherwise than the judge to a made-up frame."""
    frame = CameraFrame(image=made_up_image(bundle), time_s=0.0, sequence=0)
    found, right = path.reconstruct(frame), judge.reconstruct(frame)
    degrees, depth_mm = differences(found, right)
    # A comparison with NaN is false.
    if not (degrees <= NORMALS_DEG and depth_mm <= DEPTH_MM):
        raise NativePathError(
            f"the library answers otherwise than NumPy on this machine: in the mean normals differ by {degrees:.3g} "
            f"degrees (allowed {NORMALS_DEG}), the depth by {depth_mm:.3g} mm (allowed {DEPTH_MM})"
        )


def differences(found: TactileFrame, right: TactileFrame) -> tuple[float, float]:
    """Return the mean angle between the normals of two frames, degrees, and the mean difference of their depth, mm."""
    angle = angle_deg(found.normal_map.reshape(-1, 3), right.normal_map.reshape(-1, 3))
    return float(angle.mean()), float(np.abs(found.depth_mm - right.depth_mm).mean())


def made_up_image(bundle: Bundle, seed: int = 0) -> NDArray[np.uint8]:
    """Return the reference image with noise and some coloured bumps, from gentle ones to steep ones."""
    rng = np.random.default_rng(seed)
    height, width = bundle.image_shape
    image = bundle.reference + bundle.manifest.noise_grey * rng.standard_normal(bundle.reference.shape, np.float32)
    x, y = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    for radius in (share * min(height, width) for share in (0.02, 0.04, 0.1, 0.2)):
        across, down = (np.exp(-(((at - rng.uniform(0, at.size)) / radius) ** 2)) for at in (x, y))
        colour = rng.uniform(-_STRONGEST_GREY, _STRONGEST_GREY, 3)
        image += (down[:, None] * across)[..., None] * colour.astype(np.float32)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
