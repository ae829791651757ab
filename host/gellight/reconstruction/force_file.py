"""`force.json`: what turns depth into newtons, a file of a calibration bundle."""

from typing import Annotated

from pydantic import AwareDatetime, Field

from gellight.bundle.bundle import Bundle
from gellight.bundle.bundle_file import BundleFile, read_bundle_file
from gellight.reconstruction.force import ForceScale, Layer
from gellight.reconstruction.shear.felt import ShearScale

FILE_NAME = "force.json"
REMEDY = "measure it again with `gellight calibrate force FORCES.csv --calibration BUNDLE --out NEW`"
SIDE_ERROR_SHARE = 0.2
"""of a gel whose constant was found with forces along the normal alone"""
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
InOlderFiles = Annotated[int | None, Field(exclude=True, repr=False)]


class ForceRecord(BundleFile):
    """The content of the file; it is of the gel, whatever the size of its pictures."""

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
    def side(self) -> ShearScale:
        """What turns the motion of dots into newtons."""
        return ShearScale(
            layer=Layer(self.gel_thickness_mm, self.poisson_ratio),
            youngs_modulus_mpa=self.youngs_modulus_mpa,
            side_scale=self.side_scale,
            side_error_share=self.side_error_share,
        )

    @property
    def scale(self) -> ForceScale:
        """What the frame path needs of it."""
        return ForceScale(
            layer=Layer(self.gel_thickness_mm, self.poisson_ratio),
            youngs_modulus_mpa=self.youngs_modulus_mpa,
            error_share=self.error_share,
            error_floor_n=self.error_floor_n,
            heaviest_n=self.heaviest_n,
        )


def force_file(record: ForceRecord) -> dict[str, bytes]:
    """Return the file by its name, for a bundle."""
    return {FILE_NAME: (record.model_dump_json(indent=1) + "\n").encode()}


def read_force(bundle: Bundle) -> ForceRecord | None:
    """Return the checked content of the file, None where the bundle has none; BundleError where it is damaged."""
    return read_bundle_file(bundle, FILE_NAME, ForceRecord, REMEDY) if FILE_NAME in bundle.files else None
