"""What a change of the light costs, in degrees and millimetres, before anybody presses anything.

Two parts, both asked of the bundle itself:

Zero. The changed picture of the untouched gel goes through the frame path: what it feels there is what the sensor
reports where nothing touches. Setting the zero anew removes it.

Gain. A colour that is dimmed to a share q shows a slope q times as strongly as the network has learned. To first order
the network answers g = J d to a difference d of the three colours, J (2, 3) its derivative at the untouched gel; the
difference that it takes for the slope g is d = J+ g (least squares), the one that it gets now is diag(q) d, and so it
answers J diag(q) J+ g. That is compared with g for slopes of `SLOPE` in all directions at places all over the view. It
stays until the sensor is calibrated again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.cast_shadows import CastShadows
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.lens.undistortion import read_undistortion
from gellight.reconstruction.numpy_path import NumpyPath
from gellight.reconstruction.smoothing import NARROWEST_PX
from gellight.watch.cells import Cells, cell_means, spread

Array = NDArray[np.float64]

SLOPE = 0.5
"""as steep as the flank of a ball pressed to a quarter of its radius, on average"""
PRESS_MM = 1.0
"""depth errors of the gain are those of a press that deep"""
_DIRECTIONS = 12  # chosen: of slope, 30 degrees apart
_STEP_GREY = 8.0
"""of the derivative: larger than the noise, smaller than a touch"""
_EVERY_PX = 32  # chosen: 300 places of 640 x 480: light changes slowly over the view


@dataclass(frozen=True, kw_only=True)
class ExpectedError:
    """Errors on top of those that the bundle has anyway; means over the view, unless said otherwise."""

    zero_deg: float
    """of the normals where nothing touches, until the zero is set anew"""
    zero_mm: float
    """of the depth where nothing touches, until the zero is set anew"""
    zero_most_mm: float
    """the same at the worst pixel: as deep a touch is shown while nothing touches"""
    gain_deg: float
    """of the normals in contact, until the sensor is calibrated again"""
    gain_mm: float
    """of the depth of a press of 1 mm, until the sensor is calibrated again"""

    def as_json(self) -> dict[str, float]:
        """Return the figures, rounded for people."""
        return {name: round(value, 4) for name, value in vars(self).items()}


class ErrorEstimate:
    """The frame path and the network of a bundle, asked what a change costs."""

    def __init__(self, bundle: Bundle) -> None:
        """Load the network and take its derivative; a fraction of a second. Raises BundleError."""
        self._bundle, self._network = bundle, GradientNetwork.of_bundle(bundle)
        parts = self._network, read_undistortion(bundle), CastShadows.of_bundle(bundle, self._network)
        self._path = NumpyPath(bundle, *parts, smoothing_px=NARROWEST_PX, masked=True)
        self._places = np.zeros(bundle.image_shape, np.bool_)
        self._places[_EVERY_PX // 2 :: _EVERY_PX, _EVERY_PX // 2 :: _EVERY_PX] = True
        steps = _STEP_GREY * np.eye(3, dtype=np.float32)
        self._derivative = np.stack([self._slopes(step) - self._slopes(-step) for step in steps], axis=2)
        self._derivative /= 2 * _STEP_GREY

    def _slopes(self, grey: NDArray[np.float32]) -> Array:
        """(n, 2) answer to the same difference everywhere, at the places."""
        difference = np.tile(grey, (*self._places.shape, 1))
        return self._network.gradient_map(difference, self._places)[self._places].astype(np.float64)

    def of(self, change: Cells, reference: Cells, zeroed: Cells) -> ExpectedError:
        """Return what a (h, w, 3) change of the light from `reference` costs, of which `zeroed` is in the zero."""
        zero_deg, zero_mm, zero_most_mm = self._zero(change - zeroed)
        gain_deg, gain_mm = self._gain(change, reference)
        return ExpectedError(
            zero_deg=zero_deg, zero_mm=zero_mm, zero_most_mm=zero_most_mm, gain_deg=gain_deg, gain_mm=gain_mm
        )

    def _zero(self, change: Cells) -> tuple[float, float, float]:
        bundle = self._bundle
        changed = np.clip(np.rint(bundle.reference + spread(change, bundle.image_shape)), 0, 255).astype(np.uint8)
        felt = self._path.reconstruct(CameraFrame(image=changed, time_s=0.0, sequence=0))
        slopes = cell_means(felt.gradient_map)  # the change has one value a cell, and rounding it is no error
        angle = np.degrees(np.arctan(np.hypot(slopes[..., 0], slopes[..., 1])))
        error_mm = np.abs(felt.depth_mm)
        return float(angle.mean()), float(error_mm.mean()), float(error_mm.max())

    def _gain(self, change: Cells, reference: Cells) -> tuple[float, float]:
        share = (1 + change / np.maximum(reference, 1.0)).astype(np.float32)
        at_places = spread(share, self._places.shape)[self._places]
        around = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
        true = SLOPE * np.stack([np.cos(around), np.sin(around)])
        felt = self._derivative @ (np.linalg.pinv(self._derivative) @ true * at_places[:, :, None])
        cosine = (1 + (felt * true).sum(axis=1)) / np.sqrt((1 + (felt**2).sum(axis=1)) * (1 + SLOPE**2))
        scale = (felt * true).sum(axis=(1, 2)) / (true**2).sum()
        angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        return float(angle.mean()), float(PRESS_MM * np.abs(scale - 1).mean())
