"""The state of a calibration on disk: every figure, picture and press is there as soon as it is known.

state.json        what is done
reference.npy     (H, W, 3) float32, the mean of the untouched gel
presses/*.png     ball presses to train on
checks/*.png      fresh presses, never trained on
grids/*.png       the pin grid

Each file is written whole or not at all, and is on the disk when the call that wrote it returns.
"""

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.base.writing import make_folder, write_file
from gellight.calibration.bulletin import Picture
from gellight.report.pictures import write_png
from gellight.training.presses import Press

SCHEMA_VERSION = 1
STATE = "state.json"
_REFERENCE = "reference.npy"
KINDS = ("presses", "checks", "grids")


def has_state(path: Path) -> bool:
    """Tell whether an interrupted calibration lies in a folder; one that cannot be read counts."""
    try:
        return not json.loads((path / STATE).read_text(encoding="utf-8"))["finished"]
    except FileNotFoundError:
        return False
    except (OSError, ValueError, KeyError, TypeError):
        return True


def begun_with(path: Path) -> dict[str, Any]:
    """Return sensor, picture size and tools of the interrupted calibration in a folder; empty where there is none."""
    if not has_state(path):
        return {}
    try:
        identity: dict[str, Any] = json.loads((path / STATE).read_text(encoding="utf-8"))["identity"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}  # `Folder.open` tells what is wrong with it
    return identity


@dataclass
class Folder:
    """What one calibration has learnt so far."""

    path: Path
    identity: dict[str, Any]
    """which sensor, which picture size, which tools"""
    steps: dict[str, Any] = field(default_factory=dict)
    """figures of every finished step, by name"""
    presses: list[dict[str, Any]] = field(default_factory=list)
    """file, center_x_px, center_y_px, contact_radius_px of each press to train on"""
    checks: list[dict[str, Any]] = field(default_factory=list)
    """the same of each fresh press"""
    grids: list[dict[str, Any]] = field(default_factory=list)
    """file of each picture of the pin grid"""
    finished: bool = False
    """a finished calibration is not taken up again"""
    extra_presses: int = 0
    """wanted beyond what was asked for, because a verdict was bad"""

    @classmethod
    def open(cls, path: Path, identity: dict[str, Any]) -> "Folder":
        """Make the folder, or take up the calibration in it; InputError if that one is of something else."""
        folder = cls(path, identity)
        if has_state(path):
            folder._load()
        for name in ("", *KINDS):
            _made(path / name)
        wanted = {record["file"] for record in folder.presses + folder.checks + folder.grids}
        for picture in (p for kind in KINDS for p in (path / kind).glob("press-*.png")):
            if str(picture.relative_to(path)) not in wanted:
                picture.unlink()
        folder.save()
        return folder

    def _load(self) -> None:
        place = self.path / STATE
        try:
            state = json.loads(place.read_text(encoding="utf-8"))
            found, schema = state["identity"], state["schema_version"]
            self.steps, self.presses, self.checks = state["steps"], state["presses"], state["checks"]
            self.extra_presses, self.grids = state["extra_presses"], state.get("grids", [])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise BundleError(f"{place} cannot be read ({error}): remove the folder and begin again") from error
        if schema != SCHEMA_VERSION:
            raise BundleError(f"{place} has schema version {schema}: remove the folder and begin again")
        for name, value in self.identity.items():
            if found.get(name) != value:
                raise InputError(
                    f"the calibration in {self.path} was begun with {name} {found.get(name)}, not {value}: "
                    "give the same again, or begin anew"
                )

    def save(self) -> None:
        """Write the state; BundleError where the disk refuses it."""
        state = {
            "schema_version": SCHEMA_VERSION,
            "identity": self.identity,
            "steps": self.steps,
            "presses": self.presses,
            "checks": self.checks,
            "grids": self.grids,
            "extra_presses": self.extra_presses,
            "finished": self.finished,
        }
        with _writing(self.path):
            write_file(self.path / STATE, (json.dumps(state, indent=1) + "\n").encode())

    def finish(self, step: str, figures: dict[str, Any]) -> None:
        """Keep the figures of a step that is done."""
        self.steps[step] = figures
        self.save()

    def want_more(self, presses: int) -> None:
        """After a bad verdict: forget it and its fresh presses, and ask for more presses to learn from."""
        self.extra_presses += presses
        for step in ("presses", "fit", "refused_checks"):
            self.steps.pop(step, None)
        self.checks.clear()
        self.save()

    def forget_grid(self) -> None:
        """Forget the pictures of the pin grid and what they told."""
        self.steps.pop("lens", None)
        self.grids.clear()
        self.save()

    def close(self) -> None:
        """The bundle is written: nothing is left to resume."""
        self.finished = True
        self.save()

    def keep_reference(self, image: NDArray[np.float32]) -> None:
        """Keep the mean of the untouched gel."""
        content = io.BytesIO()
        np.save(content, image)
        with _writing(self.path):
            write_file(self.path / _REFERENCE, content.getvalue())

    def reference(self) -> NDArray[np.float32]:
        """Return the mean of the untouched gel."""
        try:
            image: NDArray[np.float32] = np.load(self.path / _REFERENCE, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise BundleError(f"{self.path / _REFERENCE} is damaged ({error}): begin again") from error
        return image

    def add(self, kind: str, picture: Picture, circle: dict[str, float], **more: Any) -> dict[str, Any]:
        """Keep a picture of `KINDS`, a press with its circle; returns its record."""
        records = self._records(kind)
        number = 1 + max((record["number"] for record in records), default=0)
        record = {"number": number, "file": f"{kind}/press-{number:03d}.png", **circle, **more}
        with _writing(self.path):
            write_png(self.path / str(record["file"]), picture)
        records.append(record)
        self.save()
        return record

    def drop(self, kind: str, number: int) -> None:
        """Forget a press; InputError if there is none of that number."""
        records = self._records(kind)
        kept = [record for record in records if record["number"] != number]
        if len(kept) == len(records):
            raise InputError(f"there is no press {number} to drop")
        dropped = next(record for record in records if record["number"] == number)
        records[:] = kept
        self.save()
        (self.path / dropped["file"]).unlink(missing_ok=True)

    def listed(self, kind: str) -> list[Press]:
        """Return the presses of a kind as they are trained on and evaluated."""
        return [
            Press(
                image=self.path / record["file"],
                center_x_px=record["center_x_px"],
                center_y_px=record["center_y_px"],
                contact_radius_px=record["contact_radius_px"],
            )
            for record in self._records(kind)
        ]

    def _records(self, kind: str) -> list[dict[str, Any]]:
        return {"presses": self.presses, "checks": self.checks, "grids": self.grids}[kind]


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Say in words that the disk refuses something."""
    try:
        yield
    except OSError as error:
        raise BundleError(
            f"{path} cannot be written ({error.strerror or error}): free some space and go on; what was measured "
            "before is kept"
        ) from error


def _made(path: Path) -> None:
    try:
        make_folder(path)
    except OSError as error:
        raise InputError(f"folder {path} cannot be made ({error.strerror}): give another one") from error
