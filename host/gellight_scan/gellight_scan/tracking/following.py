"""The object in the frames of one sensor; the entry point `gellight.trackers` names it."""

from dataclasses import replace
from math import isnan

from gellight.frames.frames import TactileFrame
from gellight_scan.tracking.tracker import Tracker
from gellight_scan.tracking.view import View

GAP_S = 1.0
"""after so long without a frame the object may be another one"""


class ObjectFollower:
    """Gives frames their pose; one thread uses it."""

    def __init__(self, *, doubts: bool = True) -> None:
        """Begin with object number 1; `doubts` as `Tracker` has it."""
        self._tracker = Tracker(doubts=doubts)
        self._seen: tuple[object, ...] = ()
        """what the maps of the last frame were made with"""
        self._seen_s = 0.0

    def follow(self, frame: TactileFrame) -> TactileFrame:
        """Return the frame with the pose of its object; as it is where nothing is felt.

        After a gap of a second, with another bundle or maps of another size, what touches is another object.
        """
        provenance = frame.provenance
        moved = frame.exposures is not None and frame.exposures.moved
        if provenance is None or moved or isnan(frame.contact.indentation_mm):
            return frame
        made_with = provenance.calibration, provenance.pixel_size_mm, frame.depth_mm.shape
        taken_s = frame.camera_frame.time_s
        if made_with != self._seen or not 0 <= taken_s - self._seen_s <= GAP_S:
            self._tracker.forget()
        self._seen, self._seen_s = made_with, taken_s
        thickness_mm, height_mm = provenance.gel_thickness_mm, provenance.camera_height_mm
        maps = frame.depth_mm, frame.gradient_map, provenance.pixel_size_mm
        view = View.of(*maps, thickness_mm=thickness_mm, camera_height_mm=height_mm)
        return replace(frame, pose=self._tracker.follow(view, frame.camera_frame.sequence))
