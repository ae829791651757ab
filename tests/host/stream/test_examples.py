"""The examples of the documents run as they stand, and the reader in C++ agrees with Python's encoder."""

import csv
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import gellight
from gellight.frames.image_files import read_image
from gellight.frames.measures import MapOnRequest
from gellight.lab.report.pictures import write_png
from gellight.stream.publisher import Publisher
from gellight.stream.wire import encode
from tests.helpers.children import run
from tests.helpers.doc_examples import examples
from tests.helpers.fem_presses import force_n
from tests.helpers.places import CHECKOUT, real
from tests.helpers.streamed import bump_daemon, free_port, full_frame
from tests.helpers.weighed import HeavyFrames

EXAMPLES = CHECKOUT / "docs/examples"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("live.py", "mm deep over"),
        ("in_process.py", "normals (480, 640, 3)"),
        ("log_frames.py", "100 frames are in touch.csv, "),  # a busy computer loses some, and it says so
        ("motion.py", "contact 1: at (0.0, "),
        ("callback.py", "the deepest touch of two seconds was 0."),
        ("asynchronous.py", "5 frames with a contact"),
    ],
)
def test_an_example_runs(name: str, says: str, tmp_path: Path) -> None:
    daemon, _ = bump_daemon(period_s=0.03)
    with daemon, Publisher(daemon):
        done = run([sys.executable, EXAMPLES / name], cwd=tmp_path, check=True)
    assert says in done.stdout


@pytest.mark.nightly
def test_the_force_along_the_gel_is_told_as_the_document_shows() -> None:
    """In docs/shear.md a ball is dragged to the right and down: it pulls so, and turns nothing."""
    (code,) = examples("docs/shear.md")
    said = run([sys.executable, "-c", code], check=True).stdout
    x, y, x_error, _, turned = map(float, re.findall(r"-?[0-9.]+[0-9]+(?:e-?[0-9]+)?", said))
    assert 0.2 < x < 0.4
    assert y == pytest.approx(x / 3, abs=3 * x_error)
    assert abs(turned) < 0.1


@pytest.mark.nightly
def test_a_gripper_closes_until_nothing_slips() -> None:
    """A ball holds by friction what presses it times 0.6; a lighter grip slips first."""
    said = run([sys.executable, EXAMPLES / "hold.py"], check=True).stdout
    *tries, last = said.strip().splitlines()
    assert [one.rpartition(": ")[2] for one in tries] == ["it slips"] * (len(tries) - 1) + ["it holds"]
    assert len(tries) > 1
    pulled, pressed = map(float, re.findall(r"[0-9.]+[0-9]", last))
    assert 0.4 <= pulled < 1.1 * 0.6 * pressed


@pytest.mark.nightly
def test_a_gripper_stops_at_one_newton() -> None:
    """Finite elements weighed the same ball, pressed to two depths; between them a power says how deep is how heavy."""
    said = run([sys.executable, EXAMPLES / "grip.py"], check=True).stdout
    force, error, closed_mm = map(float, re.findall(r"[0-9.]+[0-9]", said))
    light, heavy = force_n("ball4_0.3"), force_n("ball4_1.0")
    true_n = heavy * closed_mm ** (np.log(heavy / light) / np.log(1 / 0.3))
    assert 1 <= force < 1.1
    assert abs(force - true_n) < 2 * error


@pytest.mark.nightly
def test_two_sensors_are_read_by_their_names(tmp_path: Path) -> None:
    (one, _), (other, _) = bump_daemon(period_s=0.03), bump_daemon(period_s=0.03)
    with one, other, Publisher(one, name="left"), Publisher(other, name="right"):
        done = run([sys.executable, EXAMPLES / "two_sensors.py", "left", "right"], check=True)
    depths = re.findall(r"left and right: (\d\.\d\d) and (\d\.\d\d) mm deep", done.stdout)
    assert len(depths) == 20
    assert min(float(depth) for pair in depths for depth in pair) >= 0.5, "the bump, which is deeper in each frame"


@pytest.mark.nightly
def test_the_depth_is_drawn_until_the_window_is_closed() -> None:
    pytest.importorskip("matplotlib")
    closed = "import itertools, runpy, sys, matplotlib.pyplot as plt; sys.argv.pop(); drawn = itertools.count(1)\n"
    closed += "def pause(_):\n print(plt.gca().images[0].get_array().max())\n next(drawn) < 3 or plt.close('all')\n"
    closed += f"plt.pause = pause; runpy.run_path({str(EXAMPLES / 'live_picture.py')!r})"
    daemon, _ = bump_daemon(period_s=0.03)
    with daemon, Publisher(daemon):
        done = run([sys.executable, "-c", closed, ""], check=True, env={**os.environ, "MPLBACKEND": "Agg"})
    depths = [float(line) for line in done.stdout.splitlines()]
    assert 0.5 < depths[0] < depths[1] < depths[2], "the bump of the daemon, which is deeper in each frame"


@pytest.mark.nightly
def test_pictures_without_a_calibration_show_where_and_how_large(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    for name, url in {"untouched": "sim://?programme=0", "ball": "sim://?object=BALL&depth=1.0&x=3&y=-2"}.items():
        with gellight.open_camera(url) as camera:
            frame = camera.read()
        write_png(tmp_path / "pictures" / f"{name}.png", frame.image)
    told = ["pictures/untouched.png", "pictures", "0.0588", "seen"]
    said = run([sys.executable, EXAMPLES / "touched.py", *told], cwd=tmp_path, check=True).stdout
    ball, untouched = said.splitlines()
    assert untouched == "untouched: nothing touches (largest change 0.0 grey levels)"
    x, y, area_mm2 = map(float, re.findall(r"[0-9.]+\b", ball.removesuffix("mm2")))
    rows, columns = np.nonzero(frame.truth.contact)
    assert np.hypot(x - columns.mean(), y - rows.mean()) < 4
    assert 0.6 < area_mm2 / (len(rows) * 0.0588**2) < 1.4
    assert read_image(tmp_path / "seen/ball.png").shape == (480, 640, 3)


@pytest.mark.real_images("gelsight_mini_ball")
def test_pictures_of_a_real_sensor_show_it_as_well_as_the_page_says() -> None:
    tell, folder, off = runpy.run_path(str(EXAMPLES / "touched.py")), real("gelsight_mini_ball"), []
    with (folder / "presses.csv").open() as file:
        for press in csv.DictReader(file):
            x, y, radius = (float(press[name]) for name in ("center_x_px", "center_y_px", "contact_radius_px"))
            images = (read_image(folder / name) for name in (press["image"], "background.png"))
            outline = tell["contact"](tell["changed"](*images, None))
            place = np.subtract(tell["centre"](outline), (x, y))
            off.append((np.hypot(*place) / radius, cv2.contourArea(outline) / np.pi / radius**2))
    (place, area), worst = np.median(off, axis=0), np.max(off, axis=0)
    assert len(off) == 33
    assert place < 0.12
    assert worst[0] < 0.3
    assert 0.7 < area < 1


def test_every_example_is_run_and_described() -> None:
    page = (CHECKOUT / "docs/streaming.md").read_text()
    assert len(list(EXAMPLES.glob("*.py"))) == 12, "test_ros2.py runs one"
    assert [path.name for path in EXAMPLES.glob("*.py") if f"examples/{path.name}" not in page] == []
    assert examples("docs/streaming.md")[0].strip() in (EXAMPLES / "live.py").read_text()


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program in C++, compiled with every warning."""
    compiler = shutil.which("c++") or shutil.which("clang++")
    command = [compiler] if compiler else [sys.executable, "-m", "ziglang", "c++"]
    target = tmp_path_factory.mktemp("c++") / "print_frame"
    sanitisers = ["-fsanitize=address,undefined"] if compiler else []
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-O1", *sanitisers]
    run([*command, *options, EXAMPLES / "print_frame.cpp", "-o", target], check=True)
    return target


@pytest.mark.nightly
@pytest.mark.parametrize("asked", [(), tuple(MapOnRequest)])
def test_the_reader_in_c_plus_plus_reads_what_python_writes(
    reader: Path, tmp_path: Path, asked: tuple[MapOnRequest, ...]
) -> None:
    frame = replace(full_frame(), measures=HeavyFrames())
    sent = frame.maps_on_request(asked)
    (tmp_path / "frame").write_bytes(encode(frame, asked))
    figures, details = run([reader, tmp_path / "frame"], check=True).stdout.splitlines()
    expected = [
        frame.camera_frame.sequence, 64, 48, frame.camera_frame.time_s, frame.contact.indentation_mm,
        frame.contact.centroid_mm[0], frame.depth_mm.sum(dtype=float), frame.gradient_map[..., 0].sum(dtype=float),
        frame.camera_frame.image[..., 0].sum(), frame.contact.mask.sum(),
        *(sent.get(name, np.zeros(1)).sum(dtype=float) for name in ("pressure_mpa", "confidence", "quality_flags")),
    ]  # fmt: skip
    assert np.allclose([float(text) for text in figures.split()], expected, rtol=1e-7, atol=1e-6)
    assert json.loads(details)["provenance"]["findings"] == ["drift"]


@pytest.mark.nightly
@pytest.mark.parametrize(("change", "says"), [
    ((4, 2), "version 2"), ((0, 0), "no frame"), ((40, 0), "its size"), ((43, 255), "its size"),
    ((6, 17), "list of planes"), ((96, 0), "missing"), ((127, 255), "a plane"), ((11, 255), "details"),
    ((6, 1), "missing"),
])  # fmt: skip
def test_the_reader_in_c_plus_plus_refuses_what_is_damaged(
    reader: Path, tmp_path: Path, change: tuple[int, int], says: str
) -> None:
    message = bytearray(encode(full_frame()))
    message[change[0]] = change[1]
    (tmp_path / "frame").write_bytes(message)
    done = run([reader, tmp_path / "frame"])
    assert done.returncode == 1
    assert says in done.stderr


@pytest.mark.nightly
def test_the_reader_in_c_plus_plus_refuses_what_is_cut_off(reader: Path, tmp_path: Path) -> None:
    message = encode(full_frame())
    for length in (0, 50, 96, 200, 1000, len(message) // 2):
        (tmp_path / "frame").write_bytes(message[:length])
        assert run([reader, tmp_path / "frame"]).returncode == 1


# ---- what docs/streaming.md types, in order ----

SECTION = (CHECKOUT / "docs/streaming.md").read_text().partition("## Other computers")[0]
LEFT_OUT = ("pip install", "lerobot-record")
"""what this environment has, and what needs one of its own"""


def typed(router: str) -> str:
    """Return every block of the ways to a robot, typed into one shell: sensors are slow, and the last one ends."""
    blocks = re.findall(r"```sh\n(.*?)```", SECTION, re.DOTALL)
    assert [len(re.findall("stream.ros2|stream.foxglove|live.py|lerobot-record", block)) for block in blocks] == [
        1,
        1,
        1,
        1,
    ]
    lines = [line for block in blocks for line in block.splitlines() if not line.startswith(LEFT_OUT)]
    text = "\n".join(["set -eu", "trap 'kill $(jobs -p)' EXIT", *lines, ""])
    text = text.replace("tcp/localhost:7447", router).replace("ros2_check.py", f"ros2_check.py {router}")
    return text.replace("sim://?object", "sim://?fps=4&object").replace("foxglove=true\n", "foxglove=true --frames 5\n")


@pytest.mark.nightly
@pytest.mark.timeout(700)
def test_every_way_to_a_robot_runs_as_it_is_typed(tmp_path: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    folders = {f"XDG_{kind}_HOME": str(tmp_path / kind) for kind in ("CONFIG", "STATE", "DATA")}
    environment = {**os.environ, **folders, "GELLIGHT_STREAM_FOXGLOVE_PORT": "0", "PATH": path}
    script = typed(f"tcp/127.0.0.1:{free_port()}")
    done = run(["bash", "-c", script], cwd=CHECKOUT, env=environment, stderr=subprocess.STDOUT, timeout_s=600)
    assert done.returncode == 0, done.stdout
    names = re.findall(r"stream.name=(\w+)", SECTION)
    assert len(names) == 2
    assert [name for name in names if f"gellight.subscribe('{name}')" not in done.stdout] == []
    assert re.search(rf"^frames of {names[0]}\n(0\.9|1\.0)\d mm deep over", done.stdout, re.MULTILINE), done.stdout
    (shown,) = re.findall(r"!\[(/\S+), and (/\S+) from", SECTION)
    for topic in shown:
        assert f"\n{topic}: " in done.stdout, done.stdout
    assert "Foxglove: open" in done.stdout
