"""`force.json`: what turns depth into newtons, a file of a calibration bundle."""

from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, Field

from gellight.base.allowed import Positive
from gellight.bundle.bundle_file import BundleFile
from gellight.frames.measures import BEYOND_VIEW, HEAVIER, Force
from gellight.frames.pixel_grid import spread_blocks
from gellight.reconstruction.force import Layer, indenting

FILE_NAME = "force.json"
REMEDY = "measure it again with `gellight calibrate force FORCES.csv --calibration BUNDLE --out NEW`"
HEAVIER_BY = 1.25
"""a force larger than this multiple of the heaviest of the calibration is flagged"""
SIDE_ERROR_SHARE = 0.2
"""of a gel whose constant was found with forces along the normal alone"""
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]  # an error may be 0
InOlderFiles = Annotated[int | None, Field(exclude=True, repr=False)]


class ForceRecord(BundleFile):
    """The content of the file; it is of the gel, whatever the size of its pictures."""

    file_name: ClassVar[str] = FILE_NAME
    remedy: ClassVar[str] = REMEDY
    gel_thickness_mm: Positive
    poisson_ratio: Annotated[float, Field(ge=0, lt=0.5)]
    youngs_modulus_mpa: Positive
    """the constant; of the layer model and this sensor's depth, not of the rubber"""
    error_share: Positive
    """standard deviation of a force, as a share of it; see `calibration.force.fit`"""
    error_floor_n: NotNegative
    """and of no force at all"""
    lightest_n: NotNegative
    heaviest_n: Positive
    readings: Annotated[int, Field(ge=1)]
    side_scale: Positive = 1.0
    """measured force along the gel over that of the layer"""
    side_error_share: Positive = SIDE_ERROR_SHARE
    """standard deviation of a force along the gel, as a share of it; to which comes what the dots leave open"""
    camera_height_mm: Positive | None = None
    """above the gel at rest; None: nobody knows, and perspective stays in the displacement of dots"""
    other_objects_share: NotNegative | None = None
    """error on an object that was left out of the fit, rms; None where one object was weighed"""
    lag_s: Annotated[float, Field(allow_inf_nan=False)] = 0.0
    """by which the record of the load cell came later than the pictures"""
    source: str
    """name of the record"""
    created: AwareDatetime
    image_width_px: InOlderFiles = None
    image_height_px: InOlderFiles = None

    @property
    def layer(self) -> Layer:
        """The gel."""
        return Layer(self.gel_thickness_mm, self.poisson_ratio)

    def force(
        self, depth_mm: NDArray[np.float32], pixel_size_mm: tuple[float, float], camera_height_mm: float = 0.0
    ) -> Force:
        """Return the force that makes a (H, W) depth map, seen as `indenting` has it, and its error."""
        found, modulus_mpa = indenting(depth_mm, pixel_size_mm, self.layer, camera_height_mm), self.youngs_modulus_mpa
        normal_n = modulus_mpa * found.integral_mm2
        reasons = ((BEYOND_VIEW, found.at_border), (HEAVIER, normal_n > HEAVIER_BY * self.heaviest_n))

        def pressure_mpa() -> NDArray[np.float32]:
            """(H, W), each cell's pressure on its pixels."""
            height, width = depth_mm.shape
            return spread_blocks((modulus_mpa * found.pressure).astype(np.float32), found.side_px, (height, width))

        return Force(
            normal_n=normal_n,
            error_n=float(np.hypot(self.error_floor_n, self.error_share * normal_n)),
            flags=tuple(name for name, holds in reasons if holds),
            pressure_of=pressure_mpa,
        )
