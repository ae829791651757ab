"""How deep the rim of a contact lies: slopes beside contacts, of which some sensors feel a multiple.

An object drags the gel around its contact down with it: the skirt, which says how deep the rim lies. The light of some
sensors changes far beyond the contact as if the gel were steep there (of one GelSight Mini four times as steep as
contact mechanics allows), and the same colours are right inside a contact, so no network of single pixels can tell.
What tells is the place: inside the contact or beside it. A calibration on balls in a gel of known thickness knows by
how much the skirts are wrong (`lab.training.judged_fit`).
"""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from gellight.frames.frames import TactileFrame
from gellight.reconstruction.contact import deepest_mm, patched
from gellight.reconstruction.integration import far_from_touch
from gellight.reconstruction.perspective import Perspective, depth_seen

RAMP = 0.2
"""radii of the contact over which the share of the slopes that counts falls. A step at the rim, which is not known so
well, makes normals in a real Mini's circles 0.8 degrees worse, one at 0.1 radii none"""
_SLOPING = 0.03
"""slope above which gel is not at rest; from 0.01 to 0.1 presses of three real sensors differ by 1.5 % in depth"""


def with_true_skirts(
    frame: TactileFrame, share: float, pixel_size_mm: tuple[float, float], seen: Perspective | None, **how: Any
) -> TactileFrame:
    """Return a frame of which only a share of the slopes beside contacts counts: the same contact, less or more deep.

    seen: None along parallel rays. how: see `integrate`.
    """
    mask, felt = frame.contact.mask, frame.gradient_map
    if not mask.any():
        return frame
    radius_px = float(np.sqrt(np.count_nonzero(mask) / np.pi))
    beside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    counted = 1 - np.float32(1 - share) * np.minimum(beside / np.float32(RAMP * radius_px), 1)
    slopes = np.asarray(felt * counted[..., np.newaxis], np.float32)
    at_rest = far_from_touch(np.hypot(felt[..., 0], felt[..., 1]) > _SLOPING)
    depth = depth_seen(slopes, pixel_size_mm, seen, at_rest=at_rest, **how)
    contact = replace(frame.contact, indentation_mm=deepest_mm(mask, depth))
    contact, contacts = patched(contact, depth, slopes, pixel_size_mm, seen)
    return replace(frame, gradient_map=slopes, depth_mm=depth, contact=contact, contacts=tuple(contacts))
