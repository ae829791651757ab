"""The object in the frames of one sensor, where somebody asks for it."""

import threading
from dataclasses import replace
from math import isnan

from gellight.frames.frames import TactileFrame
from gellight.tracking.tracker import Tracker
from gellight.tracking.view import View

GAP_S = 1.0
"""after so long without a frame the object may be another one"""


class ObjectFollower:
    """Gives frames their pose while it is on, and does nothing while it is off."""

    def __init__(self, *, on: bool = False, doubts: bool = True) -> None:
        """Begin with no object; `doubts` as `Tracker` has it."""
        self._lock, self._doubts = threading.Lock(), doubts
        self._tracker = Tracker(doubts=doubts) if on else None
        self._seen: tuple[object, ...] = ()
        """what the maps of the last frame were made with"""
        self._seen_s = 0.0

    @property
    def on(self) -> bool:
        """Whether frames get a pose."""
        return self._tracker is not None

    def switch(self, *, on: bool) -> None:
        """Begin with object number 1, or stop; where nothing changes, go on."""
        with self._lock:
            if on != self.on:
                self._tracker = Tracker(doubts=self._doubts) if on else None

    def follow(self, frame: TactileFrame) -> TactileFrame:
        """Return the frame with the pose of its object; as it is where nobody asks or nothing is felt.

        After a gap of a second, with another bundle or maps of another size, what touches is another object.
        """
        tracker, provenance = self._tracker, frame.provenance
        moved = frame.exposures is not None and frame.exposures.moved
        if tracker is None or provenance is None or moved or isnan(frame.contact.indentation_mm):
            return frame
        with self._lock:
            made_with = provenance.calibration, provenance.pixel_size_mm, frame.depth_mm.shape
            taken_s = frame.camera_frame.time_s
            if made_with != self._seen or not 0 <= taken_s - self._seen_s <= GAP_S:
                tracker.forget()
            self._seen, self._seen_s = made_with, taken_s
            thickness_mm, height_mm = provenance.gel_thickness_mm, provenance.camera_height_mm
            maps = frame.depth_mm, frame.gradient_map, provenance.pixel_size_mm
            view = View.of(*maps, thickness_mm=thickness_mm, camera_height_mm=height_mm)
            return replace(frame, pose=tracker.follow(view, frame.camera_frame.sequence))
