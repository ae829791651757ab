"""The parameters of a `v4l2://` or `sensor://` URL."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from gellight.base.allowed import MOST_SIDE_PX, query_of, refusals, split_url
from gellight.base.errors import InputError
from gellight.sensor.v4l2.formats import Wanted


def _upper(letters: object) -> object:
    return letters.upper() if isinstance(letters, str) else letters


class CaptureOptions(BaseModel):
    """How a camera is to be set; what is not given is left to the camera or to the calibration bundle."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    width: int | None = Field(default=None, ge=2, le=MOST_SIDE_PX)
    height: int | None = Field(default=None, ge=2, le=MOST_SIDE_PX)
    format: Annotated[Literal["MJPG", "YUYV", "RGB3", "GREY"] | None, BeforeValidator(_upper)] = None
    fps: float | None = Field(default=None, gt=0, le=1000)
    exposure_us: float | None = Field(default=None, gt=0)
    gain: float | None = None
    white_balance_k: float | None = Field(default=None, gt=0)
    power_line_hz: Literal["0", "50", "60"] = "0"
    """mains frequency whose flicker the camera is to avoid; 0: inside a sensor there is none"""
    delay_us: float | None = Field(default=None, ge=0, le=1e6)
    """from the end of the first row's exposure to its time stamp, see stamps.py"""
    readout_us: float | None = Field(default=None, ge=0, le=1e6)
    stamp_error_us: float | None = Field(default=None, ge=0, le=1e6)
    """by which a time stamp may be off, either way; `gellight doctor` measures their jitter"""
    buffers: int = Field(default=4, ge=3, le=16)
    ring: str | None = Field(default=None, min_length=1)
    """URL of the light ring, for a camera and a ring that share no USB parent"""

    def wanted(self, shape: tuple[int, int] | None = None) -> Wanted:
        """Return the mode to ask for; `shape` (H, W) is what a calibration bundle was made with."""
        height, width = shape or (None, None)
        return Wanted(width=self.width or width, height=self.height or height, letters=self.format, fps=self.fps)

    def over(self, recorded: Mapping[str, object]) -> "CaptureOptions":
        """Return these options with those of `recorded` that were not given; InputError for a value out of range."""
        theirs = {name: value for name, value in recorded.items() if name in CaptureOptions.model_fields}
        try:
            return CaptureOptions.model_validate({**theirs, **self.model_dump(include=self.model_fields_set)})
        except ValidationError as error:
            wrong = refusals(error, CaptureOptions, "setting")
            raise InputError(f"camera settings of the calibration bundle: {wrong}; calibrate again") from None

    def controls(self) -> dict[str, float]:
        """Return the controls that are given, by name."""
        return self.model_dump(include={"exposure_us", "gain", "white_balance_k"}, exclude_none=True)


def parse_url(url: str) -> tuple[str, CaptureOptions]:
    """Split a URL into what follows `scheme://` and its options; InputError names a wrong parameter and the known."""
    parts = split_url(url)
    options = query_of(url, CaptureOptions)
    if (options.width is None) != (options.height is None):
        raise InputError(f"{url}: give width and height together")
    return parts.netloc + parts.path, options
