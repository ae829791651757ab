"""The edge and the two faces of a prism that is pressed into the gel, or the reason why there are none.

A prism touches with a straight edge. How the light answers is not known and is solved for by least squares, so what is
fitted (`prism_pattern`) is where the edge lies, how wide the contact is and how it ends.
"""

from dataclasses import dataclass, replace
from math import atan, cos, degrees, hypot, pi, sin, tan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frames.pixel_grid import block_means
from gellight.lab.training.labelling.fitting import Bounds, Residual, cost, least, standard_errors, without
from gellight.lab.training.labelling.pattern import (
    LEAST_GREY,
    LEAST_QUALITY,
    PixelSample,
    check_clipped,
    difference_image,
)
from gellight.lab.training.labelling.prism_pattern import (
    SIMPLE,
    EdgeShape,
    Slopes,
    columns,
    face,
    free_response,
    lean_of,
    response,
    slopes_of,
)
from gellight.lab.training.labelling.search import explained
from gellight.lab.training.prisms import PrismPress, most_lean_deg, sure_lean_rad

Array = NDArray[np.float64]
LEAST_FACE_PX = 5.0
"""narrower faces are nothing but rounded edge and rim"""
MOST_RISE_DEG = 2.0
"""how far its edge may rise before the angle of its faces says little"""
_FITTED_PIXELS = 1500
_COARSE_PX = 64.0
"""the longer side of the shrunken image that is searched"""
_TURNS = np.arange(12) * pi / 12
_FACES = (1.5, 2.2, 3.3, 5.0, 7.5)
"""widths of a face that are tried, pixels of the shrunken image"""
_LONG = 2.0
"""in widths of a face: half the length of edge that is looked for first"""
_SKIRT = 2.2
"""in widths of a face: how far from the edge the pattern is fitted"""
_SLAB = 0.5
"""in widths of a face: steps in which the ends of the edge are looked for"""
_PLACES, _SHARES = np.linspace(-1.5, 1.5, 25), (0.15, 0.3, 0.5, 0.75, 1.0)
"""of the edge and of the widths, in widths first guessed, that are tried: a rim can look like an edge"""
_BEGIN = 3
_LIKE = 0.6
"""share of a slab of the edge that the pattern of the others must explain"""
_LEAST_LONG = 2.5
"""in widths of a face: a shorter edge is none"""
_SHARPEST = 0.33
"""in widths of a face: an edge that is rounded more leaves no face"""


@dataclass(frozen=True, kw_only=True)
class PrismContact:
    """Where a prism touches the gel."""

    edge_x1_px: float
    edge_y1_px: float
    edge_x2_px: float
    edge_y2_px: float
    face_px: float
    """width of the contact from the edge to where the gel leaves the face, the narrower of the two"""
    quality: float
    """share of the difference image around it that the pattern of a prism explains, 0 to 1"""
    contrast_grey: float
    """root mean square of that pattern on the faces, grey levels"""
    lean_deg: float
    """how far the prism leans to one side, by how much wider one face touches; of that face the slope is less"""
    lean_error_deg: float
    """standard error"""
    rise_deg: float
    """how far its edge rises along itself, by how the contact widens"""
    rounding_px: float
    """of the edge: standard deviation of a Gaussian"""
    angle_rad: float
    """between each face and the gel at rest, as it was given"""

    def record(self) -> dict[str, float]:
        """Return what the csv and JSON hold, rounded."""
        places = {"edge_x1_px": 2, "edge_y1_px": 2, "edge_x2_px": 2, "edge_y2_px": 2, "face_px": 2, "rounding_px": 2}
        rounded = {name: round(getattr(self, name), digits) for name, digits in places.items()}
        return {
            **rounded,
            "angle_deg": round(degrees(self.angle_rad), 3),
            "quality": round(self.quality, 3),
            "lean_deg": round(self.lean_deg, 2),
            "lean_error_deg": round(self.lean_error_deg, 2),
            "rise_deg": round(self.rise_deg, 2),
        }

    def press(self, image: Path) -> PrismPress:
        """Return the labelled press."""
        return PrismPress(
            image=image,
            edge_px=(self.edge_x1_px, self.edge_y1_px, self.edge_x2_px, self.edge_y2_px),
            face_px=self.face_px,
            angle_rad=self.angle_rad,
            lean_rad=sure_lean_rad(self.lean_deg, self.lean_error_deg),
            rounding_px=self.rounding_px,
        )

    def from_line(self, image_shape: tuple[int, int]) -> Array:
        """Return the distance of each (H, W) pixel from the edge and the rims of both faces, px."""
        along, across = self.press(Path()).distances(image_shape)
        beyond = np.maximum(np.abs(along - self.length_px / 2) - self.length_px / 2, 0)
        return np.asarray(np.hypot(np.minimum(np.abs(across), np.abs(np.abs(across) - self.face_px)), beyond))

    @property
    def length_px(self) -> float:
        """Length of the edge."""
        return hypot(self.edge_x2_px - self.edge_x1_px, self.edge_y2_px - self.edge_y1_px)


def find_prism(image: NDArray[np.uint8], reference: NDArray[np.number], *, angle_rad: float) -> PrismContact:
    """Find the edge of a prism in one (H, W, 3) image, without any calibration of the light.

    reference: (H, W, 3) of the untouched gel, grey levels; angle_rad: between each face and the gel at rest.
    Raises InputError with the reason where there is no prism, or its faces say little.
    """
    slopes = slopes_of(angle_rad, 0.0)
    difference = difference_image(image, reference)
    middle, shape = _first_guess(difference, slopes)
    reach = _LONG * face(shape)
    shape = _fitted(_strip(difference, middle, shape).sampled((-reach, reach)), shape, slopes)
    strip = _strip(difference, middle, shape)
    ends = _ends(strip, shape, slopes)
    pixels = strip.sampled(ends)
    shape = _fitted(pixels, shape, slopes)
    slopes = slopes_of(angle_rad, lean_of(shape, angle_rad))
    shape = _solved(free_response(pixels, slopes), shape)
    contact = _contact(middle, shape, ends, pixels, slopes, angle_rad, image.shape)
    _check(contact)
    check_clipped(image, reference, contact.press(Path()).faces(image.shape[:2]) != 0, "on the faces")
    return contact


def _first_guess(difference: Array, slopes: Slopes) -> tuple[tuple[float, float], EdgeShape]:
    """Middle of the window, px, and the shape, by a matched filter over places, turns and widths."""
    side = max(1, round(max(difference.shape[:2]) / _COARSE_PX))
    small: Array = block_means(difference, side)
    best: tuple[float, tuple[int, int], EdgeShape] | None = None
    for width in _FACES:
        reach = min(int(np.ceil(_LONG * width)), min(small.shape[:2]) // 2 - 1)
        steps = np.arange(-reach, reach + 1, dtype=np.float64)
        x, y = np.tile(steps, len(steps)), np.repeat(steps, len(steps))
        for turn in _TURNS:
            shape = EdgeShape(
                turn=turn, offset=0, before=width, behind=width, rounding=0.5,
                step_length=width / 4, skirt_length=2 * width,
            )  # fmt: skip
            along, across = shape.along_across(x, y)
            pattern = response(along, across, shape, slopes)[:, [0, 1, 4]]
            pattern *= (np.hypot(along, across) <= reach)[:, None]
            gain = explained(small, np.ones(small.shape[:2]), pattern)
            place = np.unravel_index(int(gain.argmax()), gain.shape)
            if best is None or gain[place] > best[0]:
                best = float(gain[place]), (int(place[0]), int(place[1])), shape
    assert best is not None
    _, (row, column), shape = best
    wide = side * shape.before
    middle = (column + 0.5) * side - 0.5, (row + 0.5) * side - 0.5
    return middle, replace(shape, before=wide, behind=wide, rounding=2.0, step_length=wide / 4, skirt_length=2 * wide)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Strip:
    """Pixels of the difference image beside the edge."""

    difference: Array
    middle: tuple[float, float]
    near: NDArray[np.intp]
    """(N,) numbers of the pixels, row by row"""
    along: Array
    """(N,) how far each lies along the edge, px"""

    def sampled(self, ends: tuple[float, float]) -> PixelSample:
        """Choose pixels between two places along the edge; the same ones each time."""
        between = self.near[(self.along > ends[0]) & (self.along < ends[1])]
        chosen = np.random.default_rng(0).choice(between, min(len(between), _FITTED_PIXELS), replace=False)
        y, x = np.divmod(chosen, self.difference.shape[1])
        return PixelSample(x=x - self.middle[0], y=y - self.middle[1], colour=self.difference[y, x])


def _strip(difference: Array, middle: tuple[float, float], shape: EdgeShape) -> _Strip:
    rows, columns = np.indices(difference.shape[:2], dtype=np.float64)
    along, across = shape.along_across(np.asarray(columns - middle[0]), np.asarray(rows - middle[1]))
    near = np.flatnonzero(np.abs(across) < _SKIRT * max(shape.before, shape.behind))
    return _Strip(difference=difference, middle=middle, near=near, along=along.ravel()[near])


def _fitted(pixels: PixelSample, shape: EdgeShape, slopes: Slopes) -> EdgeShape:
    """Return the shape that leaves least of the colours; the best few of a grid of places and widths begin."""

    residual, few = free_response(pixels, slopes), free_response(pixels.few(), slopes)
    grid = [
        replace(shape, offset=shape.offset + place * face(shape), before=share * shape.before,
                behind=share * shape.behind, step_length=share * shape.step_length)
        for place in _PLACES for share in _SHARES
    ]  # fmt: skip
    begin = sorted(grid, key=lambda one: float(np.abs(residual.left(one)).sum()))[:_BEGIN]
    guesses = [_solved(few, one) for one in begin]
    return _solved(residual, min(guesses, key=lambda guess: cost(residual.left(guess))))


def _solved(residual: Residual[EdgeShape], begin: EdgeShape) -> EdgeShape:
    wide = face(begin)
    low = [begin.turn - 0.4, begin.offset - 2 * wide, 0.15 * wide, 0.15 * wide, -0.2, 0.3, 0, 0.3, 0.5 * wide]
    high = [begin.turn + 0.4, begin.offset + 2 * wide, 4 * wide, 4 * wide, 0.2, wide, 1, wide, 10 * wide]
    inside = EdgeShape.of(np.clip(begin.vector(), np.add(low, 1e-6), np.subtract(high, 1e-6)))
    scale = (0.02, 1, 1, 1, 0.02, 0.3, 0.1, 1, 5)
    return least(residual, inside, Bounds(low=low, high=high, scale=scale, evaluations=40))


def _ends(strip: _Strip, shape: EdgeShape, slopes: Slopes) -> tuple[float, float]:
    """Return how far the pattern goes along the edge to both sides, px: slab by slab, as long as it explains them."""
    wide = face(shape)
    ends = [-_LONG * wide, _LONG * wide]
    for side, sign in ((0, -1), (1, 1)):
        while True:
            inside = strip.sampled((ends[0], ends[1]))
            amounts, *_ = np.linalg.lstsq(columns(inside, shape, slopes), inside.colour, rcond=None)
            further = ends[side] + sign * _SLAB * wide
            slab = strip.sampled((min(ends[side], further), max(ends[side], further)))
            if len(slab.x) < _SLAB * wide * _SKIRT * wide or _unlike(
                slab, shape, slopes, np.asarray(amounts, np.float64)
            ):
                break
            ends[side] = further
    return ends[0], ends[1]


def _unlike(slab: PixelSample, shape: EdgeShape, slopes: Slopes, amounts: Array) -> bool:
    """Whether a response that fits elsewhere along the edge leaves much of a slab unexplained."""
    even = np.ones((len(slab.x), 1))
    seen = without(even, slab.colour)
    left = seen - without(even, columns(slab, shape, slopes) @ amounts)
    return bool((left**2).sum() > (1 - _LIKE) * (seen**2).sum())


def _contact(
    middle: tuple[float, float],
    shape: EdgeShape,
    ends: tuple[float, float],
    pixels: PixelSample,
    slopes: Slopes,
    angle_rad: float,
    image_shape: tuple[int, ...],
) -> PrismContact:
    quality, contrast = _judged(shape, pixels, slopes)
    across = (-sin(shape.turn), cos(shape.turn))
    foot = middle[0] + shape.offset * across[0], middle[1] + shape.offset * across[1]
    inset = _SLAB * face(shape)  # the gel leaves the faces before their ends
    inner = _clipped(foot, shape.turn, (ends[0] + inset, ends[1] - inset), image_shape)
    x1, x2 = (foot[0] + end * cos(shape.turn) for end in inner)
    y1, y2 = (foot[1] + end * sin(shape.turn) for end in inner)
    return PrismContact(
        edge_x1_px=x1,
        edge_y1_px=y1,
        edge_x2_px=x2,
        edge_y2_px=y2,
        face_px=min(shape.before, shape.behind) - abs(shape.widening) * (ends[1] - ends[0]) / 2,
        quality=quality,
        contrast_grey=contrast,
        lean_deg=degrees(lean_of(shape, angle_rad)),
        lean_error_deg=degrees(_lean_error(shape, pixels, slopes, angle_rad)),
        rise_deg=degrees(atan(tan(angle_rad) * shape.widening)),
        rounding_px=shape.rounding,
        angle_rad=angle_rad,
    )


def _lean_error(shape: EdgeShape, pixels: PixelSample, slopes: Slopes, angle: float) -> float:
    """Return the standard error of the lean, rad: by scatter, a simpler response, and the thickness nobody knows."""
    residual, lean = free_response(pixels, slopes), lean_of(shape, angle)
    errors = standard_errors(residual, shape, pixels.parts())
    by_before = lean_of(replace(shape, before=shape.before + errors[2]), angle) - lean
    by_behind = lean_of(replace(shape, behind=shape.behind + errors[3]), angle) - lean
    by_light = lean_of(_solved(free_response(pixels, slopes, SIMPLE), shape), angle) - lean
    return hypot(by_before, by_behind, by_light, (lean_of(shape, angle, 1.0) - lean_of(shape, angle, 0.0)) / 12**0.5)


def _clipped(
    foot: tuple[float, float], turn: float, ends: tuple[float, float], image_shape: tuple[int, ...]
) -> tuple[float, float]:
    """Return the ends of a line through a foot, px along it, as far as it is in the image."""
    low, high = ends
    for start, step, size in ((foot[0], cos(turn), image_shape[1]), (foot[1], sin(turn), image_shape[0])):
        if abs(step) > 1e-9:
            first, last = sorted((-start / step, (size - 1 - start) / step))
            low, high = max(low, first), min(high, last)
    return low, max(low, high)


def _judged(shape: EdgeShape, pixels: PixelSample, slopes: Slopes) -> tuple[float, float]:
    """Share of what changed that the pattern explains, and its root mean square on the faces, grey levels."""
    pattern = columns(pixels, shape, slopes)
    changed = without(pattern[:, :3], pixels.colour)
    left = without(pattern, pixels.colour)
    _, across = shape.along_across(pixels.x, pixels.y)
    faces = (-shape.before < across) & (across < shape.behind)
    quality = 1 - (left**2).sum() / max((changed**2).sum(), 1e-12)
    return float(quality), float(np.sqrt(((changed - left)[faces] ** 2).mean())) if faces.any() else 0.0


def _check(contact: PrismContact) -> None:
    """Refuse what is no prism, or one whose faces say little; InputError."""
    if contact.contrast_grey < LEAST_GREY:
        raise InputError(
            f"no press: the strongest pattern of a prism changes the colours by {contact.contrast_grey:.1f} grey "
            f"levels, at least {LEAST_GREY:g} are needed: press the prism into the gel"
        )
    if contact.quality < LEAST_QUALITY or contact.length_px < _LEAST_LONG * contact.face_px:
        raise InputError(
            f"no prism: its pattern explains {100 * contact.quality:.0f} % of what changed, at least "
            f"{100 * LEAST_QUALITY:.0f} % are needed, along {contact.length_px:.0f} px of edge: press one straight edge"
        )
    most = most_lean_deg(degrees(contact.angle_rad))
    if abs(contact.lean_deg) > most or abs(contact.rise_deg) > MOST_RISE_DEG:
        raise InputError(
            f"no upright prism: it leans by {abs(contact.lean_deg):.1f} +- {contact.lean_error_deg:.1f} degrees to one "
            f"side (at most {most:g}) and its edge rises by {abs(contact.rise_deg):.1f} (at most "
            f"{MOST_RISE_DEG:g}): press one prism, upright"
        )
    if contact.face_px < max(LEAST_FACE_PX, contact.rounding_px / _SHARPEST):
        raise InputError(
            f"the press is too shallow: the gel lies on {max(contact.face_px, 0):.1f} px of a face, and the edge is "
            f"rounded by {contact.rounding_px:.1f} px: press deeper, or a sharper edge"
        )
