"""Where the calibration bundles of all sensors of this computer are kept, the replaced ones too.

    <user data>/gellight/bundles/<sensor>/<identity>/     one bundle
    <user data>/gellight/bundles/<sensor>/in_service      identities, the one in service last

Both are flushed to the disk and written whole or not at all (`base/writing.py`), the bundle first. So a loss of power
leaves the old bundle or the new one in service.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Self
from urllib.parse import quote, unquote

import platformdirs
from pydantic import BaseModel, ConfigDict

from gellight.base.errors import BundleError
from gellight.base.writing import write_file
from gellight.bundle.bundle import REPORT, Bundle, load_bundle, save_bundle

_HISTORY = "in_service"
_Stamp = tuple[tuple[str, int, int, int], ...]
"""name, size, time of change (ns) and inode of each file: another stamp means that a file changed"""


@dataclass(frozen=True, kw_only=True)
class StoredBundle:
    """The place of one bundle in the store; the bundle itself was not read for it."""

    sensor: str
    identity: str
    path: Path

    def load(self) -> Bundle:
        """Load and check it; BundleError where it was damaged."""
        return load_bundle(self.path)

    def report(self) -> bytes:
        """Return the page that its calibration wrote, HTML; BundleError where there is none or it was changed."""
        files = self.load().files
        if REPORT not in files:
            raise BundleError(f"bundle {self.identity} has no report: only `gellight calibrate` writes one")
        return files[REPORT]


class ListedBundle(BaseModel):
    """What a list shows of one bundle of the store."""

    model_config = ConfigDict(frozen=True)

    sensor: str
    name: str = ""
    """what people call the sensor"""
    identity: str
    path: Path
    created: datetime | None = None
    """None where the bundle cannot be read any more"""
    in_service: bool = False
    problem: str = ""
    """why it cannot be read"""
    report: bool
    """whether its calibration left a page that shows all that was measured"""

    @classmethod
    def of(cls, stored: StoredBundle, bundle: Bundle, *, in_service: bool) -> Self:
        """Return what is shown of a stored bundle that was loaded."""
        created, report = bundle.manifest.created, REPORT in bundle.files
        return cls(**vars(stored), name=bundle.manifest.name, created=created, report=report, in_service=in_service)


class BundleStore:
    """The folder with the bundles of every sensor."""

    def __init__(self, folder: Path | None = None) -> None:
        """Use `folder`, or the user's; nothing is made before something is added."""
        self.folder = folder or platformdirs.user_data_path("gellight") / "bundles"
        self._known: dict[Path, tuple[_Stamp, ListedBundle]] = {}
        """what was found the last time"""

    def add(self, bundle: Bundle) -> StoredBundle:
        """Keep a bundle, not yet in service, unless it is there and undamaged; raises BundleError."""
        place = self._folder(bundle.manifest.sensor) / bundle.identity
        stored = StoredBundle(sensor=bundle.manifest.sensor, identity=bundle.identity, path=place)
        if not place.exists() or self._listed(stored).problem:
            saved = save_bundle(bundle, place, overwrite=True)
            self._known[place] = _stamp(place), ListedBundle.of(stored, saved, in_service=False)
        return stored

    def put_in_service(self, chosen: StoredBundle) -> None:
        """Make a stored bundle, which the caller has loaded, the one of its sensor from now on. Raises BundleError."""
        history = [known for known in self.history(chosen.sensor) if known != chosen.identity]
        self.write_history(chosen.sensor, [*history, chosen.identity])

    def history(self, sensor: str) -> list[str]:
        """Return the identities of the bundles that were in service, each once, the one that is last."""
        place = self._folder(sensor) / _HISTORY
        return place.read_text(encoding="utf-8").split() if place.is_file() else []

    def write_history(self, sensor: str, identities: Sequence[str]) -> None:
        """Replace the history of a sensor by another one; BundleError where the disk refuses it."""
        if self.history(sensor) == list(identities):
            return
        try:
            write_file(self._folder(sensor) / _HISTORY, "".join(f"{identity}\n" for identity in identities).encode())
        except OSError as error:
            raise BundleError(
                f"{self._folder(sensor)} cannot be written ({error.strerror or error}): free some space or check its "
                "permissions, and try again"
            ) from error

    def bundles(self, sensor: str | None = None) -> list[ListedBundle]:
        """Return what is kept, of one sensor or of all, the oldest first; damaged bundles say so.

        A bundle is read again only after one of its files has changed.
        """
        found = [self._listed(stored) for stored in self._stored(sensor)]
        return sorted(found, key=lambda entry: (entry.sensor, entry.created is None, str(entry.created)))

    def sensors(self) -> list[str]:
        """Names of the sensors that have bundles."""
        return sorted(unquote(place.name) for place in self.folder.glob("*/") if place.is_dir())

    def current(self, sensor: str) -> StoredBundle:
        """Return the bundle in service; BundleError where the sensor has none."""
        history = self.history(sensor)
        if not history:
            raise BundleError(f"sensor {sensor!r} has no calibration bundle on this computer: run `gellight calibrate`")
        return self._named(sensor, history[-1])

    def previous(self, sensor: str) -> StoredBundle:
        """Return the bundle that was in service before; BundleError where there is none."""
        history = self.history(sensor)
        if len(history) < 2:
            raise BundleError(f"sensor {sensor!r} had no other bundle before: `gellight calibrate list` shows all")
        return self._named(sensor, history[-2])

    def find(self, identity: str) -> StoredBundle:
        """Return the bundle with an identity, or its beginning, of any sensor; BundleError unless there is one."""
        found = [stored for stored in self._stored() if identity and stored.identity.startswith(identity.lower())]
        if len(found) != 1:
            what = "no bundle" if not found else f"{len(found)} bundles"
            raise BundleError(f"{what} of identity {identity!r} in {self.folder}: see `gellight calibrate list`")
        return found[0]

    def _named(self, sensor: str, identity: str) -> StoredBundle:
        place = self._folder(sensor) / identity
        if not place.is_dir():
            raise BundleError(
                f"bundle {identity} of sensor {sensor!r} is not in {self.folder}: see `gellight calibrate list`"
            )
        return StoredBundle(sensor=sensor, identity=identity, path=place)

    def _stored(self, sensor: str | None = None) -> list[StoredBundle]:
        return [
            StoredBundle(sensor=name, identity=place.name, path=place)
            for name in ([sensor] if sensor is not None else self.sensors())
            for place in sorted(self._folder(name).glob("[!.]*"))
            if place.is_dir()
        ]

    def _listed(self, stored: StoredBundle) -> ListedBundle:
        stamp, known = _stamp(stored.path), self._known.get(stored.path)
        if known is None or known[0] != stamp:
            self._known[stored.path] = known = stamp, _read(stored)
        return known[1].model_copy(update={"in_service": self.history(stored.sensor)[-1:] == [stored.identity]})

    def _folder(self, sensor: str) -> Path:
        # A name of dots would be another folder.
        return self.folder / quote(sensor, safe="").replace(".", "%2E")


def _read(stored: StoredBundle) -> ListedBundle:
    try:
        return ListedBundle.of(stored, stored.load(), in_service=False)
    except BundleError as error:
        return ListedBundle(**vars(stored), problem=str(error), report=(stored.path / REPORT).is_file())


def _stamp(place: Path) -> _Stamp:
    found = ((path.name, path.stat()) for path in place.iterdir())
    return tuple(sorted((name, facts.st_size, facts.st_mtime_ns, facts.st_ino) for name, facts in found))
