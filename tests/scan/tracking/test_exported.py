"""The motion of what slid in a recording: by `gellight export --track`, and as docs/tracking.md types it."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CaptureStamp
from gellight.opening import open_camera
from gellight.recording.recording_file import RecordingWriter
from tests.helpers.children import gellight, run
from tests.helpers.command_line import invoke, refused
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT

SLID_MM = 0.2
STEPS = [[0.8, 0, 0, 0, 0, 0], [0.8, SLID_MM, 0, 0, 0, 0]]
DOCUMENT = "docs/tracking.md"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames of a relief that slides to and fro along x."""
    folder = tmp_path_factory.mktemp("slid")
    (folder / "slide.json").write_text(json.dumps({"object": "CCONVEX", "within_mm": 8, "steps": STEPS}))
    bundle = load_bundle("synthetic")
    with (
        open_camera(f"sim://?board=0&sequence={folder / 'slide.json'}") as camera,
        RecordingWriter(folder / "slide.mcap", "sim") as writer,
    ):
        for number in range(7):  # at times of our own: a busy computer would leave gaps in which an object is lost
            frame = replace(camera.read(), time_s=number / 4, sequence=number)
            writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + frame.time_s))
    return folder / "slide.mcap"


def slid(motions: np.ndarray) -> None:
    """Whether (N, 4, 4) motions are those of the object: at rest, and a slide along x, whichever frame was first."""
    assert len(motions) >= 6
    x = motions[:, 0, 3]
    assert np.ptp(x) == pytest.approx(SLID_MM, abs=0.01)
    assert np.minimum(np.abs(x), np.abs(np.abs(x) - SLID_MM)).max() < 0.01
    assert np.abs(motions[:, :3, :3] - np.eye(3)).max() < 0.005


def test_the_arrays_have_the_motion_where_it_is_asked_for(recording: Path, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    for name, more in (("asked", ["--track"]), ("plain", [])):
        assert invoke("export", recording, "--out", tmp_path / name, "--as", "hdf5", *more).exit_code == 0
    with h5py.File(tmp_path / "asked/frames.h5") as file:
        assert set(file["figures/object"][:]) == {1}
        slid(file["figures/motion"][:])
        assert np.isfinite(file["figures/motion_covariance"][:]).all()
    with h5py.File(tmp_path / "plain/frames.h5") as file:
        assert set(file["figures/object"][:]) == {0}


def test_a_kind_without_a_place_for_the_pose_is_refused(recording: Path, tmp_path: Path) -> None:
    said = refused(invoke("export", recording, "--out", tmp_path / "out", "--as", "ply", "--track"))
    assert "--as ply has no place for a pose: take one of hdf5, lerobot" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.nightly
def test_the_sequence_is_simulated_and_the_program_tells_where_the_object_is(tmp_path: Path) -> None:
    (tmp_path / "peg.json").write_text(examples(DOCUMENT, "json")[0])
    command = re.search(r"^gellight (simulate sequence .*)$", (CHECKOUT / DOCUMENT).read_text(), re.MULTILINE)
    assert command
    done = gellight(*command[1].split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "peg").iterdir()) == [
        "00000.png", "00001.png", "00002.png", "poses.csv",
    ]  # fmt: skip
    program = (
        examples(DOCUMENT)[0].replace("sim://", "sim://?board=0&sequence=peg.json").replace("range(100)", "range(3)")
    )
    assert "peg.json" in program
    done = run([sys.executable, "-c", program], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("object 1 at (")
