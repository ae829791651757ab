"""The check of the native path against the NumPy form, before it is used: one made-up frame through both."""

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.reconstruction.integration import angle_deg
from gellight.reconstruction.native.cells import EVERY_PIXEL
from gellight.reconstruction.native.library import NativePathError
from gellight.reconstruction.native.native_path import NativePath
from gellight.reconstruction.stages import TactilePath

MOST_APART = {"every pixel": (0.01, 1e-4), "cells": (0.5, 2e-2)}
"""The largest mean angle between the normals, degrees, and the largest mean difference of the depth, mm.

Asked at every pixel as NumPy is, C differs by rounding: 0.0001 degrees and 0.001 µm. That judges all of the library but
the blending between cells, which costs up to 0.18 degrees and 5.3 µm on steep colours that nobody learnt.
"""
DEEPEST_MM = 10.0
"""No gel is as thick. A network of few presses can answer a made-up frame by slopes along the line of sight; depth
then runs to 90 mm, and rounding is worth 0.1 mm there and nothing elsewhere."""
_STRONGEST_GREY = 40.0  # chosen: presses of real sensors change their contact by 22 to 40


def refuse_disagreement(path: NativePath, judge: TactilePath, bundle: Bundle) -> None:
    """Raise NativePathError where a path answers otherwise than the judge to a made-up frame."""
    frame = CameraFrame(image=made_up_image(bundle), time_s=0.0, sequence=0)
    right, at_cells = judge.reconstruct(frame), path.limits
    for asked, limits in zip(MOST_APART, (EVERY_PIXEL, at_cells), strict=True):
        path.limits = limits
        apart = differences(path.reconstruct(frame), right)
        # A comparison with NaN is false.
        if not all(found <= most for found, most in zip(apart, MOST_APART[asked], strict=True)):
            raise NativePathError(
                f"the library answers otherwise than NumPy on this machine: asked at {asked}, normals differ by "
                "{:.3g} degrees and the depth by {:.3g} mm in the mean (allowed {} and {})".format(
                    *apart, *MOST_APART[asked]
                )
            )


def differences(found: TactileFrame, right: TactileFrame) -> tuple[float, float]:
    """Return the mean angle between the normals of two frames, degrees, and the mean difference of their depth, mm.

    What is further than `DEEPEST_MM` from the gel at rest counts as just so far.
    """
    depths = (np.clip(frame.depth_mm, -DEEPEST_MM, DEEPEST_MM) for frame in (found, right))
    angle = angle_deg(found.normal_map.reshape(-1, 3), right.normal_map.reshape(-1, 3))
    return float(angle.mean()), float(np.abs(np.subtract(*depths)).mean())


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
