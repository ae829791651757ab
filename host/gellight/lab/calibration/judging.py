"""What fresh presses are held against: the ball, the picture that was taken, and a simulator's truth."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.calibration.records import CheckErrors
from gellight.lab.training.polynomial import powers_up_to, ridge, terms_of
from gellight.lab.training.presses import Ball, Press, contact_circle
from gellight.lab.training.validation import press_error
from gellight.reconstruction.errors import surface_errors
from gellight.reconstruction.force import Layer
from gellight.reconstruction.lens.undistortion import circle_on_gel, has_lens, lens_of, read_record

Floats = NDArray[np.float32]
_LARGEST_TABLE = 60_000
_POWERS = powers_up_to(4, 4)
_RIDGE = 1e-6


class Rerenderer:
    """Predicts the picture from the slopes that were felt: a check that needs no truth, on any sensor.

    A polynomial maps slopes and place to colour changes, the opposite way of the network; it is fitted to the same
    table. Where the slopes felt are wrong, the predicted picture differs from the one that was taken.
    """

    def __init__(self, rows: Floats, image_shape: tuple[int, int]) -> None:
        """Fit to the (N, 7) table of a calibration."""
        self._shape = image_shape
        chosen = rows[:: max(1, len(rows) // _LARGEST_TABLE)].astype(np.float64)
        self._amounts = ridge(self._features(chosen[:, 5:7], chosen[:, 3:5]), chosen[:, :3], _RIDGE)

    def difference(self, gradient_map: Floats, where: NDArray[np.bool_]) -> Floats:
        """(N, 3) predicted difference, grey levels, at the pixels of a (H, W, 2) gradient map that a mask chooses."""
        features = self._features(gradient_map[where].astype(np.float64), np.argwhere(where)[:, ::-1])
        return np.asarray(features @ self._amounts, np.float32)

    def _features(self, slopes: NDArray[np.float64], places_px: NDArray[np.number]) -> NDArray[np.float64]:
        height, width = self._shape
        return terms_of([*slopes.T, *(2 * places_px / (width, height) - 1).T], _POWERS)


@dataclass(frozen=True)
class Judge:
    """What every fresh press is held against."""

    draft: Bundle
    reconstructor: Reconstructor
    rerenderer: Rerenderer
    ball: Ball
    layer: Layer | None
    """the soft gel, where known"""

    def errors(self, frame: CameraFrame, press: Press) -> tuple[TactileFrame, CheckErrors]:
        """Return what is felt of a press of the ball, and its errors."""
        felt = self.reconstructor.reconstruct(frame)
        seen = felt if not has_lens(self.draft) else Reconstructor(self.draft, undistorted=False).reconstruct(frame)
        error = press_error(self.on_gel(press), self.ball, felt, self.layer)
        inside = contact_circle(press, self.draft.image_shape)
        # slopes felt wrong inside would make another picture
        predicted = self.rerenderer.difference(seen.gradient_map, inside)
        true = surface_errors(felt, frame.truth) if frame.truth else None
        return felt, CheckErrors(
            depth_mm=error.depth_mae_mm,
            normal_deg=error.mean_deg,
            indentation_mm=felt.contact.indentation_mm,
            felt_over_expected=error.indentation.share if error.indentation else None,
            picture_grey=float(np.abs(predicted - seen.difference[inside]).mean()),
            true_depth_mm=true.contact_depth_mm if true else None,
            true_normal_deg=true.normal_deg if true else None,
            true_contact_normal_deg=true.contact_normal_deg if true else None,
        )

    def on_gel(self, press: Press) -> Press:
        """Return the circle of a press over the undistorted gel: the same where the bundle knows no lens."""
        if not has_lens(self.draft):
            return press
        seen = press.center_x_px, press.center_y_px, press.contact_radius_px
        x, y, radius = circle_on_gel(lens_of(read_record(self.draft)), self.draft.pixel_size_mm, seen)
        return replace(press, center_x_px=x, center_y_px=y, contact_radius_px=radius)
