"""Whether what a frame says can be: no gel is pressed deeper than it is thick, and a contact is measured, not guessed.

Another sensor's bundle finds contacts of many millimetres in light that its network never saw.
"""

from collections.abc import Iterator

import numpy as np

from gellight.bundle.bundle import OTHER_UNITS, Bundle
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.force_file import read_force
from gellight.watch.findings import WatchFinding, never_seen, not_learnt, starter, too_deep

MOST_GUESSED = 0.6
"""share of a contact that may have quality flags: pins, pressed deep by a bundle of balls, have up to 0.50"""

MOST_SAMPLES = 2000
"""pixels of a contact that are looked at while the sensor runs"""


def learnt_elsewhere(bundle: Bundle) -> list[WatchFinding]:
    """Return the finding that a bundle is a starter bundle; none for another one."""
    units = bundle.metrics.get(OTHER_UNITS)
    return [starter(list(map(str, units)))] if units else []


def gel_thickness_mm(bundle: Bundle, told_mm: float | None = None) -> float | None:
    """Return how thick the gel of a sensor is, by its bundle, else as `told_mm` says; None where nobody knows."""
    record = read_force(bundle)
    return bundle.manifest.gel_thickness_mm or (record.gel_thickness_mm if record else None) or told_mm


def impossible_depth(frame: TactileFrame, thickness_mm: float | None) -> Iterator[WatchFinding]:
    """Yield the finding that a frame is deeper than the gel is thick."""
    if thickness_mm is not None and frame.contact.indentation_mm > thickness_mm:
        yield too_deep(frame.contact.indentation_mm, thickness_mm)


def unseen_contact(frame: TactileFrame) -> Iterator[WatchFinding]:
    """Yield the finding that the calibration never saw the places or colours of most of a contact, by some pixels."""
    if frame.measures is None or not frame.contact.mask.any():
        return
    pixels = np.flatnonzero(frame.contact.mask)
    some = pixels[:: -(-len(pixels) // MOST_SAMPLES)]
    share = float(frame.measures.never_seen(frame.camera_frame.image, some).mean())
    if share > MOST_GUESSED:
        yield never_seen(share)


def guessed_contact(frame: TactileFrame) -> Iterator[WatchFinding]:
    """Yield the finding that most of a contact has colours or slopes that nothing learnt."""
    touched, confidence = frame.contact.mask, frame.confidence
    if confidence is None or not touched.any():
        return
    flags = confidence.quality_flags[touched]
    if np.mean(flags > 0) > MOST_GUESSED:
        yield not_learnt(flags)
