"""What a fault meets: acts that write files, how each begins, and how to tell that its files are whole."""

import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.store import BundleStore
from gellight.cli import export, service
from gellight.daemon.installing import install
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.frames.image_files import read_image
from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.records import Circle
from gellight.recording.kinds import Kind
from gellight.recording.recording_file import Recording, RecordingWriter
from tests.helpers.begun_calibration import identity
from tests.helpers.linear_sensor import photograph, verified_bundle

SHAPE = (48, 64)
SENSOR = "GL-7"
FRAMES = 8


@dataclass(frozen=True)
class Writer:
    """An act that writes into a folder, its home."""

    name: str
    begin: Callable[[Path], None]
    """makes what is there before"""
    act: Callable[[Path], None]
    """once more, after a fault, it has to work"""
    judge: Callable[[Path], None]
    """raises where something is neither old nor new, by whatever reads it"""
    weight: int = 1
    """how often it is drawn"""


def bundles(folder: Path) -> tuple[Bundle, Bundle]:
    """Return two bundles of one sensor, in a folder that no fault meets."""
    return load_bundle(folder / "old"), load_bundle(folder / "new")


def prepare(folder: Path) -> None:
    """Write what acts read: two bundles, and a recording."""
    old = verified_bundle(folder / "old", sensor=SENSOR, shape=SHAPE)
    verified_bundle(folder / "new", sensor=SENSOR, shape=SHAPE, rgb=(9, 9, 9))
    with RecordingWriter(folder / "sound.mcap", SENSOR) as writer:
        for frame in frames():
            writer.add(frame, CaptureStamp(zeroed=old, unix_s=1e9 + frame.sequence))


def frames() -> list[CameraFrame]:
    """Return some camera frames, the same each time."""
    random, one = np.random.default_rng(1), photograph(np.zeros((*SHAPE, 2)))
    images = [np.clip(one.image + random.normal(0, 9, one.image.shape), 0, 255).astype(np.uint8) for _ in range(FRAMES)]
    return [replace(one, image=image, sequence=number, time_s=number / 30) for number, image in enumerate(images)]


def writers(sources: Path) -> tuple[Writer, ...]:
    """Return them all; `sources`: what `prepare` wrote."""
    old, new = bundles(sources)

    def installing(home: Path) -> None:
        install(new, sensor=SENSOR, store=BundleStore(home / "bundles"))

    def installed(home: Path) -> None:
        store = BundleStore(home / "bundles")
        assert store.current(SENSOR).load().identity in (old.identity, new.identity)
        assert [one.problem for one in store.bundles()] == [""] * len(store.bundles())

    def recording(home: Path) -> None:
        path = home / f"{len(list(home.glob('*.mcap')))}.mcap"
        with _naming(path), RecordingWriter(path, SENSOR) as writer:
            _record(writer, old)

    def exporting(kind: Kind) -> Callable[[Path], None]:
        return lambda home: export.command(sources / "sound.mcap", home / "out", kind)

    exports = {"npz": _npz_whole, "hdf5": _hdf5_whole, "video": _video_whole}
    return (
        Writer("installing", lambda home: _put(old, home), installing, installed, 4),
        Writer("calibrating", lambda home: _calibrate(home, 1), lambda home: _calibrate(home, 3), _calibrated, 4),
        Writer("recording", lambda home: None, recording, _recorded, 3),
        Writer("saving", lambda home: _save("auto", home), lambda home: _save("sim://", home), _saved, 2),
        *(Writer(f"exporting {kind}", lambda home: None, exporting(Kind(kind)), whole)
          for kind, whole in exports.items()),
    )  # fmt: skip


def _record(writer: RecordingWriter, bundle: Bundle) -> None:
    for frame in frames():
        writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + frame.sequence))
        writer.flush()


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the file in an error of the disk, as the recorder of a stream does."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error


def _put(bundle: Bundle, home: Path) -> None:
    store = BundleStore(home / "bundles")
    store.put_in_service(store.add(bundle))


def _calibrate(home: Path, presses: int) -> None:
    """Begin a calibration, or take it up; keep some more presses."""
    folder = Folder.open(home / "calibration", identity())
    folder.keep_reference(np.ones((*SHAPE, 3), np.float32))
    for _ in range(presses):
        circle = Circle(center_x_px=20.0, center_y_px=20.0, contact_radius_px=5.0)
        folder.add_press(photograph(np.zeros((*SHAPE, 2))).image, circle)


def _calibrated(home: Path) -> None:
    folder = Folder.open(home / "calibration", identity())
    assert folder.presses()
    assert all(read_image(press.image).shape[:2] == SHAPE for press in folder.presses())
    assert folder.reference().shape[:2] == SHAPE


def _recorded(home: Path) -> None:
    """Every frame that is there is as it was taken, from the first on; a file without a header says so."""
    for path in home.glob("*.mcap"):
        found = _recording(path)
        if found is None:
            continue
        for record, frame in zip(found.frames(), frames(), strict=False):
            assert (record.image("judge") == frame.image).all()


def _recording(path: Path) -> Recording | None:
    """Return a recording; None where it ended before its first frame, which is said."""
    try:
        return Recording(path)
    except InputError as error:
        if "no recording" not in str(error) and "no frames" not in str(error):
            raise
        return None


def _save(sensor: str, home: Path) -> None:
    """Write the settings of a service, the one file of settings that the program writes itself."""
    os.environ["XDG_CONFIG_HOME"] = str(home)
    with redirect_stdout(io.StringIO()):
        service.install(sensor, None, 8420, overwrite=True, show=False)


def _saved(home: Path) -> None:
    for path in (home / "systemd/user").glob("[!.]*"):
        assert path.read_text().rstrip().endswith("WantedBy=default.target"), path.read_text()


def _npz_whole(home: Path) -> None:
    for path in (home / "out").glob("[!.]*.npz"):
        with np.load(path) as file:
            assert file["depth_mm"].shape == SHAPE


def _hdf5_whole(home: Path) -> None:
    import h5py

    if (home / "out/frames.h5").exists():
        with h5py.File(home / "out/frames.h5") as file:
            assert file["figures/sequence"].shape == (FRAMES,)
            assert file["depth_mm"][-1].shape == SHAPE


def _video_whole(home: Path) -> None:
    import cv2

    if (home / "out/video.mp4").exists():
        video, count = cv2.VideoCapture(str(home / "out/video.mp4")), 0
        while video.read()[0]:
            count += 1
        assert count == FRAMES, count
