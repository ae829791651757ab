"""What `state.json` of a calibration holds; how it is read, and how a calibration is removed."""

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from gellight.base.allowed import explained
from gellight.base.errors import BundleError, InputError, first_line
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.manifest import MANIFEST
from gellight.frames.picture import PictureSteps
from gellight.lab.calibration.choices import ToolSizes
from gellight.lab.calibration.records import (
    BallPresses,
    CheckErrors,
    Circle,
    Fit,
    MeasuredPixelSize,
    PixelSize,
    Preparation,
    ShownCircle,
    UntouchedGel,
    Verification,
)
from gellight.lab.report.record import Record
from gellight.lab.training.presses import Press

STATE = "state.json"
REFERENCE = "reference.npy"
DRAFT, LIKE_UNIT = "draft", "like"
KINDS = ("presses", "checks")
"""folders of pictures"""
_SHOWN = ("press.png", "cylinder.png", "pins.png")
"""pictures that the terminal keeps beside the state, or once kept"""


class PictureRecord(Record):
    """A picture that was kept."""

    number: int = Field(ge=1)
    file: str = Field(pattern=r"^(presses|checks|grids)/press-\d{3,}\.png$")
    """relative to the folder of the calibration"""


class PressRecord(PictureRecord, Circle):
    """A ball press that was kept."""

    found: bool = True
    """in the picture; False: corrected by hand, so that its rim teaches less"""

    def press(self, folder: Path) -> Press:
        """Return the press as it is trained on; folder: that of the calibration."""
        return Press(image=folder / self.file, found=self.found, **self.circle())

    def circle(self) -> dict[str, Any]:
        """Return the three numbers of the circle by name."""
        return {name: getattr(self, name) for name in Circle.model_fields}

    def shown(self, state: str) -> ShownCircle:
        """Return what is shown of it."""
        return ShownCircle(number=self.number, state=state, **self.circle())


class CheckRecord(PressRecord):
    """A fresh press and its errors."""

    figures: CheckErrors


class Identity(ToolSizes, Record):
    """What a calibration cannot change once it has begun: the sensor, the size of its pictures, the tools."""

    model_config = ConfigDict(extra="ignore")

    sensor: str
    image_size_px: tuple[int, int]
    """(W, H)"""
    picture: PictureSteps | None = None
    """how its pictures are made of those as taken; None: they are those"""


class Steps(BaseModel):
    """The figures of every finished step."""

    prepare: Preparation | None = None
    reference: UntouchedGel | None = None
    pixel_size: MeasuredPixelSize | PixelSize | None = None
    presses: BallPresses | None = None
    fit: Fit | None = None
    verify: Verification | None = None
    refused_checks: int = 0
    """fresh presses that were refused"""


SCHEMA_VERSION = 1  # a state of another version is refused


class State(BaseModel):
    """Everything in `state.json`; what older versions kept beside it is left out."""

    schema_version: int = SCHEMA_VERSION
    identity: Identity
    steps: Steps = Field(default_factory=Steps)
    presses: list[PressRecord] = Field(default_factory=list)
    """to train on"""
    checks: list[CheckRecord] = Field(default_factory=list)
    """fresh ones"""
    grids: list[PictureRecord] = Field(default_factory=list)
    """of a pin grid, which this version no longer asks for: they are only removed with the rest"""
    extra_presses: int = 0
    """wanted beyond what was asked for, because a verdict was bad"""
    name: str = ""
    """what people call the sensor"""
    finished: bool = False
    """a finished calibration is not taken up again"""


def unfinished(path: Path) -> Identity | None:
    """Return what the interrupted calibration in a folder was begun with; None where there is none.

    Raises InputError for a `state.json` that no calibration wrote, BundleError for a damaged one.
    """
    state = state_in(path)
    return None if state is None or state.finished else state.identity


def discard(path: Path) -> None:
    """Remove the calibration in a folder: only the files it wrote, and folders that are empty then.

    Does nothing where there is none. Raises InputError or BundleError, and removes nothing, as `unfinished` does.
    """
    state = state_in(path)
    if state is None:
        return
    pictures = [record.file for record in (*state.presses, *state.checks, *state.grids)]
    bundles = [*_files_of_bundle(path, DRAFT), *_files_of_bundle(path, LIKE_UNIT)]
    with writing(path):
        for name in (*pictures, *bundles, *_SHOWN, REFERENCE, STATE):
            (path / name).unlink(missing_ok=True)
    for name in (*KINDS, "grids", DRAFT, LIKE_UNIT, "."):
        with suppress(OSError):  # it is not there, or holds something else
            (path / name).resolve().rmdir()


def kept_like(path: Path) -> Bundle | None:
    """Return the bundle of the like unit that the interrupted calibration in a folder was begun with; None without.

    Raises as `unfinished`, and BundleError for a bundle that was damaged.
    """
    begun = unfinished(path) is not None and (path / LIKE_UNIT).is_dir()
    return load_bundle(path / LIKE_UNIT) if begun else None


def _files_of_bundle(path: Path, folder: str) -> list[str]:
    try:
        bundle = load_bundle(path / folder)
    except BundleError:
        return []  # there is none, or no telling which files are its own
    return [f"{folder}/{name}" for name in (MANIFEST, *bundle.files)]


def state_in(path: Path) -> State | None:
    """Read the state in a folder; None where there is none."""
    place = path / STATE
    try:
        content = json.loads(place.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise BundleError(f"{place} cannot be read ({first_line(error)}): move {path} away and begin again") from error
    if not isinstance(content, dict) or not {"schema_version", "identity"} <= set(content):
        raise InputError(f"{place} is not the state of a calibration: give a new folder, nothing was changed in {path}")
    if content["schema_version"] != SCHEMA_VERSION:
        raise BundleError(
            f"{place} has schema version {content['schema_version']}, this program reads {SCHEMA_VERSION}: "
            f"move {path} away and begin again"
        )
    with explained(lambda wrong: BundleError(f"{place} is damaged ({wrong}): move {path} away and begin again")):
        return State.model_validate(content)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what the disk refuses into a BundleError that says so."""
    try:
        yield
    except OSError as error:
        raise BundleError(
            f"{path} cannot be written ({error.strerror or error}): free some space and go on; what was measured "
            "before is kept"
        ) from error
