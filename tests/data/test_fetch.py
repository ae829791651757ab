"""Pictures are fetched whole, once, and never wrong ones."""

import csv
import hashlib
import io
from pathlib import Path

import numpy as np
import pytest

from tests.data import fetch
from tests.helpers.places import real

SETS = tuple(fetch.SOURCES)


class Mirror:
    """A place that has files, and remembers what is asked for."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.asked: list[str] = []

    def read(self, path: str) -> bytes:
        self.asked.append(path)
        if path not in self.files:
            raise OSError(f"{path}: not found")
        return self.files[path]


@pytest.fixture
def mirror(monkeypatch: pytest.MonkeyPatch) -> Mirror:
    """A mirror of a set of two pictures and the circles of one."""
    found = Mirror()
    pictures = {"0001.png": b"one", "0002.png": b"two"}
    table = b"image,center_x_px,center_y_px,contact_radius_px\r\n0001.png,5,6,7\r\n"
    files = {name: [[f"a/{name}"], hashlib.sha256(content).hexdigest()] for name, content in pictures.items()}
    files["presses.csv"] = [["a/all.csv"], hashlib.sha256(table).hexdigest()]
    known = {"licence": "none", "base": "who/what/", "labels": "annotations", "files": files}
    monkeypatch.setitem(fetch.SOURCES, "few", known)
    found.files = {f"who/what/a/{name}": content for name, content in pictures.items()}
    found.files["who/what/a/all.csv"] = b"name,x,y,radius\n/home/me/0001.png,5,6,7\n/x/0009.png,1,2,3\n"
    return found


def test_a_set_is_fetched_whole_and_what_is_there_is_not_asked_for_again(mirror: Mirror, tmp_path: Path) -> None:
    second = mirror.files.pop("who/what/a/0002.png")
    with pytest.raises(OSError, match=r"0002\.png: not found"):
        fetch.fetch("few", tmp_path, mirror.read)
    mirror.files["who/what/a/0002.png"] = second
    assert fetch.fetch("few", tmp_path, mirror.read) == 2, "what was fetched before it was cut off stays"
    assert (tmp_path / "few/0002.png").read_bytes() == b"two"
    assert (tmp_path / "few/presses.csv").read_text().splitlines()[1:] == ["0001.png,5,6,7"], "of its pictures alone"
    mirror.asked.clear()
    (tmp_path / "few/0001.png").write_bytes(b"on")
    assert fetch.fetch("few", tmp_path, mirror.read) == 1
    assert mirror.asked == ["who/what/a/0001.png"]


@pytest.mark.parametrize("name", ["0002.png", "all.csv"])
def test_what_has_another_checksum_is_not_written(mirror: Mirror, tmp_path: Path, name: str) -> None:
    mirror.files[f"who/what/a/{name}"] += b"/home/me/0002.png,1,2,3\n"
    with pytest.raises(ValueError, match="its checksum is another"):
        fetch.fetch("few", tmp_path, mirror.read)
    assert {path.name for path in (tmp_path / "few").iterdir()} <= {"0001.png", "0002.png"} - {name}


@pytest.mark.real_images(*SETS)
@pytest.mark.parametrize("name", SETS)
def test_the_real_sets_come_out_of_their_sources_as_the_tests_know_them(tmp_path: Path, name: str) -> None:
    """The mirror has the pictures as they are here, and their labels as their sources write them."""
    known, mirror = fetch.SOURCES[name], Mirror()
    for local, (paths, _) in known["files"].items():
        content, places = (real(name) / local).read_bytes(), [known["base"] + path for path in paths]
        mirror.files |= labels_of(known["labels"], content, places) if local.endswith(".csv") else {places[-1]: content}
    assert fetch.fetch(name, tmp_path, mirror.read) == len(known["files"])
    for path in (tmp_path / name).iterdir():
        assert path.read_bytes() == (real(name) / path.name).read_bytes()


def labels_of(kind: str, content: bytes, places: list[str]) -> dict[str, bytes]:
    rows = list(csv.reader(content.decode().splitlines()))[1:]
    if kind == "annotations":
        lines = ["img_names,center_x,center_y,radius", *(f"/home/x/{','.join(row)}" for row in rows)]
        return {places[0]: "\n".join(lines).encode()}
    if kind == "text":
        return {place: " ".join(row[1:]).encode() for place, row in zip(places, rows, strict=True)}
    found = {}
    for place, (_, x, y, radius) in zip(places, rows, strict=True):
        file = io.BytesIO()
        np.savez(file, center=np.array([int(x), int(y)]), radius=int(radius))
        found[place] = file.getvalue()
    return found
