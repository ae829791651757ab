"""Fetch pictures of real sensors that tests use and may not be passed on: `python -m tests.data.fetch [SET ...]`.

They come from the public repositories of those who took them, one file after the other, into tests/data/fetched. What
is there already and right stays, so a fetch that was cut off is begun again. Each file must have the checksum of
tests/data/sources.json. Labels are written as the tests read them. Nobody says that you may pass any of it on.
"""

import argparse
import csv
import hashlib
import io
import json
import sys
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gellight.base.writing import write_file
from tests.helpers.places import CHECKOUT, FETCHED

SOURCES: dict[str, dict[str, Any]] = json.loads((CHECKOUT / "tests/data/sources.json").read_text())
GITHUB = "https://raw.githubusercontent.com/"
PATIENCE_S = 20.0
Read = Callable[[str], bytes]
"""what returns a file of GitHub by its path, and raises OSError where it is not there"""
FIELDS = "image", "center_x_px", "center_y_px", "contact_radius_px"


class Circle(NamedTuple):
    """One row of labels."""

    image: str
    x: int
    y: int
    radius: int


def from_github(path: str) -> bytes:
    """Return a file of a public repository. Raises OSError."""
    with urllib.request.urlopen(GITHUB + path, timeout=PATIENCE_S) as answer:
        return bytes(answer.read())


def fetch(name: str, into: Path, read: Read = from_github) -> int:
    """Fetch what is missing of a set; returns how many files that were. OSError or ValueError for what is not there."""
    known, folder, fetched = SOURCES[name], into / name, 0
    folder.mkdir(parents=True, exist_ok=True)
    for local, (paths, digest) in known["files"].items():
        if (folder / local).is_file() and _digest((folder / local).read_bytes()) == digest:
            continue
        places = [known["base"] + path for path in paths]
        contents = _labels(known, places, read) if local.endswith(".csv") else _each(places, read)
        right = next((one for one in contents if _digest(one) == digest), None)
        if right is None:
            raise ValueError(f"{name}/{local} is not what {places[0]} was: its checksum is another")
        write_file(folder / local, right)
        fetched += 1
    return fetched


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _each(places: Sequence[str], read: Read) -> Iterator[bytes]:
    """Yield what lies at several places where a file may be."""
    for place in places:
        try:
            yield read(place)
        except OSError:
            if place == places[-1]:
                raise


def _labels(known: dict[str, Any], places: Sequence[str], read: Read) -> Iterator[bytes]:
    """Yield circles as the tests read them, of the pictures that are fetched."""
    circles = READERS[known["labels"]]([read(place) for place in places])
    text = io.StringIO(newline="")
    rows = csv.writer(text, lineterminator="\n" if known["labels"] == "npz" else "\r\n")
    rows.writerows([FIELDS, *(one for one in circles if one.image in known["files"])])
    yield text.getvalue().encode()


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


def main() -> int:
    """Fetch the named sets, or all; returns 0, or 2 where something could not be fetched."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", metavar="SET", help=f"of {', '.join(SOURCES)}; all where none is named")
    sets = parser.parse_args().sets or [*SOURCES]
    if unknown := {*sets} - {*SOURCES}:
        parser.error(f"{', '.join(unknown)}: none of {', '.join(SOURCES)}")
    for name in sets:
        print(f"{name}: licence: {SOURCES[name]['licence']}", flush=True)
        try:
            print(f"{name}: {fetch(name, FETCHED)} of {len(SOURCES[name]['files'])} files fetched", flush=True)
        except (OSError, ValueError, KeyError) as error:
            print(f"{name}: {error}: what was fetched stays; try again with a network", file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
