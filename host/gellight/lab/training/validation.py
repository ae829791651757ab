"""The error of a calibration bundle on labelled ball presses, and the ball that it feels in them.

The colours of a press alone do not give the radius R of the ball. In the contact sin(slope) = distance / R, so another
R is the same pattern under a stronger or weaker response of the light, which is what is being calibrated. An earlier
calibration knows the response: the slope that it measures at a known distance gives R.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.training.indentation import Indentation, indentation_of
from gellight.lab.training.presses import (
    Ball,
    Press,
    cap_depth_mm,
    contact_circle,
    distance_px,
    sphere_gradient,
)
from gellight.reconstruction.force import Layer
from gellight.reconstruction.integration import angle_deg, normals

Floats = NDArray[np.float32]
_OWN = 2.0
"""in contact radii: how far a contact patch that is compared with the circle may reach"""
ALIKE = 0.15
"""by which felt and expected indentations may differ: a circle 3 % wrong makes 6 %, a gel 10 % thinner 4 %"""
_INNER, _OUTER = 0.3, 0.85
"""in contact radii: where slopes are steep enough to measure, and clear of the rim"""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressError:
    """The tactile frame of one press against its label."""

    image: str
    angle_deg: Floats
    """(N,) angle between the measured and the true normal at each pixel inside the labelled circle"""
    not_learnt: NDArray[np.bool_]
    """(N,) whether the calibration never saw the place or the colour of the pixel, see `Confidence.not_learnt`"""
    bound_deg: Floats
    """(N,) what the frame says that they are off by at most, see `ErrorBounds`; inf where nobody knows"""
    depth_mae_mm: float
    """mean absolute depth error there, with its mean removed: a circle does not say how deep its own rim lies"""
    contact_iou: float
    """overlap of the contact patch found with the circle: intersection over union"""
    indentation: "Indentation | None"
    """None where nobody knows how thick the gel is"""

    @property
    def mean_deg(self) -> float:
        """Mean angle."""
        return float(self.angle_deg.mean())


@dataclass(frozen=True, kw_only=True)
class AngleFigures:
    """How angles are spread over pixels, deg."""

    mean: float
    median: float
    p95: float

    @classmethod
    def of(cls, angle_deg: Floats) -> Self:
        """Take the figures of (N,) angles."""
        median, p95 = np.percentile(angle_deg, [50, 95])
        return cls(mean=float(angle_deg.mean()), median=float(median), p95=float(p95))


@dataclass(frozen=True, kw_only=True)
class IndentationFigures:
    """Felt over expected indentations of several presses."""

    felt_over_expected: float
    """their median"""
    alike: float
    """share of the presses whose own lies within `ALIKE`"""

    @classmethod
    def of(cls, found: Sequence[Indentation | None]) -> Self | None:
        """Take the figures; None where nobody knows how thick the gel is."""
        shares = [one.share for one in found if one]
        if not shares:
            return None
        alike = np.mean([abs(share - 1) <= ALIKE for share in shares])
        return cls(felt_over_expected=float(np.median(shares)), alike=float(alike))

    def lines(self) -> list[str]:
        """Return them for people, with a warning where the median is beyond `ALIKE`."""
        found = (
            f"indentations are felt {self.felt_over_expected:.2f} times as deep as contact mechanics expect of the "
            f"circles; {self.alike:.0%} of the presses within {ALIKE:.0%}"
        )
        if abs(self.felt_over_expected - 1) <= ALIKE:
            return [found]
        return [
            f"WARNING: {found}: check gel_thickness_mm, the ball and the size of a pixel, and that nothing touched the "
            "gel of the reference; if they are right, slopes beside the contact are felt wrongly"
        ]


@dataclass(frozen=True, kw_only=True)
class _Figures:
    normal_error_deg: AngleFigures
    """over the pixels inside the circles"""
    depth_mae_mm: float
    contact_iou: float


@dataclass(frozen=True, kw_only=True)
class ImageFigures(_Figures):
    """The errors on one image."""

    image: str
    pixels: int
    indentation: Indentation | None


@dataclass(frozen=True, kw_only=True)
class PressFigures(_Figures):
    """The errors on several presses: every pixel counts the same, and for the contact patch every image."""

    images: tuple[ImageFigures, ...]
    not_learnt: float
    """share of the pixels whose place or colour the calibration never saw"""
    not_learnt_deg: float | None
    """mean error of their normals; None where there are none"""
    bounded: float
    """share of the pixels whose frame tells how far they are off at most"""
    within_bounds: float | None
    """share of these that are; None where no frame tells"""
    indentation: IndentationFigures | None

    def as_json(self) -> dict[str, object]:
        """Return the figures by name."""
        return asdict(self)


def evaluate(bundle: Bundle, presses: Sequence[Press], ball: Ball, layer: Layer | None = None) -> PressFigures:
    """Measure a calibration on labelled presses with the frame path that the sensor runs.

    layer: the gel, where known. Raises InputError for images of another size.
    """
    return summarised(press_errors(bundle, presses, ball, layer))


def press_errors(bundle: Bundle, presses: Sequence[Press], ball: Ball, layer: Layer | None = None) -> list[PressError]:
    """Reconstruct each press and compare it with its label."""
    if not presses:
        raise InputError("there are no presses to evaluate: give at least one")
    # Without the mask: a pixel of the contact circle counts whether or not its colour changed. Over the picture, as the
    # circles are drawn: with a lens, labels and slopes are distorted alike.
    reconstructor = Reconstructor(bundle, masked=False, undistorted=False)
    found: list[PressError] = []
    for _, one_image in groupby(presses, key=lambda press: press.image):
        labelled = list(one_image)
        frame = reconstructor.reconstruct(frame_of(labelled[0]))
        found += [press_error(press, ball, frame, layer) for press in labelled]
    return found


def frame_of(press: Press) -> CameraFrame:
    """Return the image of a press as a camera frame."""
    return CameraFrame(image=press.picture(), time_s=0.0, sequence=0, source=str(press.image))


def press_error(press: Press, ball: Ball, frame: TactileFrame, layer: Layer | None = None) -> PressError:
    """Compare normals, depth and contact patch with a label, and the indentation with what the layer makes of it."""
    shape = (frame.depth_mm.shape[0], frame.depth_mm.shape[1])
    inside = contact_circle(press, shape)
    # Other balls in the same picture are not of this press.
    patch = frame.contact.mask & (distance_px(press, shape) < _OWN * press.contact_radius_px)
    pixels = np.flatnonzero(inside)
    true_normals = normals(sphere_gradient(press, ball, shape, pixels)[np.newaxis])[0]
    never_seen = frame.confidence.not_learnt if frame.confidence else np.zeros(shape, np.bool_)
    bound_deg = frame.error_bounds.normal_deg if frame.error_bounds else np.full(shape, np.inf, np.float32)
    depth_error = frame.depth_mm[inside] - cap_depth_mm(press, ball, shape, pixels)
    return PressError(
        image=press.image.name,
        angle_deg=angle_deg(frame.normal_map[inside], true_normals),
        not_learnt=never_seen[inside],
        bound_deg=bound_deg[inside],
        depth_mae_mm=float(np.abs(depth_error - depth_error.mean()).mean()),
        contact_iou=float((patch & inside).sum() / (patch | inside).sum()),
        indentation=indentation_of(press, ball, frame.depth_mm, layer) if layer else None,
    )


def summarised(errors: Sequence[PressError]) -> PressFigures:
    """Sum up the errors of several presses."""
    images = tuple(
        ImageFigures(
            image=error.image,
            pixels=len(error.angle_deg),
            normal_error_deg=AngleFigures.of(error.angle_deg),
            depth_mae_mm=error.depth_mae_mm,
            contact_iou=error.contact_iou,
            indentation=error.indentation,
        )
        for error in errors
    )
    pixels = [image.pixels for image in images]
    names = ("angle_deg", "not_learnt", "bound_deg")
    angles, never_seen, bounds = (np.concatenate([getattr(error, name) for error in errors]) for name in names)
    known = np.isfinite(bounds)
    return PressFigures(
        normal_error_deg=AngleFigures.of(angles),
        not_learnt=float(never_seen.mean()),
        not_learnt_deg=float(angles[never_seen].mean()) if never_seen.any() else None,
        bounded=float(known.mean()),
        within_bounds=float((angles <= bounds)[known].mean()) if known.any() else None,
        depth_mae_mm=float(np.average([image.depth_mae_mm for image in images], weights=pixels)),
        contact_iou=float(np.mean([image.contact_iou for image in images])),
        indentation=IndentationFigures.of([image.indentation for image in images]),
        images=images,
    )


class FeltBall(NamedTuple):
    """The ball by the slopes inside labelled circles."""

    radius_mm: float
    """that fits them best: median over the presses"""
    without: tuple[str, ...]
    """images in whose circle no ball is felt"""


def felt_ball(bundle: Bundle, presses: Sequence[Press]) -> FeltBall:
    """Return the ball that a bundle feels.

    Needs square pixels. Raises InputError where no press shows a ball, or for images of another size.
    """
    path, found, without = Reconstructor(bundle, masked=False, undistorted=False), [], []
    for press in presses:
        radius = radius_by_slopes_px(path.reconstruct(frame_of(press)).normal_map, press, _INNER, _OUTER)
        if 0 < radius < np.inf:
            found.append(radius)
        else:
            without.append(press.image.name)
    if not found:
        raise InputError("no ball is felt inside any circle: check the circles and the calibration")
    return FeltBall(float(np.median(found)) * bundle.pixel_size_mm[0], tuple(without))


def radius_by_slopes_px(normal_map: Floats, press: Press, inner: float, outer: float) -> float:
    """Return R by least squares of sin(slope) = distance / R between two shares of the contact radius, px.

    Slopes of the (H, W, 3) normals count along the radius only: where the gel rises the normal leans outwards.
    """
    distance = distance_px(press, (normal_map.shape[0], normal_map.shape[1])) / press.contact_radius_px
    rows, columns = np.nonzero((distance >= inner) & (distance < outer))
    normal = normal_map[rows, columns].astype(np.float64)
    x, y = columns - press.center_x_px, rows - press.center_y_px
    with np.errstate(divide="ignore"):
        return float((x * x + y * y).sum() / (normal[:, 0] * x + normal[:, 1] * y).sum())
