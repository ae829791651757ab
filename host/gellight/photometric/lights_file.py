"""`lights.json`: the light model of a sensor, a file of its calibration bundle."""

import json
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from gellight.base.allowed import Byte
from gellight.base.errors import BundleError, ConfigError
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.bundle.bundle_file import PictureFile
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.ring_geometry import RingGeometry

FILE_NAME = "lights.json"
REMEDY = "take it with `gellight calibrate lights --sensor URL --calibration BUNDLE --out NEW`, the gel untouched"


class LightRecord(PictureFile):
    """The content of the file; names and units as in `LightModel`."""

    file_name: ClassVar[str] = FILE_NAME
    remedy: ClassVar[str] = REMEDY
    ring: RingGeometry
    colours: list[tuple[Byte, Byte, Byte]]
    crosstalk: tuple[tuple[FiniteFloat, FiniteFloat, FiniteFloat], ...]
    black_grey: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    gamma: Annotated[float, Field(gt=0.1, lt=10)]
    exposure_us: Annotated[float, Field(gt=0)] | None
    brightest_grey: Annotated[float, Field(ge=0)]
    pattern_residual: Annotated[float, Field(ge=0)]
    patterns: dict[LightGroups, list[list[list[FiniteFloat]]]]

    @model_validator(mode="after")
    def _is_one_ring(self) -> "LightRecord":
        leds = len(self.ring.led_colours)
        if leds != len(self.colours) or len(self.crosstalk) != 3 or set(self.patterns) != set(LightGroups):
            raise ValueError(f"{leds} LEDs, {len(self.colours)} colours, patterns for {', '.join(self.patterns)}")
        for kind, pattern in self.patterns.items():
            rows = {len(row) for led in pattern for row in led} | {len(led) for led in pattern}
            if len(pattern) != leds or len(rows) != 1:
                raise ValueError(f"{len(pattern)} patterns of {kind} for {leds} LEDs, or not all of one degree")
        return self


def has_lights(bundle: Bundle) -> bool:
    """Tell whether the bundle knows its lights."""
    return FILE_NAME in bundle.files


def read_lights(bundle: Bundle) -> LightModel:
    """Return the light model of a bundle; BundleError where it has none, or one that does not fit it."""
    try:
        record = LightRecord.in_bundle(bundle)
    except ConfigError as error:  # of the ring
        raise BundleError(f"{bundle.source}: {FILE_NAME}: {error}; {REMEDY}") from error
    if record is None:
        raise BundleError(f"{bundle.source} has no {FILE_NAME}, the light of its LEDs one by one: {REMEDY}")
    return _model(record)


def write_lights(bundle: Bundle, model: LightModel, out: Path, *, overwrite: bool = False) -> Bundle:
    """Write the bundle with the light model as a new one and return it; BundleError where that cannot be."""
    return extend_bundle(bundle, out, lights_file(model), overwrite=overwrite)


def lights_file(model: LightModel) -> dict[str, bytes]:
    """Return the light model as a file of a bundle."""
    return {FILE_NAME: (json.dumps(_record(model).model_dump()) + "\n").encode()}


_AS_THEY_ARE = ("gamma", "exposure_us", "brightest_grey", "pattern_residual")
"""fields that are the same in the record and in the model"""


def _model(record: LightRecord) -> LightModel:
    return LightModel(
        ring=record.ring,
        colours=np.array(record.colours, np.uint8),
        image_shape=(record.image_height_px, record.image_width_px),
        patterns={kind: np.array(values) for kind, values in record.patterns.items()},
        crosstalk=np.array(record.crosstalk),
        black_grey=np.array(record.black_grey),
        **{name: getattr(record, name) for name in _AS_THEY_ARE},
    )


def _record(model: LightModel) -> LightRecord:
    return LightRecord.model_validate(
        {
            "ring": vars(model.ring),
            "colours": model.colours.tolist(),
            "image_width_px": model.image_shape[1],
            "image_height_px": model.image_shape[0],
            "crosstalk": model.crosstalk.round(6).tolist(),
            "black_grey": model.black_grey.round(3).tolist(),
            "patterns": {kind: values.round(7).tolist() for kind, values in model.patterns.items()},
            **{name: getattr(model, name) for name in _AS_THEY_ARE},
        }
    )
