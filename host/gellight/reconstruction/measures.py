"""What a bundle can say of its frames beyond their maps, computed when somebody asks."""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle
from gellight.frames.measures import Confidence, ErrorBounds, Force
from gellight.frames.shear import DotsSeen, Floats, Shear
from gellight.reconstruction.confidence import Learnt, confidence_of
from gellight.reconstruction.error_bounds import ErrorRecord
from gellight.reconstruction.force_file import ForceRecord
from gellight.reconstruction.lens.model import middle_px
from gellight.reconstruction.lens.undistortion import LensRecord, Undistortion, lens_of, read_undistortion
from gellight.reconstruction.shear.felt import Gel, felt_shear, motion

PRESSES = "presses.npz"


class BundleMeasures:
    """The measures of the frames of one sensor."""

    def __init__(self, bundle: Bundle, *, from_network: bool = True) -> None:
        """Take what the bundle knows; BundleError for a damaged file.

        from_network: the slopes are those of the network.
        """
        self._bundle, self.from_network = bundle, from_network
        self._forces = ForceRecord.in_bundle(bundle)
        self._errors = ErrorRecord.in_bundle(bundle) if from_network else None

    def force(self, depth_mm: NDArray[np.float32]) -> Force | None:
        """Return the force that makes a (H, W) depth map; None where the bundle has no `force.json`."""
        if self._forces is None:
            return None
        manifest = self._bundle.manifest
        return self._forces.force(depth_mm, manifest.pixel_size_mm, manifest.camera_height_mm)

    def shear(self, depth_mm: NDArray[np.float32], dots: DotsSeen, force: Force | None) -> Shear:
        """Return how the dots say that the gel is moved and pulled along itself."""
        return felt_shear(dots, depth_mm, force, self._gel, self._forces)

    def dot_motion(self, depth_mm: NDArray[np.float32], dots: DotsSeen) -> tuple[Floats, Floats]:
        """Return (N, 2) rest places of dots, mm from the image centre, and (N, 2) mm they have moved along the gel."""
        return motion(dots, depth_mm, self._gel)

    @cached_property
    def _gel(self) -> Gel:
        """How the gel is seen."""
        bundle, record, of_lens = self._bundle, self._forces, LensRecord.in_bundle(self._bundle)
        lens = lens_of(of_lens) if of_lens else None
        middle, size = middle_px(bundle.image_shape), np.array(bundle.pixel_size_mm)
        return Gel(
            pixel_size_mm=bundle.pixel_size_mm,
            camera_height_mm=record.camera_height_mm if record else None,
            to_gel=lens.to_gel if lens else lambda places: np.asarray((places - middle) * size),
        )

    def confidence(self, image: NDArray[np.uint8], gradient_map: NDArray[np.float32]) -> Confidence:
        """Judge the pixels of a frame; with a lens, the pixels of the undistorted gel."""
        return confidence_of(*self._without_lens(image), gradient_map, self._learnt)

    def never_seen(self, image: NDArray[np.uint8], pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Say of (n,) flat indices of pixels whether the calibration never saw their place or colour."""
        if self._learnt is None:
            return np.zeros(len(pixels), np.bool_)
        picture, reference = self._without_lens(image)
        change = picture.reshape(-1, 3)[pixels] - reference.reshape(-1, 3)[pixels]
        return np.asarray(~self._learnt.near.ravel()[pixels] | self._learnt.strange(change))

    def _without_lens(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return a picture and the reference without the lens, where the bundle has one."""
        return self._lens.picture(image) if self._lens else image, self._reference

    @cached_property
    def _lens(self) -> Undistortion | None:
        return read_undistortion(self._bundle)

    @cached_property
    def _reference(self) -> NDArray[np.float32]:
        reference = self._bundle.reference
        return self._lens.picture(reference) if self._lens else reference

    def error_bounds(
        self, gradient_map: NDArray[np.float32], depth_mm: NDArray[np.float32], touched: NDArray[np.bool_]
    ) -> ErrorBounds | None:
        """Return the errors of a frame by its maps; None for measured slopes, or where the bundle has no errors."""
        return self._errors.bounds(gradient_map, depth_mm, touched) if self._errors else None

    @cached_property
    def _learnt(self) -> Learnt | None:
        """What the network has learnt from, over the gel; None for measured slopes, or where no bundle says."""
        if not self.from_network or PRESSES not in self._bundle.files:
            return None
        learnt = Learnt.of_rows(self._bundle.presses()["rows"], self._bundle.image_shape)
        if self._lens is None:
            return learnt
        return replace(learnt, near=self._lens.picture(learnt.near.view(np.uint8)).view(np.bool_))
