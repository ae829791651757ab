"""From bytes to frames: whole pictures only, dated by what a time stamp means."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.frames.jpeg import CorruptPictureError
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.errors import StalledError
from gellight.sensor.v4l2.formats import Mode, Wanted, decode
from gellight.sensor.v4l2.options import parse_url
from gellight.sensor.v4l2.stamps import hardware_stamps
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.helpers.v4l2_pictures import PATH, fake, jpeg, open_v4l2, scene

# ---- decoding raw pictures ----


@pytest.mark.parametrize(("letters", "pixel_bytes"), [("RGB3", 3), ("GREY", 1), ("YUYV", 2)])
def test_raw_pictures_are_exact_with_padded_lines_and_refused_when_short(letters: str, pixel_bytes: int) -> None:
    mode = Mode(letters=letters, width=32, height=24, fps=30, line_bytes=32 * pixel_bytes + 8)
    lines = np.full((24, 32 * pixel_bytes), 128, np.uint8)
    if letters != "YUYV":
        lines = np.random.default_rng(0).integers(0, 256, lines.shape, np.uint8)
    padded = np.pad(lines, ((0, 0), (0, 8)), constant_values=7).tobytes()
    image = decode(padded, mode)
    assert image.shape == (24, 32, 3)
    if letters == "RGB3":
        assert (image == lines.reshape(24, 32, 3)).all()
    if letters == "GREY":
        assert (image == lines[..., None]).all()
    if letters == "YUYV":
        assert (image == 130).all(), "(128 - 16) * 255 / 219 by BT.601"
    with pytest.raises(CorruptPictureError, match="bytes instead of"):
        decode(padded[:-9], mode)


# ---- the camera ----


def test_corrupt_pictures_are_counted_and_never_delivered() -> None:
    whole = [jpeg(scene(k)) for k in range(3)]

    def payload(number: int) -> bytes:
        data = whole[number % 3]
        return data[:4000] + data[6000:] if number % 3 == 1 else data

    kernel, _ = fake(payload=payload)
    with open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel) as camera:
        frames = [camera.read() for _ in range(8)]
    assert all(frame.sequence % 3 != 1 for frame in frames)
    assert camera.counts.corrupt == 4
    assert all(frame.source == f"v4l2://{PATH}?width=640&height=480" for frame in frames)
    assert camera.status()["mode"] == "MJPG 640x480 at 30 fps"
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_a_picture_that_is_sent_again_is_not_delivered_again() -> None:
    pictures = [jpeg(scene(k)) for k in range(8)]
    kernel, _ = fake(payload=lambda number: pictures[number // 2])
    with open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel) as camera:
        frames = [camera.read()]
        for pause_s in (0.0, 0.045, 0.02, 0.07, 0.0):
            kernel.sleep(pause_s)
            frames.append(camera.read())
    assert [frame.sequence % 2 for frame in frames] == [0] * len(frames)
    assert camera.counts.identical >= 4


def test_a_camera_that_repeats_one_picture_is_stalled_unless_it_is_dark_all_over() -> None:
    picture = jpeg(scene())
    kernel, _ = fake(payload=lambda number: picture)
    with open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel) as camera:
        camera.read()
        with pytest.raises(StalledError, match="the same picture again and again"):
            camera.read()
    picture = jpeg(np.zeros((480, 640, 3), np.uint8))
    with open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel) as camera:
        assert [camera.read().image.max() for _ in range(3)] == [0, 0, 0]


@pytest.mark.parametrize(("luma", "stalled"), [(134, False), (136, True)])
def test_a_picture_of_eight_grey_levels_may_come_again(luma: int, stalled: bool) -> None:
    """By BT.601 these are 7 and 10 levels above 128."""
    kernel, _ = fake(payload=lambda number: bytes([luma, 128]) + b"\x80" * (32 * 24 * 2 - 2))
    with open_v4l2(f"v4l2://{PATH}?width=32&height=24", kernel) as camera:
        assert 7 <= np.ptp(camera.read().image) <= 10
        if not stalled:
            camera.read()
            return
        with pytest.raises(StalledError):
            camera.read()


def test_a_camera_that_never_sends_a_whole_picture_is_stalled() -> None:
    kernel, _ = fake()
    camera = open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel)
    with camera, pytest.raises(StalledError, match="not whole"):
        camera.read()


@pytest.mark.parametrize(
    ("driver", "flags", "setting", "measured", "wanted_s"),
    [
        ("other", v.SOURCE_SOE, "0", "", 0.0),
        ("other", v.SOURCE_SOE, "0", "&delay_us=4000&readout_us=12000", -0.004),
        ("uvcvideo", v.SOURCE_SOE, "1", "", 0.0),
        ("uvcvideo", v.SOURCE_SOE, "0", "", -0.008),
        ("uvcvideo", v.SOURCE_SOE, "0", "&delay_us=4000&readout_us=12000", -0.012),
        ("other", 0, "0", "", -0.008 - 1 / 30),
        ("other", 0, "0", "&readout_us=12000&delay_us=4000", -0.024),
    ],
)
def test_the_start_of_the_exposure_follows_from_what_the_stamp_means(
    tmp_path: Path, driver: str, flags: int, setting: str, measured: str, wanted_s: float
) -> None:
    (tmp_path / "module/uvcvideo/parameters").mkdir(parents=True)
    (tmp_path / "module/uvcvideo/parameters/hwtimestamps").write_text(f"{setting}\n")
    kernel, _ = fake(driver=driver, flags=v.TIMESTAMP_MONOTONIC | flags, payload=lambda number: b"\x80" * 32 * 24 * 2)
    options = parse_url(f"v4l2://x?exposure_us=8000&width=32&height=24{measured}")[1]
    assert not hardware_stamps("uvcvideo", sysfs=tmp_path / "none"), "of a kernel without the parameter"
    with V4l2Camera(PATH, options, kernel=kernel, sysfs=tmp_path) as camera:
        assert camera.read().time_s == pytest.approx(100.0 + wanted_s, abs=1e-5)


def test_no_picture_is_asked_for_that_a_recording_cannot_hold() -> None:
    assert parse_url("v4l2://x?width=8192&height=2")[1].width == 8192
    with pytest.raises(InputError, match="width = 8193 is not allowed: give a whole number at least 2 and at most"):
        parse_url("v4l2://x?width=8193&height=2")


@pytest.mark.parametrize("latency_s", [0.02, 0.03, 0.05])
def test_a_frame_whose_stamp_cannot_be_true_is_never_called_newer_than_it_is(latency_s: float) -> None:
    """However long it took to come, and waited for the reader."""
    kernel, _ = fake(
        stamp=lambda number, time_s: time_s + 5, latency_s=latency_s,
        payload=lambda number: bytes([number % 200 + 20, 128] * 32 * 24),
    )  # fmt: skip
    url = f"v4l2://{PATH}?exposure_us=8000&width=32&height=24&readout_us=12000"
    with open_v4l2(url, kernel) as camera:
        begun_s, late_s = kernel.now_s, []
        for pause_s in (0.0, 0.04, 0.0, 0.025, 0.09, 0.01):
            kernel.sleep(pause_s)
            frame = camera.read()
            assert frame.estimated
            late_s.append(frame.time_s - (begun_s + frame.sequence / 30))
        assert max(late_s) <= 0
        assert min(late_s) > -0.2, "but not much older"


def test_what_was_not_measured_makes_the_light_of_a_frame_less_sure(tmp_path: Path) -> None:
    kernel, _ = fake()
    doubts = []
    for known in ("", "&readout_us=12000", "&readout_us=12000&delay_us=4000"):
        options = parse_url(f"v4l2://x?exposure_us=8000&width=32&height=24{known}")[1]
        with V4l2Camera(PATH, options, kernel=kernel, sysfs=tmp_path) as camera:
            doubts.append(camera.timing.stamp_error_s)
    assert camera.timing.exposure_s == 0.008
    assert camera.timing.readout_s == 0.012
    assert np.diff(doubts) == pytest.approx([-1 / 30, -1 / 30])
    assert doubts[-1] == 0.002
    options = parse_url("v4l2://x?exposure_us=8000&width=32&height=24&readout_us=12000&delay_us=0&stamp_error_us=500")[
        1
    ]
    with V4l2Camera(PATH, options, kernel=kernel, sysfs=tmp_path) as camera:
        assert camera.timing.stamp_error_s == 0.0005


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("format=H264", "format"),
        ("fps=0", "fps"),
        ("speed=3", "unknown parameter speed: choose one of width, height, format"),
        ("width=640", "width and height together"),
        ("exposure_us=x", "exposure_us"),
        ("delay_us=inf", "delay_us"),
        ("readout_us=2e6", "readout_us"),
        ("gain=nan", "gain"),
    ],
)
def test_wrong_parameters_of_a_url_are_named_and_right_ones_are_kept(query: str, message: str) -> None:
    path, options = parse_url("v4l2:///dev/v4l/by-id/usb-X_1-video-index0?format=yuyv&fps=25&gain=3")
    assert path == "/dev/v4l/by-id/usb-X_1-video-index0"
    assert options.wanted((480, 640)) == Wanted(width=640, height=480, letters="YUYV", fps=25)
    assert options.controls() == {"gain": 3}
    with pytest.raises(InputError, match=message):
        parse_url(f"v4l2:///dev/video0?{query}")
