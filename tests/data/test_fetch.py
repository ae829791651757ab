"""Pictures are fetched from a mirror on this computer: whole, once, and never wrong ones."""

import csv
import hashlib
import io
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from tests.data import fetch
from tests.helpers.places import real

SETS = tuple(fetch.SOURCES)


class Mirror:
    """A server that has files, counts what is asked for, and can fail."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.asked: list[str] = []
        mirror = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                name = self.path.lstrip("/")
                mirror.asked.append(name)
                if name not in mirror.files:
                    self.send_error(404)
                else:
                    content = mirror.files[name]
                    self.send_response(200)
                    self.send_header("Content-Length", str(len(content)))
                    self.end_headers()
                    self.wfile.write(content)

            def log_message(self, *words: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture
def mirror(monkeypatch: pytest.MonkeyPatch) -> Iterator[Mirror]:
    """A mirror of a set of two pictures and the circles of one."""
    found = Mirror()
    pictures = {"0001.png": b"one", "0002.png": b"two"}
    table = b"image,center_x_px,center_y_px,contact_radius_px\r\n0001.png,5,6,7\r\n"
    files = {name: [[f"a/{name}"], hashlib.sha256(content).hexdigest()] for name, content in pictures.items()}
    files["presses.csv"] = [["a/all.csv"], hashlib.sha256(table).hexdigest()]
    known = {"licence": "none", "base": "who/what/", "labels": "annotations", "files": files}
    monkeypatch.setattr(fetch, "SOURCES", {"few": known})
    found.files = {f"who/what/a/{name}": content for name, content in pictures.items()}
    found.files["who/what/a/all.csv"] = b"name,x,y,radius\n/home/me/0001.png,5,6,7\n/x/0009.png,1,2,3\n"
    monkeypatch.setattr(fetch, "PAUSE_S", 0.0)
    yield found
    found.server.shutdown()
    found.server.server_close()


def run(mirror: Mirror, into: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    ended = fetch.main(["--from", mirror.url, "--into", str(into)])
    return ended, *capsys.readouterr()


def test_a_set_is_fetched_whole_and_its_circles_are_of_its_pictures_alone(
    mirror: Mirror, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(mirror, tmp_path, capsys) == (0, "few: licence: none\nfew: 3 files fetched, 3 there\n", "")
    assert (tmp_path / "few/0002.png").read_bytes() == b"two"
    assert (tmp_path / "few/presses.csv").read_text().splitlines()[1:] == ["0001.png,5,6,7"]


def test_what_is_there_is_not_asked_for_again_and_what_is_damaged_is(
    mirror: Mirror, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(mirror, tmp_path, capsys)
    mirror.asked.clear()
    (tmp_path / "few/0001.png").write_bytes(b"on")
    assert run(mirror, tmp_path, capsys)[1].endswith("few: 1 files fetched, 3 there\n")
    assert mirror.asked == ["who/what/a/0001.png"]


def test_a_fetch_that_was_cut_off_keeps_what_it_has(
    mirror: Mirror, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    second = mirror.files.pop("who/what/a/0002.png")
    ended, _, error = run(mirror, tmp_path, capsys)
    assert (ended, error.count("\n")) == (2, 1)
    assert "0002.png: 404 Not Found" in error
    mirror.files["who/what/a/0002.png"] = second
    assert run(mirror, tmp_path, capsys)[1].endswith("few: 2 files fetched, 3 there\n")


@pytest.mark.parametrize("name", ["0002.png", "all.csv"])
def test_what_has_another_checksum_is_not_written(
    mirror: Mirror, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    mirror.files[f"who/what/a/{name}"] += b"/home/me/0002.png,1,2,3\n"
    ended, _, error = run(mirror, tmp_path, capsys)
    assert (ended, error.count("\n")) == (2, 1)
    assert "its checksum is another; nothing was written" in error
    assert {path.name for path in (tmp_path / "few").iterdir()} <= {"0001.png", "0002.png"} - {name}


def test_without_a_network_it_says_so_in_one_line(
    mirror: Mirror, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mirror.server.shutdown()
    mirror.server.server_close()
    ended, _, error = run(mirror, tmp_path, capsys)
    assert (ended, error.count("\n")) == (2, 1)
    assert "does not answer (" in error
    assert "try again with a network" in error


@pytest.mark.real_images(*SETS)
@pytest.mark.parametrize("name", SETS)
def test_the_real_sets_come_out_of_their_sources_as_the_tests_know_them(
    mirror: Mirror, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The mirror has the pictures as they are here, and their labels as their sources write them."""
    known = json.loads((Path(fetch.__file__).parent / "sources.json").read_text())
    monkeypatch.setattr(fetch, "SOURCES", known)
    for local, (paths, _) in known[name]["files"].items():
        content = (real(name) / local).read_bytes()
        places = [known[name]["base"] + path for path in paths]
        mirror.files |= labels_of(known[name]["labels"], content, places) if local.endswith(".csv") else {
            places[-1]: content
        }  # fmt: skip
    assert fetch.fetch(name, fetch.Source(mirror.url, 0.0), tmp_path) == len(known[name]["files"])
    for path in (tmp_path / name).iterdir():
        assert path.read_bytes() == (real(name) / path.name).read_bytes()


def labels_of(kind: str, content: bytes, places: list[str]) -> dict[str, bytes]:
    """Circles as their sources write them."""
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
