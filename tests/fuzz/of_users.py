"""Parsers of what users bring and what comes over a network: tables, solids, maps, states, URLs, requests, notes."""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from aiohttp import web
from aiohttp.test_utils import make_mocked_request

from gellight.base.allowed import query_of
from gellight.base.errors import GellightError
from gellight.bundle.bundle import METRICS, Bundle
from gellight.bundle.contents import npz
from gellight.dashboard.access import guard
from gellight.frames.point_cloud import solid_stl
from gellight.lab.calibration.force.record import ForceReadings
from gellight.lab.calibration.state import STATE, state_in
from gellight.lab.simulator.sequence import read_sequence
from gellight.lab.simulator.simulated_url import SimulatedUrl
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.presses import Ball
from gellight.reconstruction.force_file import FILE_NAME as FORCE_FILE
from gellight.reconstruction.force_file import ForceRecord
from gellight.recording.ros_messages import RosImage, decode_compressed, decode_string, encode_compressed, encode_string
from gellight.ring.firmware import image as firmware
from gellight.sensor.v4l2.options import parse_url
from gellight.stream.shared_memory import FrameMemory, MappedMemory, OverwrittenError
from gellight.stream.subscription import endpoint_and_name, read_status
from gellight_design.simulating.solids import height_map, read_stl
from gellight_scan.height_map import HeightMap, load_height_map
from sim_reference.geometry import SensorGeometry
from tests.fuzz.parser import Parser, by_file
from tests.helpers.begun_calibration import begun_in
from tests.helpers.places import CHECKOUT

SHAPE = (24, 32)
OWN = (GellightError,)
LABELS = b"image,center_x_px,center_y_px,contact_radius_px,quality\na.png,12,11,4.5,0.9\n"
FORCES = (b"image,force_n\na.png,1\n", b"unix_s,force_n,object\n1,0,BALL\n2,1.5,BALL\n")
SEQUENCE = b'{"object": "PEG", "within_mm": 2, "steps": [[0.5, 0, 0, 0, 0, 10], null]}'
FORCE = {
    "gel_thickness_mm": 2, "poisson_ratio": 0.48, "youngs_modulus_mpa": 0.2, "error_share": 0.1, "error_floor_n": 0.1,
    "lightest_n": 0.1, "heaviest_n": 9, "readings": 5, "source": "a.csv", "created": "2026-01-01T00:00:00Z",
}  # fmt: skip
REQUEST = b"127.0.0.1:8420\n/?token=secret\nOrigin: http://127.0.0.1:8420\nCookie: gellight-token-8420=secret\n"
URLS = (b"v4l2://0?width=640&height=480&format=MJPG", b"sim://?object=BALL&depth=1", b"zenoh://[::1]:7447/a%20b")


def of_tables(folder: Path) -> Iterator[Parser]:
    """Yield those of tables and what else a user writes by hand."""
    cv2.imwrite(str(folder / "a.png"), np.zeros((*SHAPE, 3), np.uint8))
    ball = Ball(radius_mm=4.0, pixel_size_mm=0.5)
    labels = by_file(folder, "-labels.csv", lambda path: read_presses(path, ball=ball, image_shape=SHAPE))
    yield Parser("labels", labels, (LABELS,), OWN)
    yield Parser("forces", by_file(folder, "-forces.csv", ForceReadings.read), FORCES, OWN)
    sequence = by_file(folder, "-sequence.json", lambda path: read_sequence(path, SensorGeometry()).presses)
    yield Parser("sequence", sequence, (SEQUENCE,), OWN)


def of_other_files(folder: Path, bundle: Bundle) -> Iterator[Parser]:
    """Yield those of solids, maps, a begun calibration, firmware, and the force of a bundle."""
    solid = solid_stl(np.array([[0.0, 1.0], [1.0, 2.0]]), 1.0, floor_mm=-1.0)
    yield Parser(
        "stl", lambda content: height_map(read_stl(content), 16, 0.5), (solid, _text_stl(solid)), (ValueError,)
    )
    HeightMap(np.ones((3, 4), np.float32), np.ones((3, 4), np.float32), 0.1).save(folder / "sound.npz")
    sound = (folder / "sound.npz").read_bytes()
    yield Parser("heights", by_file(folder, ".npz", load_height_map), (sound,), OWN)
    begun_in(folder / "begun").save()
    state = (folder / "begun" / STATE).read_bytes()
    yield Parser("state", lambda content: _resumed(folder / "begun", content), (state,), OWN)
    uf2 = (CHECKOUT / "host/gellight/ring/firmware/gellight-rp2040.uf2").read_bytes()
    yield Parser("uf2", lambda content: firmware.from_uf2(_numbered(content)), (_numbered(uf2[: 512 * 3]),), OWN)
    force = json.dumps(FORCE).encode()
    yield Parser("force", lambda content: _force(bundle, content), (force,), OWN)
    yield Parser("metrics", lambda content: _with(bundle, METRICS, content).metrics, (b'{"a": {"b": 1.5}}',), OWN)
    arrays = npz({"a": np.ones((2, 3), np.float32)})
    yield Parser("presses", lambda content: _with(bundle, "presses.npz", content).presses(), (arrays,), OWN)


def of_urls() -> Iterator[Parser]:
    """Yield those of URLs, each of which a URL of any kind is given to."""
    for name, read, url in zip(("url", "sim", "zenoh"), (parse_url, _simulated, endpoint_and_name), URLS, strict=True):
        yield Parser(name, lambda content, read=read: read(content.decode("utf-8", "replace")), (url,), OWN)


def of_networks() -> Iterator[Parser]:
    """Yield those of requests, notes, answers and messages that come over a network."""
    yield Parser("request", _request, (REQUEST, REQUEST.replace(b"?token=secret", b"?a=1")), (web.HTTPException,))
    memory = FrameMemory()
    note = memory.write([b"a message"])
    reader = MappedMemory(memory.path)
    yield Parser("note", lambda content: (memory, reader.read(content))[1], (note,), (GellightError, OverwrittenError))
    yield Parser("status", lambda content: read_status(content, "A17"), (b'{"error": null}',), OWN)
    image = RosImage(height=1, width=2, encoding="rgb8", step=6, data=b"abcdef").encode(1.5, "a")
    yield Parser("ros-image", RosImage.decode, (image,), (ValueError,))
    yield Parser("ros-packed", decode_compressed, (encode_compressed(b"abc", 1.5, "a", "png"),), (ValueError,))
    yield Parser("ros-text", decode_string, (encode_string("a"),), (ValueError,))


def _resumed(folder: Path, content: bytes) -> None:
    (folder / STATE).write_bytes(content)
    state_in(folder)


def _with(bundle: Bundle, name: str, content: bytes) -> Bundle:
    """Return the bundle with a file that holds this, as if its checksum were right."""
    return replace(bundle, files={**bundle.files, name: content})


def _force(bundle: Bundle, content: bytes) -> None:
    record = ForceRecord.in_bundle(_with(bundle, FORCE_FILE, content))
    assert record is not None
    assert record.layer is not None


def _simulated(url: str) -> None:
    wanted = query_of(url, SimulatedUrl)
    wanted.response()
    wanted.printed()


def _request(content: bytes) -> None:
    """Ask for a page, with and without a token: host, path and headers are a line each, as a server has them."""
    host, path, *headers = [*content.decode("latin-1").split("\n"), ""]
    named = [(name, value.strip()) for name, colon, value in (line.partition(":") for line in headers) if colon]
    request = make_mocked_request("GET", f"/{path.lstrip('/')}", {**dict(named), "Host": host})

    async def page(_: web.Request) -> web.Response:
        return web.Response(text="the page")

    for token in ("", "secret"):
        with suppress(StopIteration):
            guard(token)(request, page).send(None)


def _numbered(uf2: bytes) -> bytes:
    """Return a UF2 file with the count of its blocks right in each."""
    count = (len(uf2) // 512).to_bytes(4, "little")
    blocks = [uf2[at : at + 512] for at in range(0, len(uf2), 512)]
    return b"".join(block[:24] + count + block[28:] if len(block) == 512 else block for block in blocks)


def _text_stl(binary: bytes) -> bytes:
    """Return a binary STL as text."""
    numbers = np.frombuffer(binary, np.dtype([("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("no", "<u2")]), offset=84)
    words = ["solid a"]
    for at in numbers["at"]:
        words += ["facet normal 0 0 1", "outer loop", *(f"vertex {x:g} {y:g} {z:g}" for x, y, z in at), "endloop"]
    return "\n".join([*words, "endsolid a"]).encode()
