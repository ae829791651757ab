"""Settings: flags over environment over ./gellight.toml over the user's config.toml over the defaults.

Each source is checked by itself before it is merged, so a mistake is reported with the file or variable it is in, even
where a stronger source would have hidden it. An unknown key is an error.
"""

import difflib
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from math import radians
from pathlib import Path
from typing import Any, Literal

import platformdirs
from pydantic import Field, ValidationError

from gellight.base.allowed import ALLOWED, MOST_SIDE_PX, NAME, StrictModel, allowed, nearest
from gellight.base.errors import ConfigError
from gellight.base.logs import LogForm

PREFIX = "GELLIGHT_"
TOKEN = "^([A-Za-z0-9_-]{16,200})?$"
Values = dict[str, dict[str, object]]
"""values by section and key"""


class SensorSettings(StrictModel):
    """Which sensor."""

    url: str = Field(
        default="auto",
        min_length=1,
        description="where the camera is: `auto` (the one sensor that is plugged in), `sensor://NAME`, `/dev/video0`, "
        "`v4l2:///dev/...`, a folder of images, or `sim://`",
    )
    calibration: str | None = Field(
        default=None,
        min_length=1,
        description="calibration bundle: a folder, a .gelcal file, `synthetic`, or `auto`: the one of this sensor, "
        "which its board names. Not given: as `auto`, but `synthetic` for `sim://` and for a sensor that has none yet",
    )


class GeometrySettings(StrictModel):
    """How the sensor is built. Angles are in degrees.

    What is not given is as in the paper where it gives a figure: gel 50 mm across and 5 mm thick, camera 40 mm from it,
    12 LEDs (`RRRRGGGGBBBB`) at a mounting height of 20 mm, tilted by 29 degrees. It gives none for the ring radius
    (ours: 21.5 mm), Poisson's ratio (0.49), the coating (0.1 mm) and the image size (640 x 480, each pixel 2.5 times
    the paper's 0.02352 mm). The beam is 120 degrees, as the data sheet of the LED has it; the paper simulates 160.

    A simulated sensor is built by all of these. With a real sensor the calibration uses the colours of the LEDs, and
    photometric stereo uses the ring.
    """

    gel_diameter_mm: float | None = Field(default=None, gt=0, description="diameter of the gel")
    gel_thickness_mm: float | None = Field(default=None, gt=0, description="thickness of the gel")
    poisson_ratio: float | None = Field(default=None, ge=0, lt=0.5, description="Poisson's ratio of the gel")
    coating_smoothing_mm: float | None = Field(
        default=None, ge=0, description="the coating bridges detail finer than this (standard deviation)"
    )
    camera_height_mm: float | None = Field(
        default=None, gt=0, description="from the gel to the camera; where given, labels and depth count with it"
    )
    image_width_px: int | None = Field(default=None, ge=16, le=MOST_SIDE_PX, description="columns of the camera image")
    image_height_px: int | None = Field(default=None, ge=16, le=MOST_SIDE_PX, description="rows of the camera image")
    pixel_size_mm: float | None = Field(default=None, gt=0, description="size of a camera pixel on the gel")
    led_colours: str | None = Field(
        default=None, pattern="^[RGB]{3,}$", description="one letter of RGB for each LED, anticlockwise from the right"
    )
    ring_radius_mm: float | None = Field(default=None, gt=0, description="from the axis to the LEDs")
    mounting_height_mm: float | None = Field(
        default=None, ge=0, description="of the LEDs, from the camera towards the gel"
    )
    perspective: bool | None = Field(
        default=None, description="see the gel from the height of the camera; else along parallel rays"
    )
    window: bool | None = Field(
        default=None, description="light and see the gel through gel and acrylic, which bend light"
    )
    obliquity: float | None = Field(
        default=None, ge=0, description="a ray at the angle a brings cos^obliquity a of its light to the picture"
    )
    incident_angle_deg: float | None = Field(
        default=None, ge=0, lt=90, description="tilt of each LED's axis from the gel normal, inwards"
    )
    beam_angle_deg: float | None = Field(default=None, gt=0, lt=180, description="full angle of an LED at half power")

    def overrides(self) -> dict[str, float | int | str]:
        """Return what is given, by the names and in the units (rad) of `sim_reference.geometry.SensorGeometry`."""
        given = self.model_dump(exclude_none=True)
        return {
            name.replace("_deg", "_rad"): radians(value) if name.endswith("_deg") else value
            for name, value in given.items()
        }


class ReconstructionSettings(StrictModel):
    """How depth is computed."""

    mode: Literal["network", "photometric"] = Field(
        default="network", description="GelNet on every frame, or photometric stereo on series of exposures"
    )
    light_groups: Literal["triples", "singles"] = Field(
        default="triples",
        description="exposures of photometric stereo: 4 of a red, a green and a blue LED each, or one of each LED",
    )
    frames_per_light: int = Field(
        default=1, ge=1, le=64, description="frames averaged in each exposure of photometric stereo"
    )
    smoothing_px: int = Field(
        default=2, ge=0, le=50, description="half width of the narrowest smoothing of the gradient map"
    )
    cast_shadows: bool = Field(
        default=True,
        description="give gel in cast shadow its light back, where the bundle has `lights.json`: depth beside steep "
        "walls is right; such frames take up to 1.2 times as long",
    )


class LightingSettings(StrictModel):
    """What the light of the sensor does while it runs; see docs/light.md."""

    sequence: str = Field(
        default="",
        description="light groups shown in turn: `rgb` (a red, a green and a blue LED each), `single` (one LED each) "
        "or a JSON file; empty: the light of the calibration all the time",
    )
    light_mode: Literal["hold", "free", "ext"] = Field(
        default="hold",
        description="what moves the light of a sequence or of photometric stereo on: each frame that is read, the "
        "board's clock, or the strobe of the camera",
    )


class WatchSettings(StrictModel):
    """What is watched for changes since the calibration; see docs/watch.md."""

    enabled: bool = Field(default=True, description="watch for drift, LEDs, the camera's place, dirt and tears")
    rezero: bool = Field(
        default=True, description="let the zero of the depth follow slow drift of the light while nothing touches"
    )


class TrackingSettings(StrictModel):
    """Where the object in the gel goes; see docs/tracking.md."""

    enabled: bool = Field(default=False, description="give each frame the pose of the object that touches")


class DashboardSettings(StrictModel):
    """The page."""

    port: int = Field(default=8420, ge=0, le=65535, description="port; 0: any free one")
    host: str = Field(
        default="127.0.0.1",
        min_length=1,
        description="address to listen on; other computers reach any other one, such as 0.0.0.0, and need the token",
    )
    token: str = Field(
        default="",
        pattern=TOKEN,
        description="what a browser has to know, at least 16 letters, digits, `-` and `_`; empty: where `host` is "
        "of this computer alone the one that this user keeps, else one is drawn at each start",
    )
    tls_cert: str = Field(
        default="", description="certificate (PEM, with those that lead to its authority) to encrypt by; empty: http"
    )
    tls_key: str = Field(default="", description="its private key (PEM, without a password)")


class ServiceSettings(StrictModel):
    """A sensor that runs without anybody watching."""

    log: LogForm = Field(
        default="text", description="what is said on standard error: lines for people, or one JSON object a line"
    )
    realtime: bool = Field(
        default=False, description="let camera and reconstruction run before all other programs (SCHED_FIFO)"
    )


class StreamSettings(StrictModel):
    """Frames for other programs; see docs/streaming.md."""

    enabled: bool = Field(default=True, description="publish frames to other programs of this computer")
    name: str = Field(
        default="",
        pattern=f"^({NAME})?$",
        json_schema_extra={"allowed": ALLOWED},
        description="under which the sensor is found; empty: the sensor's own",
    )
    lan: bool = Field(default=False, description="accept other computers too; whoever reaches the port may read")
    token: str = Field(
        default="",
        pattern=TOKEN,
        description="what programs of others bring to press, light or set the zero, as dashboard.token; empty: one is "
        "drawn at each start",
    )
    zenoh_config: str = Field(
        default="", description="file of zenoh's own settings, for TLS and access control; empty: none"
    )
    ros2: str = Field(
        default="",
        pattern=r"^((tcp|tls|quic|udp|ws)/\S+:\d{1,5}([?#]\S*)?)?$",
        json_schema_extra={"allowed": "an address such as `tcp/localhost:7447`"},
        description="router of ROS 2's rmw_zenoh to publish topics by, made where this computer has none; empty: none",
    )
    ros2_domain: int = Field(default=0, ge=0, le=232, description="ROS_DOMAIN_ID of those topics")
    foxglove: bool = Field(default=False, description="serve a live view for Foxglove")
    foxglove_port: int = Field(default=8765, ge=0, le=65535, description="port of that; 0: any free one")
    sinks: str = Field(
        default="",
        pattern=r"^([\w.-]+(,[\w.-]+)*)?$",
        json_schema_extra={"allowed": "names separated by commas"},
        description="where else frames go, by other distributions; empty: nowhere",
    )


class Settings(StrictModel):
    """All settings."""

    sensor: SensorSettings = Field(default_factory=SensorSettings)
    geometry: GeometrySettings = Field(default_factory=GeometrySettings)
    reconstruction: ReconstructionSettings = Field(default_factory=ReconstructionSettings)
    lighting: LightingSettings = Field(default_factory=LightingSettings)
    watch: WatchSettings = Field(default_factory=WatchSettings)
    tracking: TrackingSettings = Field(default_factory=TrackingSettings)
    dashboard: DashboardSettings = Field(default_factory=DashboardSettings)
    service: ServiceSettings = Field(default_factory=ServiceSettings)
    stream: StreamSettings = Field(default_factory=StreamSettings)


SECTIONS: dict[str, Any] = {name: field.annotation for name, field in Settings.model_fields.items()}
"""model of each section by its name"""


@dataclass(frozen=True)
class Layer:
    """The values of one source, checked."""

    source: str
    """a file, a variable or the command line, for messages"""
    values: Values


@dataclass(frozen=True)
class Setting:
    """One row of the reference: a key, and the values it may have."""

    section: str
    key: str
    allowed: str
    default: object
    description: str


def load_settings(flags: Mapping[str, object] | None = None) -> Settings:
    """Read all sources and merge them; `flags` are by "section.key", None where a flag was not given.

    Raises ConfigError with the source, the key, the value and what is allowed.
    """
    return merge(read_layers(flags))


def read_layers(flags: Mapping[str, object] | None = None) -> list[Layer]:
    """Return every source that sets something, weakest first; flags and errors as in `load_settings`."""
    files = [_file_layer(path) for path in file_paths() if path.exists()]
    return [*files, *_environment_layers(), *_flag_layers(flags or {})]


def merge(layers: list[Layer]) -> Settings:
    """Return the settings that `layers`, weakest first, add up to."""
    merged: Values = {}
    for layer in layers:
        for section, values in layer.values.items():
            merged.setdefault(section, {}).update(values)
    return Settings.model_validate(merged)


def read_settings(path: Path) -> Settings:
    """Read one file by itself, whatever its name; raises ConfigError as `load_settings` does."""
    return merge([_file_layer(path)])


def file_paths() -> list[Path]:
    """Return where settings are read from, whether they exist or not, weakest first."""
    return [platformdirs.user_config_path("gellight") / "config.toml", Path.cwd() / "gellight.toml"]


def reference() -> list[Setting]:
    """Return every setting there is, in order; the documentation and the messages are made of it."""
    return [
        Setting(section, key, allowed(schema), schema.get("default"), schema["description"])
        for section, model in SECTIONS.items()
        for key, schema in model.model_json_schema()["properties"].items()
    ]


def _file_layer(path: Path) -> Layer:
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ConfigError(f"there is no file {path}: correct its name") from error
    except OSError as error:
        raise ConfigError(f"{path} cannot be read ({error.strerror}): make it readable or move it away") from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} is not TOML in UTF-8 ({error}): correct it or move it away") from error
    return _checked(str(path), values)


def _environment_layers() -> Iterator[Layer]:
    for variable, text in sorted(os.environ.items()):
        section, _, key = variable.lower().removeprefix(PREFIX.lower()).partition("_")
        # What resembles no section, as the GELLIGHT_NO_SKIPS of the tests, is for another program.
        if variable.upper().startswith(PREFIX) and difflib.get_close_matches(section, SECTIONS):
            values = {section: {key: text}}
            yield _checked(f"environment variable {variable}", values, Settings.model_validate_strings)


def _flag_layers(flags: Mapping[str, object]) -> Iterator[Layer]:
    for path, value in flags.items():
        if value is not None:
            section, _, key = path.partition(".")
            # as text, also of what is no text: `--set stream.lan=true`
            validate = Settings.model_validate_strings if isinstance(value, str) else Settings.model_validate
            yield _checked("the command line", {section: {key: value}}, validate)


def _checked(source: str, values: Any, validate: Callable[[Any], Settings] = Settings.model_validate) -> Layer:
    try:
        return Layer(source, validate(values).model_dump(exclude_unset=True))
    except ValidationError as error:
        problems = [f"{source}: {_explain(dict(problem))}" for problem in error.errors(include_url=False)]
        raise ConfigError("; ".join(problems)) from error


@cache
def _allowed_values() -> dict[str, dict[str, str]]:
    """What each key of each section allows, for messages."""
    known: dict[str, dict[str, str]] = {section: {} for section in SECTIONS}
    for setting in reference():
        known[setting.section][setting.key] = setting.allowed
    return known


def _explain(problem: dict[str, Any]) -> str:
    section, *rest = (str(step) for step in problem["loc"])
    here = _allowed_values().get(section, {})
    if problem["type"] == "extra_forbidden":
        if not rest:
            return f"unknown section {section}: {nearest(section, SECTIONS)}"
        return f"unknown key {section}.{rest[0]}: {nearest(rest[0], here)}"
    if not rest:
        return f"{section} = {problem['input']!r} is no section: write [{section}] and its keys below"
    return f"{section}.{rest[0]} = {problem['input']!r} is not allowed: give {here[rest[0]]}"
