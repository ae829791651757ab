"""Where the calibration bundles of all sensors of this computer are kept, the replaced ones too.

    <user data>/gellight/bundles/<sensor>/<identity>/     one bundle
    <user data>/gellight/bundles/<sensor>/in_service      identities, the one in service last

Both are flushed to the disk and written whole or not at all (`base/writing.py`), the bundle first. So a loss of power
leaves the old bundle or the new one in service.
"""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from urllib.parse import quote, unquote

import platformdirs

from gellight.base.errors import BundleError
from gellight.base.writing import write_file
from gellight.bundle.bundle import REPORT, Bundle, load_bundle, save_bundle

_HISTORY = "in_service"


@dataclass(frozen=True, kw_only=True)
class StoredBundle:
    """One bundle of the store."""

    sensor: str
    identity: str
    path: Path
    created: datetime | None
    """None where the bundle cannot be read any more"""
    in_service: bool
    problem: str = ""
    """why it cannot be read"""

    def load(self) -> Bundle:
        """Load and check it; BundleError where it was damaged."""
        return load_bundle(self.path)

    @property
    def has_report(self) -> bool:
        """Whether its calibration left a page that shows all that was measured."""
        return (self.path / REPORT).is_file()

    def report(self) -> bytes:
        """Return that page, HTML, as it was written; BundleError where there is none or it was changed."""
        files = self.load().files
        if REPORT not in files:
            raise BundleError(f"bundle {self.identity} has no report: only `gellight calibrate` writes one")
        return files[REPORT]

    def as_json(self) -> dict[str, object]:
        """Return it ready for JSON."""
        created = self.created.isoformat() if self.created else None
        return {**vars(self), "path": str(self.path), "created": created, "report": self.has_report}


class BundleStore:
    """The folder with the bundles of every sensor."""

    def __init__(self, folder: Path | None = None) -> None:
        """Use `folder`, or the user's; nothing is made before something is added."""
        self.folder = folder or platformdirs.user_data_path("gellight") / "bundles"

    def add(self, bundle: Bundle) -> StoredBundle:
        """Keep a bundle, not yet in service; one that is there already is kept as it is. Raises BundleError."""
        place = self._folder(bundle.manifest.sensor) / bundle.identity
        if not place.exists():
            save_bundle(bundle, place)
        return self._entry(bundle.manifest.sensor, place)

    def put_in_service(self, sensor: str, identity: str) -> StoredBundle:
        """Make a stored bundle the one of its sensor from now on; BundleError where it is not there or damaged."""
        chosen = self._named(sensor, identity)
        chosen.load()
        history = [known for known in self._history(sensor) if known != chosen.identity]
        text = "\n".join([*history, chosen.identity]) + "\n"
        try:
            write_file(self._folder(sensor) / _HISTORY, text.encode())
        except OSError as error:
            raise BundleError(
                f"{self._folder(sensor)} cannot be written ({error.strerror or error}): the old bundle stays in service"
            ) from error
        return self._named(sensor, chosen.identity)

    def bundles(self, sensor: str | None = None) -> list[StoredBundle]:
        """Return what is kept, of one sensor or of all, the oldest first; damaged bundles say so."""
        sensors = [sensor] if sensor is not None else self.sensors()
        found = [self._entry(name, place) for name in sensors for place in self._places(name)]
        return sorted(found, key=lambda entry: (entry.sensor, entry.created is None, str(entry.created)))

    def sensors(self) -> list[str]:
        """Names of the sensors that have bundles."""
        if not self.folder.is_dir():
            return []
        return sorted(unquote(place.name) for place in self.folder.iterdir() if place.is_dir())

    def current(self, sensor: str) -> StoredBundle:
        """Return the bundle in service; BundleError where the sensor has none."""
        history = self._history(sensor)
        if not history:
            raise BundleError(f"sensor {sensor!r} has no calibration bundle on this computer: run `gellight calibrate`")
        return self._named(sensor, history[-1])

    def previous(self, sensor: str) -> StoredBundle:
        """Return the bundle that was in service before; BundleError where there is none."""
        history = self._history(sensor)
        if len(history) < 2:
            raise BundleError(f"sensor {sensor!r} had no other bundle before: `gellight calibrate list` shows all")
        return self._named(sensor, history[-2])

    def find(self, identity: str) -> StoredBundle:
        """Return the bundle with an identity, or its beginning, of any sensor; BundleError unless there is one."""
        found = [entry for entry in self.bundles() if identity and entry.identity.startswith(identity.lower())]
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
        return self._entry(sensor, place)

    def _entry(self, sensor: str, place: Path) -> StoredBundle:
        history = self._history(sensor)
        in_service = bool(history) and history[-1] == place.name
        try:
            created, problem = load_bundle(place).manifest.created, ""
        except BundleError as error:
            created, problem = None, str(error)
        return StoredBundle(
            sensor=sensor, identity=place.name, path=place, created=created, in_service=in_service, problem=problem
        )

    def _places(self, sensor: str) -> list[Path]:
        folder = self._folder(sensor)
        return sorted(p for p in folder.iterdir() if p.is_dir() and p.name[0] != ".") if folder.is_dir() else []

    def _history(self, sensor: str) -> list[str]:
        place = self._folder(sensor) / _HISTORY
        return place.read_text(encoding="utf-8").split() if place.is_file() else []

    def _folder(self, sensor: str) -> Path:
        # A name of dots would be another folder.
        return self.folder / quote(sensor, safe="").replace(".", "%2E")
