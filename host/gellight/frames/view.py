"""How the picture of a camera becomes the one that the gel is measured in: perspective taken out, and cropped.

A place (x, y) of the picture as taken lies at (u, v) / w of the view, with (u, v, w) = H (x, y, 1), H a 3 x 3 matrix:
what a camera that looks at a plane from the side does to it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gellight.base.allowed import MOST_SIDE_PX, explained
from gellight.base.errors import InputError

Array = NDArray[np.float64]
Pixels = Annotated[int, Field(ge=2, le=MOST_SIDE_PX)]
"""as frames and recordings take them"""
_MOST_FINER = 4  # chosen: 16 samples a pixel; with one, slanted views had false stripes of 40 grey levels and more
MOST_PX = 1280
"""of a view that is chosen for its size alone: pixels of 20 mm of gel are then an eighth of what its coating blurs"""
Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class View(BaseModel):
    """A view of the gel, and the picture that it is taken from."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    taken_width_px: Pixels
    taken_height_px: Pixels
    width_px: Pixels
    height_px: Pixels
    homography: tuple[Row, Row, Row]
    """H: from pixels as taken to pixels of the view"""

    @classmethod
    def of_points(cls, taken: Array, wanted: Array, taken_shape: tuple[int, int], shape: tuple[int, int]) -> Self:
        """Return the view (H, W) in which points (N, 2) x, y as taken lie at `wanted`, by least squares.

        Raises InputError where no camera sees the points so.
        """
        matrix, _ = cv2.findHomography(taken, wanted)
        if matrix is None or abs(np.linalg.det(matrix)) < 1e-9:
            raise InputError("the points do not make a view: give four corners of which no three lie on a line")
        rows = tuple(tuple(float(value) for value in row) for row in matrix)
        values = {"taken_width_px": taken_shape[1], "taken_height_px": taken_shape[0], "homography": rows}
        return cls.model_validate({**values, "width_px": shape[1], "height_px": shape[0]})

    @classmethod
    def of_corners(
        cls, corners: Sequence[tuple[float, float]], taken_shape: tuple[int, int], shape: tuple[int, int]
    ) -> Self:
        """Return the view whose corners lie at four points as taken: top left, top right, bottom right, bottom left.

        Raises InputError for corners in another order, or that are none.
        """
        points = np.array(corners, np.float64)
        if points.shape != (4, 2) or not np.isfinite(points).all():
            raise InputError(f"corners {corners}: give four points x,y in px")
        sides = np.roll(points, -1, axis=0) - points
        after = np.roll(sides, -1, axis=0)
        turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
        if not (turns > 0).all():
            raise InputError(
                f"corners {corners} do not go round the view clockwise: give top left, top right, bottom right, "
                "bottom left"
            )
        height, width = shape
        ends = np.array([(0, 0), (width, 0), (width, height), (0, height)]) - 0.5
        return cls.of_points(points, ends, taken_shape, shape)

    @classmethod
    def of_box(cls, box: tuple[int, int, int, int], taken_shape: tuple[int, int]) -> Self:
        """Return the part that `box`, (x, y, width, height) px, cuts out of the picture.

        Raises InputError where it leaves the picture.
        """
        x, y, width, height = box
        if min(x, y) < 0 or min(width, height) < 2 or x + width > taken_shape[1] or y + height > taken_shape[0]:
            raise InputError(
                f"the crop {box} leaves the picture of {taken_shape[1]} x {taken_shape[0]} px: give x,y,width,height "
                "in it"
            )
        ends = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        return cls.of_corners([(across - 0.5, down - 0.5) for across, down in ends], taken_shape, (height, width))

    @classmethod
    def bounded(cls, taken_shape: tuple[int, int]) -> "View | None":
        """Return the view of whole pictures (H, W), made smaller to `MOST_PX`; None where they are no larger.

        By a whole factor, so that each pixel is the mean of whole ones.
        """
        factor = -(-max(taken_shape) // MOST_PX)
        if factor == 1:
            return None
        (height, width), shift = taken_shape, (1 / factor - 1) / 2
        return View(
            taken_width_px=width,
            taken_height_px=height,
            width_px=width // factor,
            height_px=height // factor,
            homography=((1 / factor, 0, shift), (0, 1 / factor, shift), (0, 0, 1)),
        )

    def after(self, first: "View") -> "View":
        """Return this view of the pictures of another one; InputError where that makes them of another size."""
        if first.image_shape != self.taken_shape:
            raise InputError(
                f"the view makes pictures of {first.width_px} x {first.height_px} px, these are of "
                f"{self.taken_width_px} x {self.taken_height_px} px: give the view.json that was written with them"
            )
        both = (np.array(self.homography) @ np.array(first.homography)).tolist()
        taken = {"taken_width_px": first.taken_width_px, "taken_height_px": first.taken_height_px}
        return self.model_copy(update={**taken, "homography": tuple(map(tuple, both))})

    @property
    def scale(self) -> float:
        """How many of its pixels a pixel as taken is wide; of a view that is smaller and nothing else."""
        return self.homography[0][0]

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W) of the view."""
        return self.height_px, self.width_px

    @property
    def taken_shape(self) -> tuple[int, int]:
        """(H, W) of the picture as taken."""
        return self.taken_height_px, self.taken_width_px

    def places(self, taken: Array) -> Array:
        """Return where points (N, 2) x, y of the picture as taken lie in the view."""
        places = cv2.perspectiveTransform(taken.reshape(-1, 1, 2), np.array(self.homography))
        return np.asarray(places, np.float64).reshape(-1, 2)

    def of(self, image: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
        """Return the view (h, w, 3) of a picture (H, W, 3) as taken; InputError, with its `name`, for another size."""
        if image.shape[:2] != self.taken_shape:
            raise InputError(
                f"{name} is {image.shape[1]} x {image.shape[0]} px, the view is of pictures of {self.taken_width_px} x "
                f"{self.taken_height_px} px: use the camera mode that the view was made with"
            )
        # Where the view is coarser than the picture, noise and texture between its pixels would show as patterns: it is
        # taken finer, and each of its pixels is the mean of some.
        finer, size = self._finer, (self.width_px, self.height_px)
        scaled = np.array([[finer, 0, (finer - 1) / 2], [0, finer, (finer - 1) / 2], [0, 0, 1]])
        warped = cv2.warpPerspective(
            image, scaled @ np.array(self.homography), (finer * size[0], finer * size[1]),
            flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        return np.asarray(warped if finer == 1 else cv2.resize(warped, size, interpolation=cv2.INTER_AREA), np.uint8)

    @property
    def _finer(self) -> int:
        """By how much its coarsest pixel is coarser than those of the picture, at most `_MOST_FINER`."""
        ends = np.array([(x, y) for y in (0, self.height_px - 1) for x in (0, self.width_px - 1)], np.float64)
        around = (ends + np.array([[[0, 0]], [[1, 0]], [[0, 1]]])).reshape(-1, 1, 2)
        taken = cv2.perspectiveTransform(around, np.linalg.inv(np.array(self.homography))).reshape(3, -1, 2)
        return int(np.clip(np.rint(np.hypot(*(taken[1:] - taken[0]).T).max()), 1, _MOST_FINER))


def read_view(path: Path) -> View:
    """Read a `view.json`; InputError for what is none."""
    try:
        return view_in(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError(f"view {path} cannot be opened ({error.strerror}): check the name") from error


def view_in(content: bytes | str, name: str) -> View:
    """Return the view of the content of a `view.json`; InputError, with its `name`, for what is none."""
    with explained(lambda wrong: InputError(f"{name} is no view ({wrong}): make it with `gellight calibrate view`")):
        return View.model_validate_json(content)
