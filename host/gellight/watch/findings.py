"""What the watch reports: each finding has a likely cause, figures and a remedy.

A frame alone tells whether it can be: no gel is pressed deeper than it is thick, and a contact is measured, not
guessed. Another sensor's bundle finds contacts of many millimetres in light that its network never saw.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import OTHER_UNITS, Bundle
from gellight.frames.frames import TactileFrame
from gellight.frames.measures import CLIPPED, DARK, ELSEWHERE, STEEP, STRANGE
from gellight.frames.status import FindingStatus
from gellight.reconstruction.contact import SMALLEST_PATCH_PX
from gellight.reconstruction.force_file import ForceRecord
from gellight.reconstruction.integration import normals, surface_gradient
from gellight.watch.cells import CELL_PX
from gellight.watch.expected import ExpectedError
from gellight.watch.explanation import Explanation
from gellight.watch.other_unit import UnitFigures
from gellight.watch.spots import Spot, SpotKind

DEAD, DIMMED = 0.15, 0.9
"""light of an LED as a share of what it was"""
DRIFT, STRONG_DRIFT = 0.03, 0.10
"""change of a channel as a share of what it was"""
MOVED_PX = 0.3  # chosen: three times the tenth of a pixel to which a move is told (tests/host/watch)
UNEVEN_GREY = 1.0  # chosen: rms that no known cause explains
ADVISED_DEG, ADVISED_MM = 1.0, 0.05
"""expected errors beyond which a new zero or a new calibration is advised"""
MOST_GUESSED = 0.6
"""share of a contact that may have quality flags: pins, pressed deep by a bundle of balls, have up to 0.50"""
GENTLEST, FEWEST_SLOPING, MOST_UNLIKE = 0.03, 200, 0.4
"""slopes that are looked at, how many pixels at least have them, and how far they may be from those of any surface. By
the bundle of a like unit, light that drifts on an untouched Mini reaches 0.44 to 0.54, where colours at random make
0.5; presses of six real sensors 0.1 to 0.3, one in 120 more; ten steep objects of the simulator 0.2"""
MOST_SAMPLES = 2000
"""pixels of a contact that are looked at while the sensor runs"""


class Severity(StrEnum):
    """How much a finding matters."""

    NOTICE = "notice"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True, kw_only=True)
class WatchFinding:
    """Something about the sensor is not as it was calibrated."""

    kind: str
    """starter, too_deep, no_surface, other_light, not_learnt, other_unit, drift, led_dimmed, led_dead, camera_moved,
    uneven, tear, dirt, stuck, never_at_rest, zero_off, recalibrate"""
    severity: Severity
    text: str
    """what was seen, the likely cause and the remedy"""
    figures: dict[str, object]

    def as_json(self) -> FindingStatus:
        """Return it by name."""
        return {"kind": self.kind, "severity": self.severity, "text": self.text, "figures": self.figures}

    @property
    def key(self) -> tuple[str, object]:
        """What makes two findings the same one: the kind, and the LED."""
        return self.kind, self.figures.get("led")


def _found(severity: Severity, kind: str, text: str, **figures: object) -> WatchFinding:
    return WatchFinding(kind=kind, severity=severity, text=text, figures=figures)


_warning, _fault = partial(_found, Severity.WARNING), partial(_found, Severity.FAULT)


def light_findings(
    explanation: Explanation, pixel_size_mm: tuple[float, float], rest_grey: float = 0.0
) -> Iterator[WatchFinding]:
    """Yield the findings about LEDs, drift, a moved camera, or a change that none of them explains.

    rest_grey: what the gel at rest differs from its reference by in any case, as in the manifest.
    """
    for led, light in sorted(explanation.leds.items()):
        if light < DIMMED:
            yield _led(led, light)
    worst = max(explanation.gains, key=lambda gain: abs(gain - 1))
    if abs(worst - 1) >= DRIFT:
        yield _drift(explanation, worst)
    if max(map(abs, explanation.shift_px)) >= MOVED_PX:
        yield _moved(explanation, pixel_size_mm)
    if explanation.leaves(UNEVEN_GREY, rest_grey):
        text = (
            f"the untouched gel differs by {explanation.left_grey:.1f} grey levels that neither single LEDs nor a "
            "moved camera explain: the window is dirty, other light falls in, or the gel has aged; clean it, shade it, "
            "then calibrate again"
        )
        yield _warning("uneven", text, left_grey=round(explanation.left_grey, 2))


def _led(led: int, light: float) -> WatchFinding:
    place, figures = f"LED {led} (azimuth {30 * led} degrees)", {"led": led, "light": round(light, 3)}
    if light < DEAD:
        return _fault(
            "led_dead", f"{place} is dark: it is broken or its supply is; replace it and calibrate again", **figures
        )
    text = f"{place} gives {light:.0%} of its light: it ages, runs hot or is covered; clean it or calibrate again"
    return _warning("led_dimmed", text, **figures)


def _drift(explanation: Explanation, worst: float) -> WatchFinding:
    strong = abs(worst - 1) >= STRONG_DRIFT
    cause = "an LED supply that sags, an exposure that is not locked, or aged LEDs" if strong else "LEDs that warm up"
    figures = {name: round(gain, 4) for name, gain in zip(("red", "green", "blue"), explanation.gains, strict=True)}
    text = f"the light is {worst:.1%} of what it was when the sensor was calibrated: {cause}"
    return _found(Severity.WARNING if strong else Severity.NOTICE, "drift", text, **figures)


def _moved(explanation: Explanation, pixel_size_mm: tuple[float, float]) -> WatchFinding:
    x, y = explanation.shift_px
    x_mm, y_mm = x * pixel_size_mm[0], y * pixel_size_mm[1]
    text = (
        f"the picture has moved by {x:+.1f}, {y:+.1f} px: the camera or the gel is loose; positions are off by "
        f"{x_mm:+.2f}, {y_mm:+.2f} mm; fasten it and calibrate again"
    )
    places = {"x_px": round(x, 2), "y_px": round(y, 2), "x_mm": round(x_mm, 3), "y_mm": round(y_mm, 3)}
    return _warning("camera_moved", text, **places)


_SPOT_TEXTS = {
    SpotKind.TEAR: "the coating of the gel is torn or worn there; replace the gel",
    SpotKind.DIRT: "dirt on the window, on the lens or behind the gel; clean it",
    SpotKind.STUCK: "something sticks to the gel or has dented it; clean it",
}


def spot_finding(spot: Spot, image_shape: tuple[int, int], pixel_size_mm: tuple[float, float]) -> WatchFinding:
    """Return the finding of a spot that never comes to rest."""
    x_px, y_px = ((cell + 0.5) * CELL_PX - 0.5 for cell in (spot.column, spot.row))
    x_mm = (x_px - (image_shape[1] - 1) / 2) * pixel_size_mm[0]
    y_mm = (y_px - (image_shape[0] - 1) / 2) * pixel_size_mm[1]
    area = spot.cells * CELL_PX**2 * pixel_size_mm[0] * pixel_size_mm[1]
    where = f"a spot of {area:.1f} mm2 at ({x_mm:.1f}, {y_mm:.1f}) mm stays while touches come and go"
    figures = {"x_mm": round(x_mm, 2), "y_mm": round(y_mm, 2), "area_mm2": round(area, 2)}
    found = _fault if spot.kind is SpotKind.TEAR else _warning
    light = [round(share, 3) for share in spot.light]
    return found(str(spot.kind), f"{where}: {_SPOT_TEXTS[spot.kind]}", **figures, light=light)


def other_unit(figures: UnitFigures, felt_deg: float) -> WatchFinding:
    """Return the finding that the bundle was made with another unit; felt_deg: the mean slope felt as it is."""
    text = (
        f"this bundle was made with another unit: {figures.reason}; as it is, the gel is felt {felt_deg:.0f} degrees "
        "tilted; calibrate this sensor, or give its own bundle"
    )
    return _fault("other_unit", text, **figures.as_json(), felt_deg=round(felt_deg, 1))


def starter(units: list[str]) -> WatchFinding:
    """Return the finding that a bundle was learnt on other units of the same kind."""
    text = (
        f"not your unit: this bundle was learnt on others ({', '.join(units)}), so contacts and shapes are seen, but "
        "depth and normals are rough; calibrate this sensor"
    )
    return _warning("starter", text, units=units)


def too_deep(depth_mm: float, thickness_mm: float) -> WatchFinding:
    """Return the finding that a frame is deeper than the gel is thick."""
    text = (
        f"{depth_mm:.1f} mm deep in a gel that is {thickness_mm:g} mm thick: the bundle is of another sensor, the "
        "light is another one, or the picture shows no gel; give the bundle of this sensor, or calibrate it"
    )
    return _fault("too_deep", text, depth_mm=round(depth_mm, 3), thickness_mm=thickness_mm)


def other_light(refusal: str, most: float) -> WatchFinding:
    """Return the finding that the light of a picture is too far from that of the calibration."""
    return _warning("other_light", refusal, most_change=round(most, 3))


def not_learnt(flags: NDArray[np.uint8]) -> WatchFinding:
    """Return the finding that most of a contact is a guess; flags: the quality flags of its pixels."""
    shares = {words: float(np.mean(flags & bit > 0)) for words, bit in _FLAGS.items()}
    reasons = ", ".join(f"{share:.0%} {words}" for words, share in shares.items() if share > 0)
    text = (
        f"{np.mean(flags > 0):.0%} of the contact is a guess ({reasons}): the bundle is of another sensor, the light "
        "is another one, or nothing like it was pressed in the calibration: add such presses to it"
    )
    return _warning("not_learnt", text, guessed=round(float(np.mean(flags > 0)), 3))


def never_seen(share: float) -> WatchFinding:
    """Return the finding that the calibration never saw the places or colours of a share of the contact."""
    text = (
        f"{share:.0%} of the contact is where the calibration has no press, or has colours that none had: depth and "
        "normals are a guess there; calibrate again with presses there, or give the bundle of this sensor"
    )
    return _warning("not_learnt", text, guessed=round(share, 3))


_FLAGS = {
    "steeper than was learnt": STEEP, "in shadow": DARK, "too bright": CLIPPED,
    "where the calibration has no press": ELSEWHERE, "of a colour that no press had": STRANGE,
}  # fmt: skip
"""quality flags in words"""


def never_at_rest(seconds: float) -> WatchFinding:
    """Return the finding that the gel was never seen at rest: every look saw something that light cannot do."""
    text = (
        f"for {seconds:.0f} s, ever since the start, the gel has not been seen as it was calibrated: something lies on "
        "it, the camera has moved far, or this is another gel or bundle; lift everything off, else calibrate again"
    )
    return _warning("never_at_rest", text, seconds=round(seconds))


def advice(expected: ExpectedError) -> Iterator[WatchFinding]:
    """Advise a new zero, and a new calibration where the change costs more than a zero can mend."""
    if expected.zero_deg >= ADVISED_DEG or expected.zero_mm >= ADVISED_MM:
        text = (
            f"the zero is wrong: depth is off by up to {expected.zero_most_mm:.2f} mm, on average "
            f"{expected.zero_mm:.2f} mm and {expected.zero_deg:.1f} degrees, also where nothing touches; lift "
            "everything off and set the zero, or calibrate again"
        )
        yield _warning("zero_off", text, **expected.as_json())
    if expected.gain_deg >= ADVISED_DEG or expected.gain_mm >= ADVISED_MM:
        text = (
            "adapt the bundle (`gellight calibrate adapt`), or calibrate again: even with the right zero contacts are "
            f"felt about {expected.gain_deg:.1f} degrees and {expected.gain_mm:.2f} mm (of a press of 1 mm) worse than "
            "when the sensor was calibrated"
        )
        yield _warning("recalibrate", text, **expected.as_json())


def learnt_elsewhere(bundle: Bundle) -> list[WatchFinding]:
    """Return the finding that a bundle is a starter bundle; none for another one."""
    units = bundle.metrics.get(OTHER_UNITS)
    return [starter(list(map(str, units)))] if units else []


def gel_thickness_mm(bundle: Bundle, told_mm: float | None = None) -> float | None:
    """Return how thick the gel of a sensor is, by its bundle, else as `told_mm` says; None where nobody knows."""
    record = ForceRecord.in_bundle(bundle)
    return bundle.manifest.gel_thickness_mm or (record.gel_thickness_mm if record else None) or told_mm


def impossible_depth(frame: TactileFrame, thickness_mm: float | None) -> Iterator[WatchFinding]:
    """Yield the finding that a frame is deeper than the gel is thick."""
    if thickness_mm is not None and frame.contact.indentation_mm > thickness_mm:
        yield too_deep(frame.contact.indentation_mm, thickness_mm)


def no_surface(frame: TactileFrame, pixel_size_mm: tuple[float, float]) -> Iterator[WatchFinding]:
    """Yield the finding that the felt slopes are those of no surface, as if only the light had changed.

    Compared are the unit normals of the felt slopes and of the depth that was made of them: root mean square of their
    distance over that from upright, 0 for a surface. Series of single lights are not judged: their noise
    is not smoothed.
    """
    if frame.exposures is not None:
        return
    sloping = np.hypot(*np.moveaxis(frame.gradient_map, 2, 0)) > GENTLEST
    if np.count_nonzero(sloping) < FEWEST_SLOPING or np.count_nonzero(frame.contact.mask) < SMALLEST_PATCH_PX:
        return
    felt, fitted = (normals(g)[sloping] for g in (frame.gradient_map, surface_gradient(frame.depth_mm, pixel_size_mm)))
    unlike = float(np.sqrt(((felt - fitted) ** 2).sum() / ((felt - (0, 0, 1)) ** 2).sum()))
    if unlike > MOST_UNLIKE:
        text = (
            f"what is felt is no surface: its slopes contradict each other by {unlike:.0%}, so the light has changed "
            "where nothing touches, or the bundle is of another sensor; lift everything off and set the zero, or "
            "calibrate again"
        )
        yield _warning("no_surface", text, unlike=round(unlike, 3))


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
