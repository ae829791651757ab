"""A ring that cannot be used, and the verb `run`: one line that says what to do, status 2, dark LEDs."""

import errno
import os
import pty
import sys
from pathlib import Path
from subprocess import PIPE
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.base.settings import load_settings
from gellight.cli.options import simulated_settings
from gellight.opening import open_camera
from gellight.ring.transport import open_transport
from gellight.sensor.opencv_camera import OpenCvCamera
from tests.helpers.children import started
from tests.helpers.command_line import invoke, refused


def test_a_ring_that_is_in_use_is_told(tmp_path: Path) -> None:
    primary, secondary = pty.openpty()
    port = os.ttyname(secondary)
    code = (
        f"import serial, sys; p = serial.Serial({port!r}, exclusive=True); print('open', flush=True); sys.stdin.read()"
    )
    with started([sys.executable, "-c", code], stdin=PIPE, stdout=PIPE) as other:
        other.stdout.readline()
        with pytest.raises(BoardError, match=rf"in use by \S+ \(process {other.pid}\).*: end that programme"):
            open_transport(port)
        other.communicate()
    os.close(primary)
    os.close(secondary)


def test_a_ring_that_this_user_may_not_use_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    monkeypatch.setattr(serial, "Serial", Mock(side_effect=serial.SerialException(errno.EACCES, "could not open port")))
    with pytest.raises(BoardError, match="install-udev"):
        open_transport("/dev/ttyACM0")


# ---- URLs ----


def test_urls_of_real_sensors_go_to_real_sensors(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="no camera at /dev/video987"):
        open_camera("v4l2:///dev/video987")
    with pytest.raises(CameraError, match="no sensor is called GL0404"):
        open_camera("sensor://GL0404")
    with pytest.raises(InputError, match="speed"):
        open_camera("auto?speed=3")
    (tmp_path / "v4l2").write_text("text")
    for path in (tmp_path / "v4l2", tmp_path, Path("/dev/null")):
        with pytest.raises(CameraError, match=rf"^{path} is no V4L2 camera: `gellight find` lists"):
            open_camera(f"v4l2://{path}")
    for url in ("v4l2://", "sensor://", "v4l2://?fps=30"):
        with pytest.raises(InputError, match=r"names no sensor: give auto, sensor://NAME"):
            open_camera(url)


@pytest.mark.parametrize("url", ["{}", "auto{}", "v4l2://{}", "v4l2:///dev/{}", "sensor://{}"])
def test_a_name_that_is_too_long_for_a_file_is_one_that_is_not_there(url: str) -> None:
    with pytest.raises(CameraError, match=r"no camera at|no sensor is called|is no file"):
        open_camera(url.format("x" * 300))


def test_a_folder_called_auto_is_still_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import cv2

    (tmp_path / "auto").mkdir()
    cv2.imwrite(str(tmp_path / "auto/1.png"), np.zeros((4, 6, 3), np.uint8))
    monkeypatch.chdir(tmp_path)
    assert open_camera("auto").image_shape == (4, 6)


def test_opencv_serves_where_there_is_no_v4l2_and_only_there(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="on Linux, use auto or v4l2:///dev/video0"):
        open_camera("opencv://0")
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(InputError, match="give opencv://0"):
        open_camera("opencv://front")


def test_opencv_itself_delivers_rgb_frames_until_the_camera_ends(tmp_path: Path) -> None:
    """OpenCV reads a file as it reads a camera; the frames show three colours that cannot be mistaken."""
    import cv2

    seen = np.array([(200, 40, 40), (40, 200, 40), (40, 40, 200)])
    written = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30, (32, 24))
    for colour in seen:
        written.write(np.full((24, 32, 3), colour[::-1], np.uint8))
    written.release()
    film = cv2.VideoCapture(str(tmp_path / "film.avi"))
    with OpenCvCamera(0, url="opencv://0", capture=lambda index: film) as camera:
        assert camera.image_shape == (24, 32)
        frames = [camera.read() for _ in range(2)]
        with pytest.raises(CameraError, match="gives no frame: plug the camera in"):
            camera.read()
    assert not film.isOpened()
    assert [frame.sequence for frame in frames] == [0, 1]
    shown = np.array([frame.image.mean(axis=(0, 1)) for frame in frames])
    assert np.abs(shown - seen[1:]).max() < 12, "grey levels; the first picture told the size"
    assert frames[0].time_s < frames[1].time_s


# ---- gellight run ----


def test_a_run_without_a_sensor_is_refused_in_one_line() -> None:
    run = invoke("run", "--sensor", "sensor://GL0404", "--frames", "3")
    assert (run.stdout, run.stderr) == ("", "")
    assert "GL0404" in refused(run)
    assert "\n" not in refused(run)


def test_without_a_sensor_in_the_settings_the_one_that_is_plugged_in_is_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GELLIGHT_SENSOR_URL", raising=False)
    assert load_settings().sensor.url == "auto"
    assert simulated_settings({"sensor.url": None}).sensor.url == "sim://"
    Path("gellight.toml").write_text('[sensor]\nurl = "sensor://GL0001"\n')
    assert load_settings({"sensor.url": None}).sensor.url == "sensor://GL0001"
    assert simulated_settings({"sensor.url": None}).sensor.url == "sim://"
    Path("gellight.toml").write_text('[sensor]\nurl = "sim://?noise=2"\n')
    assert simulated_settings({"sensor.url": None}).sensor.url == "sim://?noise=2"
    assert simulated_settings({"sensor.url": "pictures"}).sensor.url == "pictures"
