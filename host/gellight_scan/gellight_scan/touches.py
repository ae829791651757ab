"""The touches of a body in a stream of frames: one whenever it has been rolled on by a part of its contact."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.frames.pixel_grid import over_gel
from gellight.reconstruction.integration import surface_gradient
from gellight_scan.contact_view import ContactView
from gellight_scan.tracking.following import ObjectFollower
from gellight_scan.tracking.rigid import carried, inverse
from gellight_scan.tracking.view import WORKING_PX, View, at_pixels, reduced

Array = NDArray[np.float64]
ROLLED_ON = 0.85
"""of a touch that the contact still covers: with less the next one is taken"""


@dataclass(frozen=True, eq=False)
class Touch:
    """A body in the gel."""

    contact: ContactView
    """at the size that tracking works at"""
    number: int
    """of the object, by the tracker; another one where it was lost"""
    sequence: int
    """of the frame"""
    motion: Array
    """(4, 4) of the object since the tracker first saw it"""

    @property
    def view(self) -> View:
        """The maps, with the contact that tracking looks at."""
        return view_of(self.contact)


def view_of(contact: ContactView) -> View:
    """Return what tracking takes of a touch, which lies over the gel already."""
    depth, pixel = contact.depth_mm, contact.pixel_size_mm
    slopes = surface_gradient(depth, pixel)
    return View.of(depth, slopes, pixel, camera_height_mm=0.0, thickness_mm=contact.thickness_mm)


def covered(one: View, other: View, motion: Array) -> float:
    """Return the share of the contact of `one` that, moved by (4, 4), lies in that of `other`."""
    rows, columns = np.nonzero(one.touching)
    if not len(rows):
        return 0.0
    return float(at_pixels(other.touching, other.pixels(carried(motion, one.places(rows, columns)))).mean())


def touches_in(frames: Iterator[TactileFrame]) -> Iterator[Touch]:
    """Yield touches of an object that is followed through frames; InputError for a frame without depth."""
    follower, last, last_view = ObjectFollower(doubts=False), None, None
    for frame in frames:
        if isnan(frame.contact.indentation_mm) or frame.provenance is None:
            raise InputError("the sensor has no calibration, so there is no depth to scan: calibrate it first")
        pose = follower.follow(frame).pose
        if pose is None or pose.lost:
            continue
        factor = max(1, round(frame.depth_mm.shape[1] / WORKING_PX))
        made = frame.provenance
        pixel = made.pixel_size_mm[0] * factor, made.pixel_size_mm[1] * factor
        depth = over_gel(reduced(frame.depth_mm, factor), made.camera_height_mm)
        contact = ContactView(depth, pixel, made.calibration, made.gel_thickness_mm)
        touch, view = Touch(contact, pose.number, frame.camera_frame.sequence, pose.motion), view_of(contact)
        if last is not None and last_view is not None and last.number == touch.number:
            rolled = touch.motion @ inverse(last.motion)
            if covered(last_view, view, rolled) > ROLLED_ON:
                continue
        last, last_view = touch, view
        yield touch
