"""Bundles from a stranger that would fill the memory, never end, or hold what they say not: each is refused by name."""

import hashlib
import io
import os
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import load_bundle
from gellight.bundle.contents import MOST_BYTES
from gellight.bundle.manifest import MOST_BYTES as MOST_OF_A_MANIFEST
from tests.helpers.children import run
from tests.helpers.linear_sensor import linear_bundle

LOAD = """
import resource, sys
from pathlib import Path
from gellight.base.errors import GellightError
from gellight.bundle.bundle import load_bundle
from gellight.photometric.directions import LightDirections
taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + (1 << 30), resource.RLIM_INFINITY))
for place in sys.argv[1:]:
    try:
        bundle = load_bundle(place)
        if "directions.npz" in bundle.files:
            LightDirections.of_content(bundle.files["directions.npz"], "directions.npz")
        print(bundle.presses())
    except GellightError as error:
        print(str(error).splitlines()[0])
"""


def huge_png(width: int, height: int) -> bytes:
    """A picture of that size, black, in a few bytes of 16-bit RGB; only its first rows are there."""
    head = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    rows = zlib.compress(bytes((6 * width + 1) * 4), 9)
    parts = [(b"IHDR", head), (b"IDAT", rows), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


@cache
def table_bomb() -> bytes:
    """Arrays of 640 MB in less than 1 MB."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("rows.npy", "w") as member:
        np.lib.format.write_array_header_1_0(
            member, {"descr": "|u1", "fortran_order": False, "shape": (640 << 20,)}
        )  # fmt: skip
        for _ in range(640):
            member.write(bytes(1 << 20))
    return content.getvalue()


def png(*shape: int, kind: type = np.uint16) -> bytes:
    return bytes(cv2.imencode(".png", np.zeros(shape, kind))[1].tobytes())


def liar() -> bytes:
    """A table that says it had 10^13 numbers."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive, archive.open("rows.npy", "w") as member:
        np.lib.format.write_array_header_1_0(
            member, {"descr": "<f8", "fortran_order": False, "shape": (10**13,)}
        )  # fmt: skip
    return content.getvalue()


def seal(bundle: Path, name: str, content: bytes) -> None:
    """Put a file into a bundle, and its checksum into the manifest."""
    manifest, digest = bundle / "manifest.toml", hashlib.sha256(content).hexdigest()
    old = hashlib.sha256((bundle / name).read_bytes()).hexdigest() if (bundle / name).exists() else None
    (bundle / name).write_bytes(content)
    text = manifest.read_text()
    manifest.write_text(text.replace(*((old, digest) if old else ("[files]\n", f'[files]\n"{name}" = "{digest}"\n'))))


def sealed(name: str, content: bytes | Callable[[], bytes]) -> Callable[[Path], object]:
    return lambda bundle: seal(bundle, name, content if isinstance(content, bytes) else content())


def manifest(text: str) -> Callable[[Path], object]:
    return lambda bundle: (bundle / "manifest.toml").write_text(text)


def with_code() -> bytes:
    content = io.BytesIO()
    np.savez(content, rows=np.array([os.system], dtype=object))
    return content.getvalue()


def picture_and_manifest_of_gigabytes(bundle: Path) -> None:
    seal(bundle, "reference.png", huge_png(30_000, 30_000))
    text = (bundle / "manifest.toml").read_text()
    (bundle / "manifest.toml").write_text(text.replace("px = 32", "px = 30000").replace("px = 24", "px = 30000"))


def picture_with_a_chunk_of_gigabytes(bundle: Path) -> None:
    """As a fuzzer found it: OpenCV makes room for what a chunk claims to be."""
    content = (bundle / "reference.png").read_bytes()
    seal(bundle, "reference.png", content[:33] + b"\xff\xf5\xb7\x49" + content[37:])


def endless_device(bundle: Path) -> None:
    (bundle / "network.onnx").unlink()
    (bundle / "network.onnx").symlink_to("/dev/zero")


def pipe(bundle: Path) -> None:
    (bundle / "network.onnx").unlink()
    os.mkfifo(bundle / "network.onnx")


HOSTILE: list[tuple[Callable[[Path], object], str]] = [
    (
        sealed("reference.png", huge_png(30_000, 30_000)),
        "reference.png is 30000 x 30000 px, the manifest says 32 x 24",
    ),
    (picture_and_manifest_of_gigabytes, "image_width_px = 30000 is not allowed: give a number at most 8192"),
    (picture_with_a_chunk_of_gigabytes, "reference.png is not a 16-bit RGB PNG"),
    (sealed("presses.npz", table_bomb), "presses.npz cannot be read (it unpacks to 671 MB, allowed are 537)"),
    (sealed("presses.npz", liar()), "presses.npz cannot be read"),
    (sealed("presses.npz", with_code()), "presses.npz cannot be read (Object arrays cannot be loaded"),
    (sealed("directions.npz", table_bomb), "directions.npz holds no lights (it unpacks to 671 MB"),
    (sealed("metrics.json", b"[" * 200_000), "metrics.json: it is no JSON"),
    (manifest("a = " + "[" * 100_000), "manifest.toml is not TOML"),
    (manifest("#" * (MOST_OF_A_MANIFEST + 1)), "manifest.toml is not TOML (it has 1048577 bytes"),
    (endless_device, "network.onnx cannot be read (it is no regular file)"),
    (pipe, "network.onnx cannot be read (it is no regular file)"),
    (lambda bundle: os.truncate(bundle / "metrics.json", MOST_BYTES + 1), "metrics.json cannot be read (it has 537 MB"),
    *(
        (sealed("reference.png", content), "reference.png is not a 16-bit RGB PNG")
        for content in (png(24, 32, 3, kind=np.uint8), png(24, 32), png(24, 32, 4), b"", b"no image")
    ),
    (sealed("metrics.json", b"{"), "metrics.json: it is no JSON"),
    (sealed("metrics.json", b"[]"), "metrics.json: it = [] is not allowed: give an object"),
    (sealed("metrics.json", b'{"verification": [1]}'), "verification = [1] is not allowed: give an object"),
    (sealed("metrics.json", b'{"pattern_match": "high"}'), "pattern_match = 'high' is not allowed: give a number"),
    (sealed("metrics.json", b'{"pattern_match": NaN}'), "pattern_match = nan is not allowed: give a finite number"),
    (sealed("metrics.json", b'{"learnt_on_other_units": 5}'), "learnt_on_other_units = 5 is not allowed: give"),
]


def test_each_is_refused_within_a_gigabyte(tmp_path: Path) -> None:
    for number, (make_hostile, _) in enumerate(HOSTILE):
        linear_bundle(tmp_path / f"{number}", (24, 32))
        make_hostile(tmp_path / f"{number}")
    places = [tmp_path / f"{number}" for number in range(len(HOSTILE))]
    done = run([sys.executable, "-c", LOAD, *places], timeout_s=300)
    assert done.stderr == ""
    for (_, reason), said in zip(HOSTILE, done.stdout.splitlines(), strict=True):
        assert reason in said


def test_a_packed_bundle_that_lies_about_its_size_is_read_no_further(tmp_path: Path) -> None:
    """The directory of the archive says 9 bytes; what is packed would be more."""
    packed = tmp_path / "liar.gelcal"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.toml", bytes(64 << 20))
    content = bytearray(packed.read_bytes())
    for signature, place in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        at = content.index(signature) + place
        content[at : at + 4] = (9).to_bytes(4, "little")
    packed.write_bytes(content)
    with pytest.raises(BundleError, match=r"manifest\.toml cannot be read"):
        load_bundle(packed)


@pytest.mark.parametrize("place", ["/dev/zero", "pipe"])
def test_what_never_ends_is_no_bundle(place: str, tmp_path: Path) -> None:
    if place == "pipe":
        os.mkfifo(tmp_path / place)
    with pytest.raises(BundleError, match="is a pipe or a device: give a folder or a"):
        load_bundle(tmp_path / place)
