"""What a bundle can say of its frames beyond their maps, computed when somebody asks."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.measures import Confidence, ErrorBounds, Force
from gellight.reconstruction.confidence import confidence_of, steepest_of
from gellight.reconstruction.error_bounds import read_errors
from gellight.reconstruction.force_file import read_force
from gellight.reconstruction.lens.lens_file import has_lens, read_undistortion

PRESSES = "presses.npz"
SLOPES = slice(5, 7)
"""columns of the rows of that table"""


class BundleMeasures:
    """The measures of the frames of one sensor."""

    def __init__(self, bundle: Bundle, *, from_network: bool = True) -> None:
        """Take what the bundle knows; BundleError for a damaged file.

        from_network: the slopes are those of the network.
        """
        record = read_force(bundle)
        self._bundle, self.from_network = bundle, from_network
        self._scale = record.scale if record else None
        self._errors = read_errors(bundle) if from_network else None

    def force(self, depth_mm: NDArray[np.float32]) -> Force | None:
        """Return the force that makes a (H, W) depth map; None where the bundle has no `force.json`."""
        return self._scale.force(depth_mm, self._bundle.pixel_size_mm) if self._scale else None

    def confidence(self, image: NDArray[np.uint8], gradient_map: NDArray[np.float32]) -> Confidence:
        """Judge the pixels of a frame; with a lens, the pixels of the undistorted gel."""
        reference = self._bundle.reference
        if has_lens(self._bundle):
            lens = read_undistortion(self._bundle)
            image, reference = lens.picture(image), lens.picture(reference)
        return confidence_of(image, reference, gradient_map, self._steepest)

    def error_bounds(
        self, gradient_map: NDArray[np.float32], depth_mm: NDArray[np.float32], touched: NDArray[np.bool_]
    ) -> ErrorBounds | None:
        """Return the errors of a frame by its maps; None for measured slopes, or where the bundle has no errors."""
        return self._errors.bounds(gradient_map, depth_mm, touched) if self._errors else None

    @cached_property
    def _steepest(self) -> float | None:
        """The steepest slope that the network was trained on; None for measured slopes, or where no bundle says."""
        if not self.from_network or PRESSES not in self._bundle.files:
            return None
        return steepest_of(self._bundle.presses()["rows"][:, SLOPES])
