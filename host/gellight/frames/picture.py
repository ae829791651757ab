"""`picture.json` of a calibration bundle: what is done to each picture of the camera before it is compared.

Without such a file pictures are taken as they are. With it a view is taken (`view.py`), then marker dots are filled
(`dots.py`); `PreparedCamera` does that, and everything behind it sees pictures of the gel alone.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle
from gellight.bundle.bundle_file import PictureFile
from gellight.frames.camera import Camera
from gellight.frames.camera_wrapper import CameraWrapper
from gellight.frames.dots import Dots, find_dots
from gellight.frames.frames import CameraFrame
from gellight.frames.view import View

if TYPE_CHECKING:
    from gellight.frames.dot_following import DotFollower

FILE_NAME = "picture.json"
REMEDY = "make it with `gellight calibrate view` and `gellight calibrate fit`"


class PictureSteps(PictureFile):
    """The content of the file."""

    file_name: ClassVar[str] = FILE_NAME
    remedy: ClassVar[str] = REMEDY
    view: View | None = None
    dots: Dots | None = None

    @classmethod
    def of(cls, image_shape: tuple[int, int], view: View | None, dots: Dots | None) -> "PictureSteps | None":
        """Return the steps to pictures of this size (H, W); None where there is none."""
        if view is None and dots is None:
            return None
        return cls(image_width_px=image_shape[1], image_height_px=image_shape[0], view=view, dots=dots)

    def check_fits(self, bundle: Bundle) -> None:
        """Raise BundleError where it, or its view, is of another picture size than its bundle."""
        super().check_fits(bundle)
        if self.view and self.view.image_shape != bundle.image_shape:
            raise BundleError(f"{bundle.source}: {FILE_NAME} has a view of another size than its pictures; {REMEDY}")

    @classmethod
    def with_view(cls, view: View) -> "PictureSteps":
        """Return the steps that take a view and nothing else."""
        return cls(image_width_px=view.width_px, image_height_px=view.height_px, view=view)

    def in_words(self) -> str:
        """Return what is done, for people."""
        view = [f"a view of {self.view.width_px} x {self.view.height_px} px is taken"] if self.view else []
        dots = [f"{self.dots.count} marker dots are filled"] if self.dots else []
        return " and ".join([*view, *dots])

    @property
    def taken_shape(self) -> tuple[int, int]:
        """(H, W) of the pictures as taken."""
        return self.view.taken_shape if self.view else (self.image_height_px, self.image_width_px)

    def apply(self, image: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
        """Return a (H, W, 3) picture as it is compared; InputError, with its `name`, for one of another size."""
        return self.filled(self.seen(image, name))

    def seen(self, image: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
        """Return the view of a picture, with its dots; InputError as `apply`."""
        return self.view.of(image, name) if self.view else image

    def filled(self, seen: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a view with its dots filled."""
        return self.dots.filled(seen) if self.dots else seen

    def follower(self) -> "DotFollower | None":
        """Return what follows the dots of a gel; None where it has none, or the bundle does not say where."""
        dots = self.dots
        if dots is None or not dots.places_px:
            return None
        from gellight.frames.dot_following import DotFollower  # SciPy takes longer than all else of a start

        return DotFollower(np.array(dots.places_px), dots.diameter_px, dots.darkness)


def steps_in(files: Mapping[str, bytes]) -> PictureSteps | None:
    """Return the steps in the `bundle_files` of a camera; None where it has none."""
    return PictureSteps.model_validate_json(files[FILE_NAME]) if FILE_NAME in files else None


def chosen_steps(camera: Camera, view: View | None, *, dots: bool) -> PictureSteps | None:
    """Return the steps that take a view of a camera's pictures and, with `dots`, fill the marker dots of the gel.

    None where neither is wanted. The dots are looked for in the next picture, of the untouched gel; InputError where
    there are none. BundleError for a view of pictures of another size than the camera's.
    """
    steps = PictureSteps.with_view(view) if view else None
    seen = PreparedCamera(camera, steps) if steps else camera
    if not dots:
        return steps
    found = find_dots(seen.read().image)
    if found is None:
        raise InputError("no marker dots are seen: light the gel, take everything off it, or choose no marker dots")
    return PictureSteps.of(seen.image_shape, view, found)


def are_prepared(camera: Camera, bundle: Bundle) -> bool:
    """Whether the pictures of a camera are prepared already; BundleError where they are for another bundle."""
    made = camera.bundle_files.get(FILE_NAME)
    if made is not None and made != bundle.files.get(FILE_NAME):
        raise BundleError(
            f"{bundle.source} takes another view of the gel, or fills other dots, than {camera.url}, whose "
            "pictures are prepared already: use the bundle that came with them"
        )
    return made is not None


def prepared(camera: Camera, bundle: Bundle) -> Camera:
    """Return the camera with its pictures prepared as the bundle says; BundleError where that cannot be."""
    steps = PictureSteps.in_bundle(bundle)
    return camera if are_prepared(camera, bundle) or not steps else PreparedCamera(camera, steps)


class PreparedCamera(CameraWrapper):
    """A camera whose pictures are prepared for a bundle: the view taken, the dots followed and filled.

    Its frames do not keep the camera's own bytes, so a recording holds the prepared pictures.
    """

    def __init__(self, camera: Camera, steps: PictureSteps) -> None:
        """Wrap `camera`; BundleError unless its pictures have the size that the steps begin with."""
        super().__init__(camera)
        self.picture_steps = steps
        self._follower = steps.follower()
        if camera.image_shape != steps.taken_shape:
            height, width = steps.taken_shape
            raise BundleError(
                f"{camera.url} delivers {camera.image_shape[1]}x{camera.image_shape[0]} pixels, the calibration takes "
                f"its view from {width}x{height}: set the camera to that size or use the calibration of this sensor"
            )

    @property
    def image_shape(self) -> tuple[int, int]:  # type: ignore[override]
        """(H, W) of the prepared pictures."""
        return self.picture_steps.image_height_px, self.picture_steps.image_width_px

    @property
    def bundle_files(self) -> Mapping[str, bytes]:
        """Those of the camera inside, and the file with its steps."""
        return {**super().bundle_files, **self.picture_steps.files()}

    def read(self) -> CameraFrame:
        """Read a frame, and prepare its picture."""
        frame = self._camera.read()
        steps = self.picture_steps
        seen = steps.seen(frame.image, frame.source)
        dots = self._follower.follow(seen) if self._follower else None
        truth = None if steps.view else frame.truth
        return replace(frame, image=steps.filled(seen), encoded=None, truth=truth, dots=dots)
