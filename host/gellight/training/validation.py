"""The error of a calibration bundle on labelled ball presses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.integration import angle_deg, integrate, normals
from gellight.reconstruction.light_drift import light_drift
from gellight.reconstruction.pipeline import Reconstructor
from gellight.reconstruction.smoothing import Smoother
from gellight.training.baselines import Baseline
from gellight.training.presses import Ball, Press, cap_depth_mm, contact_circle, sphere_gradient

Floats = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class PressError:
    """What was felt of one press, against its label."""

    image: str
    angle_deg: Floats
    """(N,) angle between the felt and the true normal at each pixel inside the labelled circle"""
    depth_mae_mm: float
    """mean absolute depth error there, with its mean removed: a circle does not say how deep its own rim lies"""
    contact_iou: float
    """overlap of the contact patch found with the circle: intersection over union"""

    @property
    def mean_deg(self) -> float:
        """Mean angle."""
        return float(self.angle_deg.mean())


def evaluate(bundle: Bundle, presses: Sequence[Press], ball: Ball) -> dict[str, Any]:
    """Measure a calibration on labelled presses, as labelled, with the very frame path that the sensor runs.

    Returns normal_error_deg {mean, median, p95} over all pixels inside the circles, depth_mae_mm, contact_iou, and
    images, a list of {image, pixels, normal_error_deg, depth_mae_mm, contact_iou}. Raises InputError for images of
    another size.
    """
    return summarised(press_errors(bundle, presses, ball))


def press_errors(bundle: Bundle, presses: Sequence[Press], ball: Ball) -> list[PressError]:
    """Reconstruct each press and compare it with its label."""
    if not presses:
        raise InputError("there are no presses to evaluate: give at least one")
    # Without the mask: a pixel of the contact circle counts whether or not its colour changed. Over the picture, as the
    # circles are drawn: with a lens, labels and slopes are distorted alike.
    reconstructor = Reconstructor(bundle, masked=False, undistorted=False)
    return [_press_error(reconstructor, press, ball, number) for number, press in enumerate(presses)]


def _press_error(reconstructor: Reconstructor, press: Press, ball: Ball, number: int) -> PressError:
    image = read_image(press.image)
    felt = reconstructor.reconstruct(
        CameraFrame(image=image, time_s=0.0, sequence=number, source=str(press.image)),
    )
    return press_error(press, ball, Felt(normal_map=felt.normal_map, depth_mm=felt.depth_mm, contact=felt.contact.mask))


@dataclass(frozen=True, kw_only=True)
class Felt:
    """What is felt of one image, whatever its label says."""

    normal_map: Floats
    """(H, W, 3)"""
    depth_mm: NDArray[np.floating]
    """(H, W)"""
    contact: NDArray[np.bool_]
    """(H, W)"""


def felt_by(
    baseline: Baseline, presses: Sequence[Press], reference: Floats, ball: Ball, *, follow_light: bool
) -> list[Felt]:
    """Reconstruct each press with the slopes of a baseline: drift, smoothing, depth, contact as in the frame path."""
    felt, smoother = [], Smoother()
    for press in presses:
        difference = read_image(press.image).astype(np.float32) - reference
        if follow_light:
            difference -= light_drift(difference)
        slopes, noise = smoother.narrow(baseline.gradient_map(difference))
        depth_mm = integrate(slopes, ball.pixel_size_mm)
        gradient_map = smoother.of_surface(depth_mm, ball.pixel_size_mm, slopes, noise)
        contact = find_contact(depth_mm, ball.pixel_size_mm)
        felt.append(Felt(normal_map=normals(gradient_map), depth_mm=depth_mm, contact=contact.mask))
    return felt


def baseline_errors(
    baseline: Baseline, presses: Sequence[Press], reference: Floats, ball: Ball, *, follow_light: bool
) -> list[PressError]:
    """Do as `press_errors` with the slopes of a baseline."""
    felt = felt_by(baseline, presses, reference, ball, follow_light=follow_light)
    return [press_error(press, ball, answer) for press, answer in zip(presses, felt, strict=True)]


def press_error(press: Press, ball: Ball, felt: Felt) -> PressError:
    """Compare normals, depth and contact patch with a label."""
    shape = (felt.depth_mm.shape[0], felt.depth_mm.shape[1])
    inside = contact_circle(press, shape)
    true_normals = normals(sphere_gradient(press, ball, shape))
    depth_error = felt.depth_mm[inside] - cap_depth_mm(press, ball, shape)[inside]
    return PressError(
        image=press.image.name,
        angle_deg=angle_deg(felt.normal_map[inside], true_normals[inside]),
        depth_mae_mm=float(np.abs(depth_error - depth_error.mean()).mean()),
        contact_iou=float((felt.contact & inside).sum() / (felt.contact | inside).sum()),
    )


def summarised(errors: Sequence[PressError]) -> dict[str, Any]:
    """Sum up: every pixel counts the same."""
    pixels = [len(error.angle_deg) for error in errors]
    return {
        "normal_error_deg": _figures(np.concatenate([error.angle_deg for error in errors])),
        "depth_mae_mm": float(np.average([error.depth_mae_mm for error in errors], weights=pixels)),
        "contact_iou": float(np.mean([error.contact_iou for error in errors])),
        "images": [
            {
                "image": error.image,
                "pixels": len(error.angle_deg),
                "normal_error_deg": _figures(error.angle_deg),
                "depth_mae_mm": error.depth_mae_mm,
                "contact_iou": error.contact_iou,
            }
            for error in errors
        ],
    }


def _figures(angle: Floats) -> dict[str, float]:
    median, p95 = np.percentile(angle, [50, 95])
    return {"mean": float(angle.mean()), "median": float(median), "p95": float(p95)}
