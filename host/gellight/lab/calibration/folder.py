"""The state of a calibration on disk: every figure, picture and press is there as soon as it is known.

state.json        what is done; it marks the folder as one of a calibration
reference.npy     (H, W, 3) float32, the mean of the untouched gel
presses/*.png     ball presses to train on
checks/*.png      fresh presses, never trained on
draft/            the bundle before it is verified
like/             the bundle of a like unit, whose presses are begun with

Each file is written whole or not at all, and is on the disk when the call that wrote it returns.
"""

import io
import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, GellightError, InputError, first_line
from gellight.base.writing import make_folder, write_file
from gellight.bundle.bundle import Bundle, save_bundle
from gellight.lab.calibration.display import Picture
from gellight.lab.calibration.records import CheckErrors, Circle, StepFigures
from gellight.lab.calibration.state import (
    DRAFT,
    KINDS,
    LIKE_UNIT,
    REFERENCE,
    STATE,
    CheckRecord,
    Identity,
    PressRecord,
    State,
    discard,
    kept_like,
    state_in,
    writing,
)
from gellight.lab.report.pictures import write_png
from gellight.lab.training.presses import Press

_Figures = TypeVar("_Figures", bound=StepFigures)
_Kept = TypeVar("_Kept", bound=PressRecord)


class Folder:
    """What one calibration has measured; whatever changes is on disk at once."""

    def __init__(self, path: Path, state: State) -> None:
        """Keep a state that was read or made; see `open`."""
        self.path = path
        self.state = state

    @classmethod
    def open(cls, path: Path, identity: Identity) -> Self:
        """Make the folder, or take up the calibration in it.

        Raises InputError where that one is of something else, or where a folder without a calibration holds files;
        BundleError for a damaged state. Then nothing is changed.
        """
        state = state_in(path)
        if state is None:
            _check_empty(path)
        elif state.finished:
            discard(path)
        else:
            _check_same(path, state.identity, identity)
        if state is None or state.finished:
            state = State(identity=identity)
        _drop_lost(path, state)
        for place in (path, *(path / kind for kind in KINDS)):
            try:
                make_folder(place)
            except OSError as error:
                raise InputError(f"folder {place} cannot be made ({error.strerror}): give another one") from error
        folder = cls(path, state)
        folder.save()
        return folder

    @property
    def draft(self) -> Path:
        """Where the bundle lies before it is verified."""
        return self.path / DRAFT

    def save(self) -> None:
        """Write the state; BundleError where the disk refuses it."""
        content = json.dumps(self.state.model_dump(mode="json", exclude_none=True), indent=1)
        with writing(self.path):
            write_file(self.path / STATE, (content + "\n").encode())

    def done(self, step: str) -> StepFigures | None:
        """Return the figures of a step by its name; None while it is not finished."""
        figures: StepFigures | None = getattr(self.state.steps, step)
        return figures

    def figures(self, kind: type[_Figures]) -> _Figures:
        """Return the figures of a finished step; GellightError where the step has not been done."""
        found = self.done(kind.step)
        if not isinstance(found, kind):
            raise GellightError(f"the step {kind.step} is missing in {self.path / STATE}: begin again")
        return found

    def finish(self, figures: StepFigures) -> None:
        """Keep the figures of a step that is done."""
        setattr(self.state.steps, figures.step, figures)
        self.save()

    def count_refused_check(self) -> int:
        """Count one more fresh press that was refused; returns how many there are."""
        self.state.steps.refused_checks += 1
        self.save()
        return self.state.steps.refused_checks

    def want_more(self, presses: int) -> None:
        """After a bad verdict: forget it and its fresh presses, and ask for more presses to learn from."""
        self.state.extra_presses += presses
        steps = self.state.steps
        steps.presses, steps.fit, steps.refused_checks = None, None, 0
        files = [check.file for check in self.state.checks]
        self.state.checks.clear()
        self.save()
        for file in files:  # what lay there unlisted would count as somebody else's
            (self.path / file).unlink(missing_ok=True)

    def close(self) -> None:
        """The bundle is written: nothing is left to resume."""
        self.state.finished = True
        self.save()

    def keep_like(self, given: Bundle | None) -> Bundle | None:
        """Keep the bundle of a like unit, unless None is given, and return the one that is kept.

        Raises InputError where the network is trained already with another one, or with none.
        """
        kept = kept_like(self.path)
        if given is None or (kept is not None and kept.identity == given.identity):
            return kept
        if self.state.steps.fit is not None:
            begun = f"with the presses of {kept.manifest.sensor}" if kept else "without another unit"
            raise InputError(
                f"the network in {self.path} is trained already, {begun}: go on with that, or begin anew to take those "
                f"of {given.manifest.sensor}"
            )
        return save_bundle(given, self.path / LIKE_UNIT, overwrite=True)

    def drop_like(self, least_presses: int) -> None:
        """Forget the bundle of the like unit; without it fewer presses than `least_presses` are not enough."""
        if len(self.state.presses) < least_presses:
            self.state.steps.presses = None
            self.save()
        shutil.rmtree(self.path / LIKE_UNIT)

    def keep_reference(self, image: NDArray[np.float32]) -> None:
        """Keep the mean of the untouched gel."""
        content = io.BytesIO()
        np.save(content, image)
        with writing(self.path):
            write_file(self.path / REFERENCE, content.getvalue())

    def reference(self) -> NDArray[np.float32]:
        """Return the mean of the untouched gel."""
        try:
            image: NDArray[np.float32] = np.load(self.path / REFERENCE, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise BundleError(f"{self.path / REFERENCE} is damaged ({first_line(error)}): begin again") from error
        return image

    def add_press(self, picture: Picture, circle: Circle) -> PressRecord:
        """Keep a ball press to train on."""
        return self._add("presses", self.state.presses, PressRecord, picture, **dict(circle))

    def add_check(self, picture: Picture, circle: Circle, errors: CheckErrors) -> CheckRecord:
        """Keep a fresh press."""
        return self._add("checks", self.state.checks, CheckRecord, picture, **dict(circle), figures=errors)

    def _add(self, kind: str, records: list[_Kept], make: type[_Kept], picture: Picture, **more: Any) -> _Kept:
        number = 1 + max((record.number for record in records), default=0)
        while (self.path / (file := f"{kind}/press-{number:03d}.png")).exists():
            number += 1  # somebody else's
        record = make(number=number, file=file, **more)
        records.append(record)
        # The state first: a file that lies there and is not in it would count as somebody else's for ever.
        self.save()
        with writing(self.path):
            write_png(self.path / record.file, picture)
        return record

    def drop_press(self, number: int) -> None:
        """Forget a press to train on; InputError if there is none of that number."""
        dropped = self._press(number)
        self.state.presses.remove(dropped)
        self.save()
        (self.path / dropped.file).unlink(missing_ok=True)

    def correct_press(self, number: int, circle: Circle) -> PressRecord:
        """Replace the circle of a press to train on by one that a hand drew."""
        old = self._press(number)
        corrected = old.model_copy(update={**dict(circle), "found": False})
        self.state.presses[self.state.presses.index(old)] = corrected
        self.save()
        return corrected

    def _press(self, number: int) -> PressRecord:
        for record in self.state.presses:
            if record.number == number:
                return record
        raise InputError(f"there is no press {number} to change")

    def presses(self) -> list[Press]:
        """Return the presses to train on."""
        return [record.press(self.path) for record in self.state.presses]


def _check_empty(path: Path) -> None:
    """Refuse a folder in which something lies that no calibration wrote; hidden files do not count."""
    found = sorted(entry.name for entry in path.iterdir() if not entry.name.startswith(".")) if path.is_dir() else []
    if found:
        raise InputError(
            f"folder {path} holds {found[0]!r} and no calibration: give a new or an empty folder to keep the "
            "calibration in; nothing was changed"
        )


def _check_same(path: Path, begun: Identity, wanted: Identity) -> None:
    for name, value in wanted:
        found = getattr(begun, name)
        if found != value and name == "picture":
            raise InputError(
                f"the calibration in {path} was begun with another view or other marker dots: give the same again, or "
                "begin anew"
            )
        if found != value:
            raise InputError(
                f"the calibration in {path} was begun with {name} {found}, not {value}: give the same again, or begin "
                "anew"
            )


def _drop_lost(path: Path, state: State) -> None:
    """Drop records whose picture is not there: the power failed, or the disk was full, between the two."""
    lists: Iterable[list[Any]] = (state.presses, state.checks)
    for records in lists:
        records[:] = [record for record in records if (path / record.file).is_file()]
