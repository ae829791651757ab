"""The plug-in against LeRobot 0.6.1 itself: found by its name, made by its factories, with its exceptions and units."""

import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

import gellight
from gellight.bundle.bundle import extend_bundle
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.reconstruction.measures import BundleMeasures
from gellight.recording.recording_file import Recording, RecordingWriter
from gellight.stream.publisher import Publisher
from tests.helpers.children import run
from tests.helpers.lerobot_packages import lerobot_environment
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.places import CHECKOUT
from tests.helpers.streamed import SHAPE, BumpReconstructor, bump_daemon
from tests.helpers.weighed import force_files, weighed

pytestmark = pytest.mark.nightly
READER = CHECKOUT / "tests/helpers/lerobot_reader.py"
(CAMERAS,) = re.findall(r"--robot\.cameras=\"(.*?)\"", (CHECKOUT / "docs/streaming.md").read_text())
"""as a user types it"""
MAPS = ("images.gel", "gel_depth")
PAGE = (CHECKOUT / "docs/lerobot.md").read_text()


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return lerobot_environment(tmp_path_factory.mktemp("lerobot"))


def ask(environment: dict[str, str], *arguments: object) -> dict[str, object]:
    """Return what the program of LeRobot prints."""
    daemons = {"XDG_RUNTIME_DIR": os.environ["XDG_RUNTIME_DIR"]}
    done = run([sys.executable, READER, *map(str, arguments)], env={**environment, **daemons})
    assert done.returncode == 0, done.stderr
    told: dict[str, object] = json.loads(done.stdout.splitlines()[-1])
    return told


@pytest.fixture(params=[True, False])
def finger(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[BumpReconstructor]:
    """A sensor whose bundle has a constant for the force, or has none."""
    bundle = linear_bundle(tmp_path / "plain", shape=SHAPE)
    if request.param:
        bundle = extend_bundle(bundle, tmp_path / "bundle", force_files())
    daemon, made = bump_daemon(period_s=0.05, bundle=bundle, measures=BundleMeasures(bundle))
    with daemon, Publisher(daemon, name="finger"):
        yield made


def test_the_camera_is_found_and_keeps_to_the_contract(
    environment: dict[str, str], finger: BumpReconstructor, tmp_path: Path
) -> None:
    told = ask(environment, "camera", tmp_path / "maps.npz")
    assert "gellight" in told["types"]["CameraConfig"]
    assert "gellight_press" in told["types"]["RobotConfig"]
    assert "gellight_press" in told["types"]["TeleoperatorConfig"]
    assert told["unmet"] == []
    assert [one["name"] for one in told["found"]] == ["finger"]
    assert told["unconnected"].startswith("DeviceNotConnectedError")
    assert told["twice"].startswith("DeviceAlreadyConnectedError")
    assert re.match("ConnectionError: no daemon publishes thumb.*there are finger", told["nobody"])
    assert re.match("ConnectionError: .*gives 64 x 48 px, not 640 x 48: set", told["size"])
    assert told["nothing"].startswith("ValueError: use_rgb and use_depth")
    assert re.match(r"TimeoutError: .* ms old, more than -1", told["old"])
    assert "gives no depth: set use_depth" in told["no depth"]
    assert told["after"][0] is False
    assert told["after"][1].startswith("DeviceNotConnectedError")
    maps, given = np.load(tmp_path / "maps.npz"), list(finger.given.values())
    for name in ("read", "async_read", "latest"):
        assert (maps[name].dtype, maps[name].shape) == (np.uint8, (*SHAPE, 3))
    for name in ("depth", "latest_depth"):
        assert (maps[name].dtype, maps[name].shape) == (np.float32, (*SHAPE, 1))
        assert any(np.array_equal(maps[name][..., 0], frame.depth_mm * np.float32(1e-3)) for frame in given), "metres"
    seen = [frame for frame in given if np.array_equal(frame.camera_frame.image, maps["latest"])]
    belongs = [np.array_equal(maps["latest_depth"][..., 0], frame.depth_mm * np.float32(1e-3)) for frame in seen]
    assert any(belongs), "image and depth are of one frame"
    if seen[0].force is None:
        assert told["weighs"] == [False, False, False]
        assert told["force"].startswith("RuntimeError: GelLightCamera(finger): its bundle has no constant")
    else:
        assert told["weighs"] == [True, True, False]
        assert told["force"] in [frame.force.normal_n for frame in seen], "of the same frame"
        assert told["newer force"] in [frame.force.normal_n for frame in given if frame not in seen]


def test_the_robot_presses_into_the_simulated_gel(environment: dict[str, str], tmp_path: Path) -> None:
    plain = gellight.load_bundle("synthetic")
    extend_bundle(plain, tmp_path / "weighing", force_files())
    with gellight.connect("sim://?fps=10", calibration=str(tmp_path / "weighing")) as sensor, Publisher(sensor.daemon):
        told = ask(environment, "press", CAMERAS)
    assert told["broken"] == "ConnectionError: no such camera"
    assert not told["left"], "nothing stays open"
    assert told["asked_mm"] == 0.5
    assert told["seen_mm"] == pytest.approx(0.5, abs=0.05)
    assert told["features"] == {"gel": [480, 640, 3], "gel_depth": [480, 640, 1]}
    assert told["kinds"] == {"gel": ["uint8", 480, 640, 3], "gel_depth": ["float32", 480, 640, 1]}
    assert sorted(told["numbers"]) == ["gel.force_n", "press.depth_mm"]
    assert 0.01 < told["numbers"]["gel.force_n"] < 5


def test_the_robot_refuses_a_real_gel(environment: dict[str, str], finger: BumpReconstructor) -> None:
    told = ask(environment, "press", CAMERAS, "refused")
    assert told["refused"].startswith("ConnectionError: objects can be pressed into a simulated gel only")


def test_the_settings_of_the_page_do_not_clip_tactile_depth(environment: dict[str, str]) -> None:
    """By LeRobot's own quantiser; its default makes one code of all depths up to 2 mm."""
    given = dict(re.findall(r"--dataset\.depth_encoder\.(\w+)=(\S+)", PAGE))
    told = ask(environment, "quantise", given["depth_min"], given["depth_max"], given["use_log"])
    assert told["worst_um"] < 0.25
    assert told["codes"] == 4096
    by_default = ask(environment, "quantise", 0.01, 10, "true")
    assert by_default["codes"] == 1
    assert by_default["worst_um"] > 1000


def test_a_recording_becomes_an_episode_by_lerobots_own_writer(environment: dict[str, str], tmp_path: Path) -> None:
    """Read by Parquet's own reader: what was recorded, what is felt of it, and the pose, which is no observation."""
    parquet, press = pytest.importorskip("pyarrow.parquet"), weighed(0.5)
    bundle = extend_bundle(linear_bundle(tmp_path / "plain"), tmp_path / "bundle", force_files())
    with RecordingWriter(tmp_path / "press.mcap", "sim") as writer:
        for number in range(4):
            frame = CameraFrame(image=press.picture(0.5, number), time_s=number / 10, sequence=number)
            writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + frame.time_s))
    out = tmp_path / "out"
    ask(environment, "export", tmp_path / "press.mcap", "--out", out, "--as", "lerobot", "--track")
    assert [path.name for path in out.iterdir()] == ["lerobot"]
    info, stats = (json.loads((out / f"lerobot/meta/{name}.json").read_text()) for name in ("info", "stats"))
    rows = parquet.read_table(out / "lerobot/data/chunk-000/file-000.parquet").to_pylist()
    assert (len(rows), info["total_frames"], info["total_episodes"], info["fps"]) == (4, 4, 1, 10)
    assert [row["timestamp"] for row in rows] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert [row["observation.time_s"] for row in rows] == pytest.approx([0, 0.1, 0.2, 0.3])
    taken = list(Recording(tmp_path / "press.mcap").frames())[2].image("a")
    felt = gellight.Reconstructor(bundle).reconstruct(CameraFrame(image=taken, time_s=0.2, sequence=2))
    image, depth = (np.frombuffer(rows[2][f"observation.{name}"]["bytes"], np.uint8) for name in MAPS)
    assert np.array_equal(cv2.imdecode(image, cv2.IMREAD_COLOR_RGB), taken)
    depth_m = cv2.imdecode(depth, cv2.IMREAD_UNCHANGED)
    assert depth_m.dtype == np.float32
    assert depth_m == pytest.approx(felt.depth_mm / 1000, abs=4e-8)
    names = info["features"]["observation.state"]["names"]
    assert dict(zip(names, rows[2]["observation.state"], strict=True))["force_n"] == pytest.approx(felt.force.normal_n)
    assert stats["observation.state"]["mean"] == pytest.approx(np.mean([row["observation.state"] for row in rows], 0))
    assert {name: info["features"][f"object.{name}"]["shape"] for name in ("number", "motion", "covariance")} == {
        "number": [1], "motion": [16], "covariance": [36],
    }  # fmt: skip
    assert {row["object.number"] for row in rows} <= {0, 1}
