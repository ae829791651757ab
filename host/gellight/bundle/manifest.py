"""`manifest.toml` of a calibration bundle: what the sensor is, and the SHA-256 of every other file of the bundle."""

import hashlib
import tomllib
from datetime import UTC
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    model_validator,
)

from gellight.base.allowed import MOST_SIDE_PX, Byte, Positive, explained
from gellight.base.errors import BundleError
from gellight.base.leds import MOST_LEDS

SCHEMA_VERSION = 1  # counted up when an older GelLight could no longer read a bundle
MANIFEST, REFERENCE, METRICS = "manifest.toml", "reference.png", "metrics.json"
AGAIN = "calibrate the sensor again or restore the bundle from a copy"
MOST_BYTES = 1024 * 1024  # chosen: 600 times the manifest of the shipped bundle, and no burden on the memory
IDENTITY_BYTES = 8
"""of a bundle, as the board of its sensor remembers it"""
BULGE = 1.71
"""Mean depth over a view that is touched all over, divided by the height of the gel at its border above the gel at
rest. A soft layer keeps its volume, so what is pressed down in the view rises around it. Fitted to 30 random presses of
the simulated gel of the paper; nine of ten lay between 1.5 and 2.1. Another gel, or a view of another size, has another
value: `bulge` in the manifest of its bundle."""


def plain_name(name: str) -> str:
    """Return the name of a file of a bundle; ValueError if it would lie in another folder."""
    if not name or name in {".", ".."} or Path(name).name != name or "\\" in name or ":" in name:
        raise ValueError(f"file name {name!r} leaves the bundle: names have no folders")
    return name


FileName = Annotated[str, AfterValidator(plain_name)]
Side = Annotated[int, Field(ge=2, le=MOST_SIDE_PX)]  # of a picture; one pixel has no slope
Control = bool | int | float | str
CAPTURE_OPTIONS = frozenset(
    {"width", "height", "format", "fps", "power_line_hz", "delay_us", "readout_us", "stamp_error_us", "buffers", "ring"}
)
"""what `[camera]` may hold besides controls: how the camera is opened"""


class LedSetting(BaseModel):
    """One LED of the ring while the sensor was calibrated; LED i sits at azimuth 30 degrees * i, anticlockwise."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    colour: Literal["R", "G", "B"]
    rgb: tuple[Byte, Byte, Byte]


class Manifest(BaseModel):
    """The content of `manifest.toml`; an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1] = 1
    sensor: Annotated[str, Field(min_length=1)]
    """what the sensor is known by: the serial number of its board"""
    name: str = ""
    """what people call the sensor; nothing depends on it"""
    created: AwareDatetime
    software: str
    image_width_px: Side
    image_height_px: Side
    pixel_size_mm: tuple[Positive, Positive]
    """(x, y)"""
    reference_frames: Annotated[int, Field(ge=1)]
    """how many frames the reference image is the mean of"""
    noise_grey: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    """of one frame, as `image_noise` measures it: the standard deviation of one pixel, or for a camera that compresses
    that of white noise whose means spread as much; grey levels"""
    rest_grey: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """how far means over cells of the gel at rest differ from the reference image beyond that noise: light that drifts
    unevenly, gel that does not come back quite; root mean square, grey levels; 0 where nobody measured it"""
    follow_light: bool = False
    """take light that differs from the reference's out of every picture, because the light of this sensor drifts"""
    level_plane: bool = False
    """take the plane that the untouched gel lies on off every depth map, because slopes of this sensor tilt it"""
    skirt_share: Annotated[float, Field(gt=0, le=2)] = 1.0
    """share of the felt slopes beside contacts that is real, by contact mechanics; see `reconstruction.skirt`"""
    light_by_depth: bool = False
    """the network answers to light as the gel has it at the depth of rest: what the depth that is felt changes of the
    light of the LEDs (`lights.json`) is taken off before it is asked"""
    gel_thickness_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """of the soft gel, no depth can be beyond it; 0 where nobody told"""
    camera_height_mm: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """how high above the gel at rest the camera seems to stand from within the gel; 0 where nobody told: labels and
    depth are those of parallel rays"""
    bulge: Positive = BULGE
    """of this gel and view, see `BULGE`"""
    network: FileName = "network.onnx"
    files: dict[FileName, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    led: tuple[LedSetting, ...] = ()
    camera: dict[str, Control] = Field(default_factory=dict)
    """controls that have to be the same when the sensor is used (exposure, gain, white balance), and capture options"""

    @model_validator(mode="after")
    def _lists_what_is_needed(self) -> "Manifest":
        missing = {REFERENCE, METRICS, self.network} - set(self.files)
        if missing:
            raise ValueError(f"[files] does not list {', '.join(sorted(missing))}")
        if self.led and not 3 <= len(self.led) <= MOST_LEDS:
            raise ValueError(f"led has {len(self.led)} entries, a ring has 3 to {MOST_LEDS}")
        return self

    @property
    def identity(self) -> str:
        """16 hexadecimal digits that tell this bundle from every other; packing it or a newer GelLight keeps them."""
        described = [self.sensor, self.created.astimezone(UTC).isoformat(), repr(self.pixel_size_mm)]
        listed = [f"{name} {digest}" for name, digest in sorted(self.files.items())]
        return hashlib.sha256("\n".join(described + listed).encode()).hexdigest()[: 2 * IDENTITY_BYTES]


def parse_manifest(content: bytes, source: str) -> Manifest:
    """Read `manifest.toml`; BundleError, naming `source`, for one that is damaged or too new."""
    try:
        if len(content) > MOST_BYTES:
            raise ValueError(f"it has {len(content)} bytes, a manifest at most {MOST_BYTES}")
        values = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{source}: {MANIFEST} is not TOML ({error}): {AGAIN}") from error
    schema = values.get("schema_version")
    if isinstance(schema, int) and schema > SCHEMA_VERSION:
        raise BundleError(
            f"{source} has schema version {schema}, this GelLight reads up to {SCHEMA_VERSION}: update GelLight"
        )
    return checked_manifest(source, **values)


def checked_manifest(where: str | Path, **values: Any) -> Manifest:
    """Return the manifest of these values; BundleError, naming `where`, for one that is out of range."""
    with explained(lambda wrong: BundleError(f"{where}: {MANIFEST}: {wrong}. Correct it or {AGAIN}")):
        return Manifest.model_validate(values)


def manifest_toml(manifest: Manifest) -> bytes:
    """Return the content of `manifest.toml`."""
    return tomli_w.dumps(manifest.model_dump()).encode()


class _Figures(BaseModel, extra="allow"):
    """What the program reads."""

    verification: dict[str, Any] | None = None
    """on fresh presses"""
    pattern_match: FiniteFloat | None = None
    ball_radius_mm: FiniteFloat | None = None
    learnt_on_other_units: list[str] | None = None


def read_metrics(content: bytes, source: str) -> dict[str, Any]:
    """Return the content of the file; BundleError, naming `source`, where it is no object or a figure no figure."""
    with explained(lambda wrong: BundleError(f"{source}: {METRICS}: {wrong}; {AGAIN}")):
        return _Figures.model_validate_json(content).model_dump(exclude_unset=True)
