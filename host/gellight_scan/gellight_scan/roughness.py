"""Roughness of a map of heights: Sa, Sq, Sz of an area (ISO 25178-2), Ra, Rq, Rz along a line (ISO 21920-2).

First the form is taken off, then the waviness: what the Gaussian filter with the chosen cutoff lets through.

How far a figure is to be believed has three parts. Errors of the heights, of root mean square e, change Sa, Sq, Ra and
Rq by at most e (Minkowski's inequality), Sz and Rz by what the extremes of such errors make. The coating's blur takes a
share of the waves. Which, the waves say that were found: their mean length is 2 pi Sq / Sdq, with Sdq the root mean
square of the slope; of finer waves, which the blur took whole, nothing is known. Nothing is corrected for it.

There is no figure but a refusal where the blur takes more than `LARGEST_SHARE` of the waves, where they have fewer than
`LEAST_PIXELS` pixels, where the errors are larger than the roughness, and where the gel did not reach the valleys.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import asin, hypot, log, pi, sqrt

import numpy as np
from scipy import ndimage

from gellight.base.errors import InputError
from gellight_scan.filtering import (
    SIGMA_SHARE,
    Array,
    beyond_run_in,
    finest_mm,
    transmission,
    waviness,
    without_form,
)
from gellight_scan.height_map import HeightMap

COATING_BLUR_MM = 0.1
"""standard deviation, where nobody told: ours, as no data sheet gives one"""
LARGEST_SHARE = 0.3
"""of the waves that the blur may take"""
LEAST_PIXELS = 5
"""to a wave"""
LEAST_REACHED = 0.95
"""of the evaluated part that the gel must have reached: what it did not are valleys, and they would be left out"""
SECTIONS = 5
"""of the length of the cutoff that a profile has where it is long enough"""
CUTOFFS_MM = {0.04: 0.08, 0.13: 0.25, 0.4: 0.8, 1.3: 2.5, 4.0: 8.0}
"""by the largest mean length of the waves: ISO 4288, table 3, and ISO 21920-3"""
FLAT = 1e-9
"""mm: heights that vary less do not vary"""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What is measured how."""

    blur_mm: float
    """standard deviation of the coating's blur"""
    cutoff_mm: float | None = None
    """of the filter that takes the waviness off; None: by `CUTOFFS_MM`"""
    form: str = "curved"
    """that is taken off before: none, plane or curved"""

    def __post_init__(self) -> None:
        """Refuse lengths that are none."""
        if not (np.isfinite(self.blur_mm) and self.blur_mm >= 0):
            raise InputError(f"a blur of {self.blur_mm} mm is none: give its standard deviation, 0 or more")
        if self.cutoff_mm is not None and not (np.isfinite(self.cutoff_mm) and self.cutoff_mm > 0):
            raise InputError(f"a cutoff of {self.cutoff_mm} mm is none: give a length, as 2.5 mm")


@dataclass(frozen=True, kw_only=True)
class Belief:
    """How far the figures of a roughness are to be believed."""

    error_mm: float
    """standard uncertainty of Sa, Sq, Ra and Rq by the errors of the heights"""
    extremes_error_mm: float
    """the same of Sz and Rz"""
    blur_share: float
    """of the waves that were found that the blur takes: the object's figures are larger, by 1 / (1 - share)"""
    wavelength_mm: float
    """mean length of the waves that were found"""
    cutoff_mm: float
    finest_mm: float
    """of waves of this length the blur leaves half: it acts as the standard's S-filter with this nesting index"""
    reached: float
    """share of the evaluated part that the gel reached"""


@dataclass(frozen=True, kw_only=True)
class AreaRoughness(Belief):
    """Roughness of an area."""

    sa_mm: float
    sq_mm: float
    sz_mm: float
    ssk: float
    sku: float
    area_mm2: float
    """that was evaluated"""


@dataclass(frozen=True, kw_only=True)
class ProfileRoughness(Belief):
    """Roughness along a line."""

    ra_mm: float
    rq_mm: float
    rz_mm: float
    sections: int
    """of one cutoff each that were evaluated; the standard wants five, and Rz is the mean of theirs"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Texture:
    """Roughness of the evaluated part."""

    heights: Array
    """(N,) mm, in their order along a line"""
    wave_number: float
    """rad/mm, root mean square"""
    errors_mm: Array
    """(N,)"""
    reached: float
    sections: int
    pixel_mm: float

    @property
    def from_mean(self) -> Array:
        """(N,) mm."""
        return np.asarray(self.heights - self.heights.mean())

    @property
    def rms_mm(self) -> float:
        """Root mean square of the heights."""
        return float(self.heights.std())

    @property
    def wavelength_mm(self) -> float:
        """Mean length of the waves."""
        return 2 * pi / max(self.wave_number, FLAT)


def area_roughness(surface: HeightMap, how: Evaluation) -> AreaRoughness:
    """Measure the roughness of all that is known of a surface.

    Raises InputError for what cannot be told, with the reason and what to do.
    """
    height = without_form(_known(surface), how.form)
    texture, cutoff_mm = _filtered(lambda cutoff: _area(surface, height, cutoff), how, surface.pixel_mm)
    z, belief = texture.from_mean, _believed(texture, cutoff_mm, how)
    return AreaRoughness(
        **asdict(belief),
        sa_mm=float(np.abs(z).mean()),
        sq_mm=texture.rms_mm,
        sz_mm=float(np.ptp(z)),
        ssk=float((z**3).mean() / texture.rms_mm**3),
        sku=float((z**4).mean() / texture.rms_mm**4),
        area_mm2=z.size * surface.pixel_mm**2,
    )


def profile_roughness(
    surface: HeightMap, start_mm: tuple[float, float], end_mm: tuple[float, float], how: Evaluation
) -> ProfileRoughness:
    """Measure the roughness along a line between two points, (x, y) mm from the middle of the map.

    Raises InputError for a line that leaves the map, and for what cannot be told.
    """
    *lines, errors = _lines(surface, start_mm, end_mm)
    known = np.flatnonzero(np.isfinite(lines[1]))
    if known.size < LEAST_PIXELS:
        raise InputError("the gel did not reach the surface along this line: draw it where heights are known")
    part = slice(known[0], known[-1] + 1)
    flat = [without_form(line[part], how.form) for line in lines]
    texture, cutoff_mm = _filtered(
        lambda cutoff: _profile(flat, errors[part], surface.pixel_mm, cutoff), how, surface.pixel_mm
    )
    z, belief = texture.from_mean, _believed(texture, cutoff_mm, how)
    return ProfileRoughness(
        **asdict(belief),
        ra_mm=float(np.abs(z).mean()),
        rq_mm=texture.rms_mm,
        rz_mm=float(np.mean([np.ptp(section) for section in np.array_split(z, texture.sections)])),
        sections=texture.sections,
    )


def _known(surface: HeightMap) -> Array:
    """(H, W) mm of a map that holds some height."""
    if np.count_nonzero(surface.reached) < LEAST_PIXELS**2:
        raise InputError("the map holds no heights: the gel reached nothing; press or scan the surface again")
    return surface.height_mm.astype(np.float64)


def _filtered(measured: Callable[[float], _Texture], how: Evaluation, pixel_mm: float) -> tuple[_Texture, float]:
    """Return the roughness by the wanted cutoff, or by the first of `CUTOFFS_MM` that its waves ask for; and it."""
    finest = max(finest_mm(how.blur_mm, LARGEST_SHARE), LEAST_PIXELS * pixel_mm)
    if how.cutoff_mm is not None:
        if how.cutoff_mm <= finest:
            raise InputError(
                f"a cutoff of {how.cutoff_mm:g} mm leaves waves that this sensor does not feel, by its blur of "
                f"{how.blur_mm:g} mm and pixels of {pixel_mm:.3g} mm: give more than {finest:.2f} mm"
            )
        return measured(how.cutoff_mm), how.cutoff_mm
    for longest, cutoff in CUTOFFS_MM.items():
        if longest > finest:
            texture = measured(cutoff)
            if texture.wavelength_mm <= longest:
                return texture, cutoff
    raise InputError(
        f"the waves are longer than {max(CUTOFFS_MM):g} mm, which is waviness or form by the standard: choose a cutoff"
    )


def _too_long(cutoff_mm: float) -> InputError:
    return InputError(
        f"a cutoff of {cutoff_mm:g} mm is too long for this surface: with its run-in it needs {2 * cutoff_mm:g} mm of "
        "known heights; scan more of it, or choose a shorter cutoff"
    )


def _area(surface: HeightMap, height: Array, cutoff_mm: float) -> _Texture:
    pixel, cutoff_px = surface.pixel_mm, cutoff_mm / surface.pixel_mm
    inside = beyond_run_in(surface.reached, cutoff_px)
    if np.count_nonzero(inside) < cutoff_px**2:
        raise _too_long(cutoff_mm)
    rough = np.where(inside, height - waviness(height, cutoff_px), np.nan)
    evaluated = np.isfinite(rough)
    both = [_wave_number(np.diff(rough, axis=axis), rough, pixel) for axis in (0, 1)]
    return _Texture(
        heights=rough[evaluated],
        wave_number=hypot(*both),
        errors_mm=surface.error_mm[evaluated].astype(np.float64),
        reached=np.count_nonzero(evaluated) / np.count_nonzero(inside),
        sections=1,
        pixel_mm=pixel,
    )


def _wave_number(steps: Array, rough: Array, spacing_mm: float) -> float:
    """Return the wave number along one axis, rad/mm, by steps between heights: 2 sin(k spacing / 2) of a wave's."""
    share = float(np.sqrt(np.nanmean(steps**2))) / max(2 * float(np.nanstd(rough)), FLAT)
    return 2 * asin(min(share, 1.0)) / spacing_mm


def _profile(lines: Sequence[Array], errors: Array, pixel_mm: float, cutoff_mm: float) -> _Texture:
    """Evaluate the middle of three lines a pixel apart: the others tell the slope across."""
    cutoff_px = cutoff_mm / pixel_mm
    inside = np.flatnonzero(beyond_run_in(np.isfinite(lines[1]), cutoff_px))
    sections = min(SECTIONS, int(inside.size / cutoff_px))
    if sections < 1:
        raise _too_long(cutoff_mm)
    length = round(sections * cutoff_px)
    part = slice(inside[0] + (inside.size - length) // 2, inside[0] + (inside.size - length) // 2 + length)
    before, rough, after = ((line - waviness(line, cutoff_px))[part] for line in lines)
    evaluated = np.isfinite(rough)
    along, across = _wave_number(np.diff(rough), rough, pixel_mm), _wave_number(after - before, rough, 2 * pixel_mm)
    return _Texture(
        heights=rough[evaluated],
        wave_number=hypot(along, across),
        errors_mm=errors[part][evaluated],
        reached=float(evaluated.mean()),
        sections=sections,
        pixel_mm=pixel_mm,
    )


def _lines(surface: HeightMap, start_mm: tuple[float, float], end_mm: tuple[float, float]) -> list[Array]:
    """Return heights along the line and a pixel to both of its sides, the line in the middle; and its errors."""
    height, pixel = _known(surface), surface.pixel_mm
    (x0, y0), (x1, y1) = start_mm, end_mm
    length = hypot(x1 - x0, y1 - y0)
    half = [(size - 1) / 2 * pixel for size in height.shape[::-1]]
    if not all(abs(at) <= most for at, most in zip((x0, y0, x1, y1), half * 2, strict=True)) or length < pixel:
        raise InputError(
            f"a line from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) mm is none on this map: give two points within "
            f"{half[0]:.1f} mm of its middle in x and {half[1]:.1f} mm in y"
        )
    along = np.linspace(0, 1, round(length / pixel) + 1)
    middle = np.stack([y0 + along * (y1 - y0), x0 + along * (x1 - x0)]) / pixel + np.array(half[::-1])[:, None] / pixel
    across = np.array([x1 - x0, y0 - y1])[:, None] / length
    return [
        *(_sampled(height, middle + side * across) for side in (-1, 0, 1)),
        _sampled(surface.error_mm.astype(np.float64), middle),
    ]


def _sampled(values: Array, at: Array) -> Array:
    """Return (H, W) values at (2, N) rows and columns, by cubic splines; NaN beside what is known."""
    known = np.isfinite(values)
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = ndimage.map_coordinates(values[tuple(nearest)], at, order=3, mode="nearest")
    return np.where(ndimage.map_coordinates(known.astype(np.float64), at, order=1) > 1 - 1e-6, filled, np.nan)


def _believed(texture: _Texture, cutoff_mm: float, how: Evaluation) -> Belief:
    """Return how far a roughness is to be believed; raises InputError where it is not."""
    error = float(np.sqrt((texture.errors_mm**2).mean()))
    wavelength, rms = texture.wavelength_mm, texture.rms_mm
    if texture.reached < LEAST_REACHED:
        raise InputError(
            f"the gel reached {texture.reached:.0%} of what is evaluated, and valleys are missing: press harder, or "
            "measure another way where they are too deep"
        )
    if not rms > error:
        raise InputError(
            f"a roughness of {rms * 1e3:.2g} um rms was found, and the heights are off by {error * 1e3:.2g} um: the "
            "surface is too smooth, or too fine, for this sensor; measure it with a stylus or by light"
        )
    if wavelength < LEAST_PIXELS * texture.pixel_mm:
        raise InputError(
            f"the waves found are {wavelength:.2f} mm long, fewer than {LEAST_PIXELS} pixels of "
            f"{texture.pixel_mm:.3g} mm: scan with a camera that sees more finely"
        )
    share = 1 - transmission(wavelength, how.blur_mm)
    if share > LARGEST_SHARE:
        raise InputError(
            f"the waves found are {wavelength:.2f} mm long, and the coating's blur of {how.blur_mm:g} mm takes "
            f"{share:.0%} of them: no roughness is told of waves finer than "
            f"{finest_mm(how.blur_mm, LARGEST_SHARE):.2f} mm; take a gel with a thinner coating, or a stylus"
        )
    return Belief(
        error_mm=error,
        extremes_error_mm=2 * error * sqrt(2 * log(texture.heights.size)),
        blur_share=share,
        wavelength_mm=wavelength,
        cutoff_mm=cutoff_mm,
        finest_mm=how.blur_mm / SIGMA_SHARE,
        reached=texture.reached,
    )
