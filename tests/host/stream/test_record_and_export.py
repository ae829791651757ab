"""The verbs that record, replay and export, and what their files hold."""

import itertools
import json
import os
import re
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import Result

import gellight
from gellight.bundle.bundle import extend_bundle, load_bundle, packed_bundle
from gellight.frame_path import pipeline
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.report.pictures import encode_png
from gellight.reconstruction.native import library
from gellight.recording.array_files import STEP
from gellight.recording.frame_record import packed_picture
from gellight.recording.recording_file import Recording
from gellight.recording.replay_camera import open_replay
from tests.helpers import children
from tests.helpers.command_line import invoke, refused, succeeded
from tests.helpers.doc_examples import examples, run
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.places import CHECKOUT
from tests.helpers.ply import read_ply
from tests.helpers.weighed import force_files, weighed


def done_of(*words: object) -> Result:
    """Run `gellight` with these words in this process to its good end."""
    return succeeded(invoke(*words))


def test_pictures_take_two_fifths_of_their_bytes_at_most(recording: Path) -> None:
    """With the noise of the simulated camera, 1 grey level; nothing is lost."""
    images = [frame.image("a") for frame in Recording(recording).frames()]
    packed = [packed_picture(image) for image in images]
    assert sum(map(len, packed)) < 0.4 * sum(image.nbytes for image in images)
    read = [cv2.imdecode(np.frombuffer(one, np.uint8), cv2.IMREAD_COLOR_RGB) for one in packed]
    assert all(map(np.array_equal, read, images))


def test_a_replay_that_ends_before_its_frames_says_so_in_words(recording: Path) -> None:
    done = done_of("run", recording, "--frames", 999, "--no-dashboard")
    assert re.match(r"\d+ frames of 999: there were no more\.\n", done.stdout)
    assert re.search(r"deepest touch was (0\.9|1\.0)\d+ mm; the last frame feels 1\.\d\d \+- 0\.06 N\.", done.stdout)
    assert "{" not in done.stdout


def test_a_recording_is_exported_as_arrays_and_surfaces(recording: Path, tmp_path: Path) -> None:
    done = done_of("export", recording, "--out", tmp_path, "--every", 3, "--json")
    paths = sorted(tmp_path.glob("*.npz"))
    assert json.loads(done.stdout) == {"frames": len(paths), "whole": True}, done.stderr
    assert len(paths) == -(-len(list(Recording(recording).frames())) // 3)
    maps = np.load(paths[0])
    assert maps["depth_mm"].max() == pytest.approx(1.0, abs=0.05)
    done_of("export", recording, "--out", tmp_path, "--as", "ply", "--every", 1000)
    (surface,) = tmp_path.glob("*.ply")
    vertices, triangles, _ = read_ply(surface)
    assert (len(vertices["z"]), len(triangles)) == (307200, 2 * 639 * 479)
    assert vertices["z"].max() == pytest.approx(maps["depth_mm"].max(), abs=0.02)
    # Gel at the edge that bulges or sinks by micrometres is seen as much nearer to the axis, or farther.
    assert np.ptp(vertices["x"]) == pytest.approx(639 * gellight.load_bundle("synthetic").pixel_size_mm[0], 2e-4)


def test_a_recording_becomes_one_file_of_arrays(recording: Path, tmp_path: Path) -> None:
    reader = pytest.importorskip("h5py")
    done = done_of("export", recording, "--out", tmp_path, "--as", "hdf5", "--json")
    file = reader.File(tmp_path / "frames.h5")
    taken = list(Recording(recording).frames())
    assert file["image"].shape[0] == json.loads(done.stdout)["frames"] == len(taken)
    assert np.array_equal(file["image"][2], taken[2].image("a"))
    assert file["figures/unix_s"][:].tolist() == [frame.info.unix_s for frame in taken]
    camera_frame = CameraFrame(image=taken[2].image("a"), time_s=0.0, sequence=2)
    felt = gellight.Reconstructor(Recording(recording).bundle).reconstruct(camera_frame)
    assert np.abs(file["depth_mm"][2] - felt.depth_mm).max() <= STEP / 2 + 1e-7
    assert np.abs(file["gradient_map"][2] - felt.gradient_map).max() <= STEP / 2 + 1e-7
    assert np.array_equal(file["contact"][2], felt.contact.mask)
    assert file["figures/force_n"][2] == pytest.approx(felt.force.normal_n)
    assert file.attrs["depth_step_mm"] == STEP
    assert "frames.h5" in refused(invoke("export", recording, "--out", tmp_path, "--as", "hdf5"))


def test_an_episode_needs_lerobot_and_says_so(recording: Path, tmp_path: Path) -> None:
    why = refused(invoke("export", recording, "--out", tmp_path / "new", "--as", "lerobot"))
    assert "--as lerobot needs LeRobot" in why
    assert "./host/lerobot_camera_gellight" in why
    assert list(tmp_path.iterdir()) == []


def test_an_export_that_is_refused_leaves_no_folder(recording: Path, tmp_path: Path) -> None:
    """Nor a word of OpenCV's; a folder that was there stays."""
    (tmp_path / "mine").mkdir()
    for name in ("new", "mine"):
        why = refused(invoke("export", recording, "--as", "video", "--every", 999999, "--out", tmp_path / name))
        assert why.endswith("pictures a second make no video: leave out fewer frames")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_force_pressure_and_confidence_are_recorded_and_are_the_same_when_exported(tmp_path: Path) -> None:
    plain = linear_bundle(tmp_path / "plain")
    extend_bundle(plain, tmp_path / "bundle", force_files())
    press, pictures, out = weighed(0.5), tmp_path / "pictures", tmp_path / "press.mcap"
    pictures.mkdir()
    for number in range(6):
        cv2.imwrite(str(pictures / f"{number}.png"), press.picture(0.5, number)[..., ::-1])
    sensor = ("--sensor", str(pictures), "--calibration", str(tmp_path / "bundle"))
    done_of("record", *sensor, "--out", out, "--map", "pressure_mpa", "--map", "confidence")
    names = ("pressure_mpa", "confidence", "quality_flags")
    recorded = {name: {info.sequence: (info, image) for info, image in Recording(out).maps(name)} for name in names}
    assert list(Recording(out).depths()) == [], "not asked for"
    assert set(recorded["pressure_mpa"]) == set(recorded["confidence"]) == set(recorded["quality_flags"]) != set()
    done_of("export", out, "--out", tmp_path / "maps")
    for sequence, (info, image) in recorded["pressure_mpa"].items():
        assert info.force_n == pytest.approx(press.force_n, rel=0.1)
        assert np.frombuffer(image.data, "<f4").sum() * 0.05**2 == pytest.approx(info.force_n, rel=1e-3)
        with np.load(tmp_path / "maps" / f"{sequence:06}.npz") as maps:
            for name in names:
                assert maps[name].tobytes() == recorded[name][sequence][1].data, "bit for bit"
            assert (maps["force_n"], maps["force_error_n"]) == (info.force_n, info.force_error_n)
    plain_words = (*sensor[:2], "--calibration", tmp_path / "plain", "--out", tmp_path / "b.mcap")
    assert "force" in refused(invoke("record", *plain_words, "--map", "pressure_mpa"))
    assert not (tmp_path / "b.mcap").exists()


def test_a_recording_is_exported_as_pictures_and_as_a_video(recording: Path, tmp_path: Path) -> None:
    done_of("export", recording, "--out", tmp_path, "--as", "png", "--every", 1000)
    (picture,) = (cv2.imread(str(path)) for path in tmp_path.glob("*.png"))
    done_of("export", recording, "--out", tmp_path, "--as", "video", "--every", 2)
    video = cv2.VideoCapture(str(tmp_path / "video.mp4"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == -(-len(list(Recording(recording).frames())) // 2)
    assert video.read()[1].shape == picture.shape


def test_what_is_not_whole_is_exported_and_what_exists_is_not_recorded_over(recording: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    content = recording.read_bytes()
    cut.write_bytes(content[: content.rindex(b"\x0f\4" + bytes(7))])  # before the end of the data
    done = done_of("export", cut, "--out", tmp_path / "out", "--every", 6, "--json")
    assert json.loads(done.stdout)["whole"] is False
    assert "its recording was cut short" in done.stderr
    before = recording.read_bytes()
    assert recording.name in refused(invoke("record", "--sensor", "sim://", "--out", recording, "--seconds", 1))
    assert recording.read_bytes() == before


def test_the_verb_records_until_it_is_ended_and_then_finishes_the_file(tmp_path: Path) -> None:
    out = tmp_path / "new" / "a.mcap"
    url = "sim://?object=BALL&depth=0.5&fps=5"
    with children.started([*children.GELLIGHT, "record", "--sensor", url, "--out", out], stdout=-1, stderr=-1) as verb:
        while not out.exists() or out.stat().st_size < 4e6:
            assert verb.poll() is None, verb.stderr.read()
            time.sleep(0.1)
        os.kill(verb.pid, signal.SIGTERM)
        said, _ = verb.communicate(timeout=60)
        assert verb.returncode == 0
    assert b"a.mcap: " in said
    recorded = Recording(out)
    assert len(list(recorded.frames())) >= 3
    assert recorded.whole


def test_depth_computed_on_another_processor_keeps_to_the_stated_bound(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each library that runs here, and NumPy, stand for other machines: the worst pixel of any two is compared."""
    bound_um, of_numpy_um = map(
        float, re.findall(r"less than ([\d.]+)\smicrometres", (CHECKOUT / "docs/recording.md").read_text())
    )
    bundle, maps = Recording(recording).bundle, {}
    for name in (*library.fitting(), ""):
        if name:
            loaded = library.Library(library.library_file(name))
            monkeypatch.setattr(pipeline, "fitting_library", lambda found=(name, loaded): found)
        reconstructor = Reconstructor(bundle, native=bool(name))
        assert reconstructor.status()["computed_by"] == (f"C, {name}" if name else "NumPy")
        camera = open_replay(f"replay://{recording}?speed=0")
        maps[name] = [reconstructor.reconstruct(camera.read()).depth_mm for _ in range(3)]
    assert len(maps) > 1
    for one, other in itertools.combinations(maps, 2):
        worst_um = max(float(np.abs(a - b).max()) * 1e3 for a, b in zip(maps[one], maps[other], strict=True))
        assert worst_um < (bound_um if one and other else of_numpy_um)
    assert max(depth.max() for depth in maps[""]) > 0.9, "the ball is in it"


@pytest.mark.nightly
def test_the_program_in_the_documents_reads_a_recording(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "press.mcap").symlink_to(recording)
    (code,) = examples("docs/recording.md")
    run(code, "docs/recording.md")
    assert "/sim/depth" in capsys.readouterr().out


@pytest.mark.nightly
def test_the_first_block_of_the_page_runs_as_it_is_printed(tmp_path: Path) -> None:
    """But that it records two seconds and not twenty, and that the port of the page is a free one."""
    page = (CHECKOUT / "docs/recording.md").read_text()
    block = page.partition("```sh\n")[2].partition("```")[0].replace("--seconds 20", "--seconds 2")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "GELLIGHT_DASHBOARD_PORT": "0"}
    children.run(["bash", "-euc", block], cwd=tmp_path, env=environment, check=True)
    assert list((tmp_path / "press").glob("*.npz"))


@pytest.mark.parametrize("count", [1, 3])
def test_every_picture_of_a_folder_is_recorded_and_none_gets_the_bundle_of_another_sensor(
    tmp_path: Path, count: int
) -> None:
    for number in range(count):
        (tmp_path / f"{number}.png").write_bytes(encode_png(np.full((48, 64, 3), 40 * number + 40, np.uint8)))
    done = children.gellight(
        "record", "--sensor", tmp_path, "--out", tmp_path / "all.mcap", "--set", "stream.enabled=false", check=True
    )
    assert "these pictures have no bundle, so there is no depth: give that of their sensor by" in done.stderr
    recording = Recording(tmp_path / "all.mcap")
    assert [one.image("here")[0, 0, 0] for one in recording.frames()] == [40 * number + 40 for number in range(count)]
    assert not recording.bundle.calibrated


@pytest.mark.nightly
def test_a_recording_without_a_frame_is_refused_and_leaves_no_file(recording: Path, tmp_path: Path) -> None:
    slow, out = f"replay://{recording}?speed=0.002", tmp_path / "slow.mcap"
    done = children.gellight(
        "record", "--sensor", slow, "--out", str(out), "--seconds", "1", "--set", "stream.enabled=false"
    )
    assert (done.returncode, out.exists()) == (2, False), done.stderr
    assert "no frame came, so there is no" in done.stderr


def test_an_export_with_another_bundle_says_so_and_scales_by_it(recording: Path, tmp_path: Path) -> None:
    bundle = load_bundle("synthetic")
    wide = replace(bundle, manifest=bundle.manifest.model_copy(update={"pixel_size_mm": (0.1, 0.1)}))
    (tmp_path / "wide.gelcal").write_bytes(packed_bundle(wide))
    by = ["--calibration", str(tmp_path / "wide.gelcal"), "--every", "10"]
    for kind in ("hdf5", "ply"):
        assert children.gellight("export", str(recording), "--out", str(tmp_path), "--as", kind, *by).returncode == 0
    with pytest.importorskip("h5py").File(tmp_path / "frames.h5") as file:
        assert file.attrs["calibration"] == load_bundle(str(tmp_path / "wide.gelcal")).identity
        assert file.attrs["pixel_size_mm"].tolist() == [0.1, 0.1]
    (surface,) = tmp_path.glob("*.ply")
    x_mm = read_ply(surface)[0]["x"]
    assert np.ptp(x_mm) == pytest.approx(63.9, abs=0.02)
