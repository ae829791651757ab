"""`lens.json`: the lens of a sensor and where it was measured, a file of its calibration bundle."""

from typing import Annotated

from pydantic import AwareDatetime, Field

from gellight.bundle.bundle import Bundle
from gellight.bundle.bundle_file import PictureFile, read_bundle_file
from gellight.reconstruction.lens.model import Lens
from gellight.reconstruction.lens.undistortion import Undistortion

FILE_NAME = "lens.json"
REMEDY = "measure it again with `gellight calibrate lens IMAGE --pitch-mm P --calibration BUNDLE --out NEW`"
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class LensRecord(PictureFile):
    """The content of the file; the first five as in `Lens`."""

    centre_px: tuple[Number, Number]
    k1: Annotated[float, Field(gt=-1, lt=1)]
    k2: Annotated[float, Field(gt=-1, lt=1)]
    px_per_mm: tuple[Positive, Number, Positive]
    origin_mm: tuple[Number, Number]
    learnt_from_circles: bool
    """the network of the bundle learnt from contact circles in the distorted picture; else from true slopes"""
    pitch_mm: Positive
    images: tuple[str, ...]
    pins: Annotated[int, Field(ge=1)]
    rms_before_px: Annotated[float, Field(ge=0)]
    rms_after_px: Annotated[float, Field(ge=0)]
    created: AwareDatetime


def has_lens(bundle: Bundle) -> bool:
    """Tell whether the bundle knows its lens."""
    return FILE_NAME in bundle.files


def read_record(bundle: Bundle) -> LensRecord:
    """Return the checked content of the file; BundleError where it is damaged or of another picture size."""
    return read_bundle_file(bundle, FILE_NAME, LensRecord, REMEDY)


def read_undistortion(bundle: Bundle) -> Undistortion:
    """Return the resampling of a bundle that has a lens; BundleError as `read_record`."""
    record = read_record(bundle)
    return Undistortion(lens_of(record), bundle.pixel_size_mm, from_circles=record.learnt_from_circles)


def lens_of(record: LensRecord) -> Lens:
    """Return the lens of a record."""
    return Lens(
        image_shape=(record.image_height_px, record.image_width_px),
        centre_px=record.centre_px,
        k1=record.k1,
        k2=record.k2,
        px_per_mm=record.px_per_mm,
        origin_mm=record.origin_mm,
    )
