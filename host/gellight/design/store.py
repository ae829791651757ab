"""Results of tasks on disk, one file each, named by the key of the task: a sweep can go on where it stopped."""

import hashlib
import json
import logging
from pathlib import Path
from typing import Any

import platformdirs

from gellight.base.errors import InputError
from gellight.base.writing import write_file

logger = logging.getLogger(__name__)


def default_folder() -> Path:
    """Return the folder in the user's cache where results are kept by default."""
    return platformdirs.user_cache_path("gellight") / "optimize"


class ResultStore:
    """A folder of results; each file is written whole or not at all."""

    def __init__(self, folder: Path) -> None:
        """Use `folder`, made if need be; raises InputError if that is impossible."""
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"results cannot be kept in {folder} ({error.strerror}): choose another --store"
            ) from error

    def path(self, key: str) -> Path:
        """Return the file of a result."""
        return self.folder / f"{key}.json"

    def get(self, key: str) -> Any | None:
        """Return a result, or None where there is none; a file that is damaged is reported and counts as none."""
        path = self.path(key)
        try:
            envelope = json.loads(path.read_bytes())
            if envelope["key"] == key and envelope["sha256"] == _digest(envelope["result"]):
                return envelope["result"]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError):
            pass
        logger.warning("%s is damaged: computing it again", path)
        return None

    def put(self, key: str, result: Any) -> None:
        """Keep a result that JSON can hold; raises InputError if it cannot be written."""
        envelope = {"key": key, "sha256": _digest(result), "result": result}
        try:
            write_file(self.path(key), json.dumps(envelope).encode())
        except OSError as error:
            raise InputError(
                f"{self.path(key)} cannot be written ({error.strerror}): free some space, or choose another --store"
            ) from error


def _digest(result: Any) -> str:
    return hashlib.sha256(json.dumps(result).encode()).hexdigest()
