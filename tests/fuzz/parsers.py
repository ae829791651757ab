"""Every parser of bytes from outside, with a sound input, and the errors by which it may refuse others."""

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from gellight.base.errors import BoardError, GellightError, InputError
from gellight.base.settings import read_settings
from gellight.bundle.bundle import REFERENCE, Bundle, load_bundle, packed_bundle, unpack_bundle
from gellight.bundle.manifest import manifest_toml, parse_manifest
from gellight.daemon.calls import read_call, read_json
from gellight.dashboard.access import cookie
from gellight.dashboard.application import Credit
from gellight.frames import picture
from gellight.frames.dots import Dots
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.frames.image_files import read_image
from gellight.frames.jpeg import CorruptPictureError
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View
from gellight.photometric import lights_file
from gellight.reconstruction.lens import undistortion
from gellight.reconstruction.network_session import NetworkSession
from gellight.recording.recording_file import Recording, RecordingWriter
from gellight.ring import protocol
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import Packet, decode, encode
from gellight.sensor.v4l2.formats import Mode
from gellight.sensor.v4l2.formats import decode as decode_picture
from gellight.stream import wire
from tests.fuzz.of_users import of_networks, of_other_files, of_tables, of_urls
from tests.fuzz.parser import Parser, by_file
from tests.helpers.linear_sensor import linear_bundle, reference_image
from tests.helpers.streamed import full_frame
from tests.helpers.v4l2_pictures import coded_jpeg

SHAPE = (24, 32)
_MEMORY = Path("/dev/shm")


class _Deaf:
    """A transport for replies that were made up."""

    url = "fuzz"

    def __init__(self, content: bytes) -> None:
        self.content = content

    def write(self, data: bytes) -> None: ...

    def read(self, timeout_s: float) -> bytes:
        content, self.content = self.content, b""
        return content

    def close(self) -> None: ...


def _answered(content: bytes) -> None:
    """Say hello to a board that answers this, and take what it sends by itself; the checksums are made right."""
    body, *others = content.split(b"|")
    reply = encode(Packet(protocol.COMMANDS["HELLO"].code | protocol.REPLY, 1, body[:100]))
    events = b"".join(encode(Packet(other[0], 0, other[1:100])) for other in others if other)
    LightRing(_Deaf(events + reply), timeout_s=0.0, attempts=1, keep_alive_s=None)


@contextmanager
def parsers() -> Iterator[tuple[Parser, ...]]:
    """Yield them all; files lie in a folder that is removed, in memory where the system has a place for that."""
    with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as name:
        folder = Path(name)
        bundle = linear_bundle(folder / "bundle", SHAPE)
        yield (
            *_of_the_board(),
            *_of_the_bundle(bundle),
            *_of_files(folder, bundle),
            *_of_programs(),
            *_of_pictures(folder),
            *of_tables(folder),
            *of_other_files(folder, bundle),
            *of_urls(),
            *of_networks(),
        )


def _of_the_board() -> Iterator[Parser]:
    blank = protocol.HelloReply.unpack(b"\0" * protocol.HelloReply.codec().size)
    hello = replace(blank, protocol_major=protocol.VERSION[0], protocol_minor=protocol.VERSION[1])
    reply = b"\0" * 5 + hello.pack()  # status, value, record
    events = [bytes([code]) + b"\0" * record.codec().size for code, record in protocol.EVENTS.values()]
    yield Parser("packet", decode, (encode(Packet(1, 2, b"abc")).strip(b"\0"),), (ValueError,))
    yield Parser("board", _answered, (reply, b"|".join([reply, *events])), (BoardError,))


def _of_the_bundle(bundle: Bundle) -> Iterator[Parser]:
    """Yield that of a whole bundle, and of each file in it as if its checksum were right."""
    refusals = (GellightError,)

    def inside(name: str, read: Callable[[Bundle], object]) -> Callable[[bytes], object]:
        return lambda content: read(replace(bundle, files={**bundle.files, name: content}))

    manifest = manifest_toml(bundle.manifest)
    yield Parser("bundle", lambda content: unpack_bundle(content, "fuzz"), (packed_bundle(bundle),), refusals)
    yield Parser("manifest", lambda content: parse_manifest(content, "fuzz"), (manifest,), refusals)
    yield Parser("network", _network, (bundle.network,), refusals)
    reference = inside(REFERENCE, lambda changed: changed.reference)
    yield Parser("reference", reference, (bundle.files[REFERENCE],), refusals)
    yield Parser("lens", inside(undistortion.FILE_NAME, undistortion.LensRecord.in_bundle), (_lens(),), refusals)
    yield Parser("lights", inside(lights_file.FILE_NAME, lights_file.read_lights), (_lights(),), refusals)
    view = View.of_corners(((2, 3), (29, 2), (30, 21), (1, 22)), SHAPE, SHAPE)
    steps = PictureSteps.of(SHAPE, view, Dots(diameter_px=5, darker_grey=20, count=9))
    assert steps
    yield Parser("picture", inside(picture.FILE_NAME, PictureSteps.in_bundle), tuple(steps.files().values()), refusals)


def _of_files(folder: Path, bundle: Bundle) -> Iterator[Parser]:
    recording, settings = _recording(folder, bundle), b"[sensor]\nurl = 'sim://'\n[dashboard]\nport = 1\n"
    yield Parser("recording", by_file(folder, ".mcap", _play), (recording,), (GellightError,))
    yield Parser("settings", by_file(folder, ".toml", read_settings), (settings,), (GellightError,))


def _of_programs() -> Iterator[Parser]:
    """Yield those of what other programs and the page send."""
    press = b'{"type":"press","object":"BALL","depth_mm":1,"x_mm":0,"y_mm":0}'
    frame = wire.encode(full_frame())
    yield Parser("frame", lambda content: wire.decode(content, _no_bundle), (frame,), (GellightError,))
    yield Parser("call", read_call, (b'{"type":"status"}', press), (GellightError, ValueError))
    yield Parser("command", partial(read_json, Credit), (b'{"count":1}',), (InputError,))
    yield Parser("host", lambda content: cookie(content.decode("latin-1")), (b"127.0.0.1:8420", b"[::1]:80"), ())


def _of_pictures(folder: Path) -> Iterator[Parser]:
    image = np.clip(reference_image(SHAPE), 0, 255).astype(np.uint8)
    coded = {suffix: cv2.imencode(suffix, image)[1].tobytes() for suffix in (".png", ".jpg", ".bmp", ".tiff")}
    for suffix, sound in coded.items():
        yield Parser(f"image{suffix}", by_file(folder, suffix, read_image), (sound,), (GellightError,))
    mode = Mode(letters="MJPG", width=SHAPE[1], height=SHAPE[0], fps=30.0, line_bytes=0)
    sound = coded[".jpg"], coded_jpeg(image, restart=2)
    yield Parser("mjpg", lambda content: decode_picture(content, mode), sound, (CorruptPictureError,))


def _lens() -> bytes:
    record = undistortion.LensRecord(
        image_width_px=SHAPE[1], image_height_px=SHAPE[0], centre_px=(16.0, 12.0), k1=-0.1, k2=0.01,
        px_per_mm=(20.0, 0.0, 20.0), origin_mm=(0.0, 0.0), learnt_from_circles=False, pitch_mm=1.0, images=("a.png",),
        pins=20, rms_before_px=1.0, rms_after_px=0.1, created=datetime(2026, 1, 1, tzinfo=UTC),
    )  # fmt: skip
    return record.model_dump_json().encode()


def _lights() -> bytes:
    """Those of the simulated sensor, of this size, each light the same all over."""
    record = json.loads(load_bundle("synthetic").files[lights_file.FILE_NAME])
    patterns = {kind: [[led[0][:1]] for led in leds] for kind, leds in record["patterns"].items()}
    size = {"image_width_px": SHAPE[1], "image_height_px": SHAPE[0]}
    return json.dumps({**record, **size, "patterns": patterns}).encode()


def _no_bundle(zero: str) -> Bundle:
    raise AssertionError("nothing asks for it")


def _network(content: bytes) -> None:
    session = NetworkSession(content, source="fuzz")
    session.slopes_and_jacobian(np.zeros((2, 5), np.float32))


def _play(path: Path) -> None:
    recording = Recording(path)
    for record in recording.frames():
        record.image("fuzz")
    list(recording.depths())


def _recording(folder: Path, bundle: Bundle) -> bytes:
    path = folder / "sound.mcap"
    with RecordingWriter(path, "fuzz") as writer:
        for number in range(2):
            frame = CameraFrame(image=np.full((*SHAPE, 3), number, np.uint8), time_s=number, sequence=number)
            writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + number))
    content = path.read_bytes()
    path.unlink()
    return content
