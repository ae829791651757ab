"""Fetch pictures of real sensors that tests use and may not be passed on: `python -m tests.data.fetch [SET ...]`.

They come from the public repositories of those who took them, one file after the other, into tests/data/fetched. What
is there already and right stays, so a fetch that was cut off is begun again. Each file must have the checksum of
tests/data/sources.json. Labels are written as the tests read them. Nobody says that you may pass any of it on.
"""

import argparse
import csv
import hashlib
import http.client
import io
import json
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gellight.base.writing import write_file
from tests.helpers.places import CHECKOUT, FETCHED

SOURCES: dict[str, dict[str, Any]] = json.loads((CHECKOUT / "tests/data/sources.json").read_text())
GITHUB = "https://raw.githubusercontent.com/"
PATIENCE_S, TRIES, PAUSE_S = 20.0, 3, 1.0
TICK_S = 10.0
"""between lines that say how far it is"""
FIELDS = "image", "center_x_px", "center_y_px", "contact_radius_px"


class FetchError(Exception):
    """What could not be fetched, in one line."""


class Circle(NamedTuple):
    """One row of labels."""

    image: str
    x: int
    y: int
    radius: int


class Source:
    """A server that has what GitHub has."""

    def __init__(self, url: str, pause_s: float = PAUSE_S) -> None:
        """Ask the server at this URL; pause_s: before it is asked again for what it did not deliver."""
        self._url, self._pause_s = url.rstrip("/") + "/", pause_s

    def read(self, path: str) -> bytes:
        """Return a file; FetchError where it is not there or the server does not answer."""
        for attempt in range(TRIES):
            try:
                with urllib.request.urlopen(self._url + path, timeout=PATIENCE_S) as answer:
                    return bytes(answer.read())
            except urllib.error.HTTPError as error:
                if error.code < 500:
                    raise FetchError(f"{self._url}{path}: {error.code} {error.reason}") from error
                reason = f"{error.code} {error.reason}"
            except (OSError, http.client.HTTPException) as error:
                reason = str(getattr(error, "reason", error))
            time.sleep(self._pause_s * (attempt + 1) if attempt + 1 < TRIES else 0)
        raise FetchError(f"{self._url} does not answer ({reason}): what was fetched stays; try again with a network")


def fetch(name: str, source: Source, into: Path, said: Callable[[str], None] = print) -> int:
    """Fetch what is missing of a set; returns how many files that were. FetchError for what could not be fetched."""
    known, folder, fetched = SOURCES[name], into / name, 0
    missing = {local: one for local, one in known["files"].items() if not _is_right(folder / local, one[1])}
    folder.mkdir(parents=True, exist_ok=True)
    next_s = time.monotonic() + TICK_S
    for local, (paths, digest) in missing.items():
        if local.endswith(".csv"):
            contents = [_labels(known, [source.read(known["base"] + path) for path in paths])]
        else:
            contents = _each(source, [known["base"] + path for path in paths])
        right = next((one for one in contents if hashlib.sha256(one).hexdigest() == digest), None)
        if right is None:
            where = f"{known['base']}{paths[0]}"
            raise FetchError(f"{name}/{local} is not what {where} was: its checksum is another; nothing was written")
        write_file(folder / local, right)
        fetched += 1
        if time.monotonic() > next_s:
            said(f"{name}: {fetched} of {len(missing)} files")
            next_s = time.monotonic() + TICK_S
    return fetched


def _each(source: Source, paths: Sequence[str]) -> list[bytes]:
    """Read all of several places where a file may lie that are there."""
    found: list[bytes] = []
    for number, path in enumerate(paths):
        try:
            found.append(source.read(path))
        except FetchError:
            if number + 1 == len(paths) and not found:
                raise
    return found


def _is_right(path: Path, digest: str) -> bool:
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == digest


def _labels(known: dict[str, Any], contents: Sequence[bytes]) -> bytes:
    """Return circles as the tests read them, of the pictures that are fetched."""
    pictures = {local for local in known["files"] if not local.endswith(".csv")}
    try:
        circles = [one for one in READERS[known["labels"]](contents) if one.image in pictures]
    except (ValueError, KeyError, OSError, UnicodeDecodeError) as error:
        raise FetchError(f"{known['base']}: its labels cannot be read ({error})") from error
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n" if known["labels"] == "npz" else "\r\n").writerows([FIELDS, *circles])
    return text.getvalue().encode()


def _of_annotations(contents: Sequence[bytes]) -> list[Circle]:
    rows = list(csv.reader(contents[0].decode().splitlines()))[1:]
    return [Circle(Path(name).name, int(x), int(y), int(radius)) for name, x, y, radius in rows]


def _of_arrays(contents: Sequence[bytes]) -> list[Circle]:
    found = []
    for number, content in enumerate(contents):
        with np.load(io.BytesIO(content), allow_pickle=False) as label:
            x, y = label["center"].astype(int).tolist()
            found.append(Circle(f"{number:04}.png", x, y, int(label["radius"])))
    return found


def _of_text(contents: Sequence[bytes]) -> list[Circle]:
    rows = [content.decode().split() for content in contents]
    return [Circle(f"ball-{number}.jpg", int(x), int(y), int(radius)) for number, (x, y, radius) in enumerate(rows)]


READERS = {"annotations": _of_annotations, "npz": _of_arrays, "text": _of_text}


def main(arguments: Sequence[str] | None = None) -> int:
    """Fetch the named sets, or all; returns 0, or 2 where something could not be fetched."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"of {', '.join(SOURCES)}; all where none is named")
    parser.add_argument("--from", dest="url", default=GITHUB, help="a server that has the same files (%(default)s)")
    parser.add_argument("--into", type=Path, default=FETCHED, help="tests look in %(default)s")
    given = parser.parse_args(arguments)
    for name in given.sets or SOURCES:
        if name not in SOURCES:
            parser.error(f"{name!r} is none of {', '.join(SOURCES)}")
    for name in given.sets or SOURCES:
        print(f"{name}: licence: {SOURCES[name]['licence']}", flush=True)
        try:
            fetched = fetch(name, Source(given.url), given.into)
        except (FetchError, OSError) as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
        print(f"{name}: {fetched} files fetched, {len(SOURCES[name]['files'])} there", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
