"""What a bundle can say of its frames beyond their maps, computed when somebody asks."""

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.measures import Force
from gellight.reconstruction.force_file import read_force


class BundleMeasures:
    """The measures of the frames of one sensor."""

    def __init__(self, bundle: Bundle) -> None:
        """Take what the bundle knows; BundleError for a damaged file."""
        record = read_force(bundle)
        self._scale = record.scale if record else None
        self._pixel_size_mm = bundle.pixel_size_mm

    def force(self, depth_mm: NDArray[np.float32]) -> Force | None:
        """Return the force that makes a (H, W) depth map; None where the bundle has no `force.json`."""
        return self._scale.force(depth_mm, self._pixel_size_mm) if self._scale else None
