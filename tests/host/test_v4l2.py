"""Capture on a kernel made of nothing: the newest picture, everything else counted, every fault named."""

import ctypes
import errno
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.errors import CameraError, InputError
from gellight.v4l2 import controls as c
from gellight.v4l2 import structures as v
from gellight.v4l2.controls import V4l2Controls
from gellight.v4l2.decoding import CorruptPictureError, decode
from gellight.v4l2.device import Device
from gellight.v4l2.errors import BusyError, DeniedError, StalledError, UnpluggedError, holders, holders_text
from gellight.v4l2.formats import Mode, Wanted
from gellight.v4l2.options import parse_url
from gellight.v4l2.stream import Stream
from gellight.v4l2.timing import hardware_stamps
from gellight.v4l2.video_camera import V4l2Camera, open_v4l2
from tests.host.fake_kernel import FakeCamera, FakeControl, FakeKernel, refuse

PATH = "/dev/video7"
NEWEST_AGE_S = 1 / 30 + 0.010 + 1e-6
"""a period and the latency of the fake camera"""


def fake(**changes: object) -> tuple[FakeKernel, FakeCamera]:
    camera = FakeCamera(**changes)  # type: ignore[arg-type]
    return FakeKernel({PATH: camera}), camera


def streaming(kernel: FakeKernel, letters: str = "MJPG", buffers: int = 4) -> Stream:
    device = Device(PATH, kernel=kernel)
    device.configure(Wanted(width=640, height=480, letters=letters, fps=30))
    return device.start(buffers=buffers)


def jpeg(image: np.ndarray, quality: int = 90) -> bytes:
    return cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def scene(seed: int = 0, shape: tuple[int, int] = (480, 640)) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    waves = np.stack([100 + 80 * np.sin(x / 90), 90 + 80 * np.cos(y / 70), 110 + 60 * np.sin((x + y) / 50)], -1)
    return np.clip(waves + np.random.default_rng(seed).normal(0, 3, waves.shape), 0, 255).astype(np.uint8)


# ---- structures ----


def test_request_numbers_are_those_of_the_kernel_headers() -> None:
    assert (v.QUERYCAP, v.S_FMT, v.DQBUF) == (0x80685600, 0xC0D05605, 0xC0585611)
    assert (v.S_PARM, v.S_CTRL, v.QUERYCTRL) == (0xC0CC5616, 0xC008561C, 0xC0445624)
    assert (v.ENUM_FRAMESIZES, v.ENUM_FRAMEINTERVALS, v.STREAMON) == (0xC02C564A, 0xC034564B, 0x40045612)
    assert ctypes.sizeof(v.Buffer) == 88
    assert (c.EXPOSURE, c.WHITE_BALANCE, c.POWER_LINE) == (0x9A0902, 0x98091A, 0x980918)


# ---- the choice of a mode ----


def test_a_mode_is_chosen_by_size_and_rate_and_the_preferred_format_wins() -> None:
    kernel, _ = fake()
    with Device(PATH, kernel=kernel) as device:
        assert str(device.configure(Wanted(width=640, height=480))) == "MJPG 640x480 at 30 fps"
        assert str(device.configure(Wanted(width=640, height=480, fps=60))) == "MJPG 640x480 at 60 fps"
        assert str(device.configure(Wanted(letters="YUYV", width=640, height=480))) == "YUYV 640x480 at 30 fps"
        assert str(device.configure(Wanted(width=32, height=24))) == "YUYV 32x24 at 30 fps"
        assert device.configure(Wanted()).letters == "MJPG"


@pytest.mark.parametrize(
    "wanted",
    [
        Wanted(width=641, height=480),
        Wanted(width=640, height=480, fps=31),
        Wanted(letters="GREY", width=640, height=480),
        Wanted(letters="H264", width=640, height=480),
    ],
)
def test_what_is_not_offered_is_refused_with_the_list_of_what_is(wanted: Wanted) -> None:
    kernel, _ = fake()
    with Device(PATH, kernel=kernel) as device, pytest.raises(CameraError) as caught:
        device.configure(wanted)
    assert "MJPG 640x480 at 60, 30, 15 fps" in str(caught.value)
    assert "H264, not decoded" in str(caught.value)
    assert str(wanted) in str(caught.value)


def test_a_range_of_sizes_holds_every_step_of_it() -> None:
    kernel, _ = fake(formats={"MJPG": {(640, 480): [30]}})

    def range_of_sizes(camera: FakeCamera, entry: v.FrameSize) -> None:
        if entry.index:
            raise refuse(errno.EINVAL)
        entry.type = 3
        entry.size.values[:] = [320, 960, 16, 240, 720, 8]

    kernel.enum_framesizes = range_of_sizes  # type: ignore[method-assign]
    kernel.enum_frameintervals = lambda camera, entry: kernel._index(entry, 0)  # type: ignore[method-assign]
    with Device(PATH, kernel=kernel) as device:
        (offer,) = device.offers()
    assert offer.has(640, 480)
    assert offer.has(336, 248)
    assert not offer.has(641, 480)
    assert not offer.has(1280, 720)
    assert "320x240 to 960x720" in str(offer)


# ---- the newest picture ----


def test_every_picture_comes_once_and_in_order_to_a_reader_that_keeps_up() -> None:
    kernel, _ = fake()
    stream = streaming(kernel)
    assert [stream.newest(1).sequence for _ in range(50)] == list(range(50))
    assert stream.counts.delivered == 50
    assert sum(stream.counts.as_json().values()) == 50, "nothing else was counted"


@pytest.mark.parametrize("pause_s", [0.01, 0.05, 0.12, 0.14, 0.5, 3.0])
@pytest.mark.parametrize("buffers", [3, 4])
def test_a_slow_reader_never_gets_an_old_picture(pause_s: float, buffers: int) -> None:
    kernel, camera = fake()
    stream = streaming(kernel, buffers=buffers)
    for _ in range(20):
        kernel.sleep(pause_s)
        picture = stream.newest(1)
        assert kernel.now_s - picture.stamp_s <= NEWEST_AGE_S
    counts = stream.counts
    assert counts.delivered + counts.skipped + counts.lost == picture.sequence + 1, "every picture is accounted for"
    assert camera.number - picture.sequence <= 1


def test_pictures_that_never_came_are_counted_as_lost() -> None:
    kernel, _ = fake(missing=lambda number: number % 5 == 3)
    stream = streaming(kernel)
    last = [stream.newest(1).sequence for _ in range(40)][-1]
    assert stream.counts.lost == sum(number % 5 == 3 for number in range(last))


def test_a_picture_that_comes_again_is_counted_and_not_delivered() -> None:
    kernel, _ = fake(sequence=lambda number: number - (number % 4 == 3))
    stream = streaming(kernel)
    seen = [stream.newest(1).sequence for _ in range(30)]
    assert len(set(seen)) == 30
    assert stream.counts.duplicated == sum(number % 4 == 3 for number in range(seen[-1]))
    kernel, _ = fake(stamp=lambda number, time_s: time_s - (number % 2) / 30)
    stream = streaming(kernel)
    seen = [stream.newest(1).sequence for _ in range(10)]
    assert seen == list(range(0, 20, 2)), "the same time stamp twice is the same picture twice"


def test_a_camera_that_repeats_its_bytes_is_noticed() -> None:
    kernel, _ = fake(payload=lambda number: b"picture %d" % (number // 2))
    stream = streaming(kernel)
    for _ in range(20):
        stream.newest(1)
    assert stream.counts.identical == 10


def test_damaged_and_empty_pictures_are_counted_and_not_delivered() -> None:
    kernel, _ = fake(
        bad=lambda number: v.FLAG_ERROR if number % 3 == 1 else 0,
        payload=lambda number: b"" if number % 3 == 2 else b"x" * 10,
    )
    stream = streaming(kernel)
    assert [stream.newest(1).sequence % 3 for _ in range(10)] == [0] * 10
    assert stream.counts.damaged == 18


def test_a_camera_that_sends_only_damaged_pictures_is_stalled_not_waited_for() -> None:
    kernel, _ = fake(bad=lambda number: v.FLAG_ERROR)
    with pytest.raises(StalledError, match=r"only damaged pictures .*another cable"):
        streaming(kernel).newest(1)


def test_sequence_numbers_may_wrap_around() -> None:
    kernel, _ = fake(sequence=lambda number: (number + 2**32 - 3) % 2**32)
    stream = streaming(kernel)
    assert [stream.newest(1).sequence for _ in range(5)] == [2**32 - 3, 2**32 - 2, 2**32 - 1, 0, 1]
    assert stream.counts.lost == stream.counts.duplicated == 0


@pytest.mark.parametrize(
    ("lie", "share"),
    [
        (lambda number, time_s: time_s + 1.0, 1.0),
        (lambda number, time_s: time_s - 10.0, 1.0),
        (lambda number, time_s: time_s - 0.05 * (number % 2), 0.5),
    ],
)
def test_time_stamps_that_cannot_be_true_are_noticed(lie: Callable[[int, float], float], share: float) -> None:
    kernel, _ = fake(stamp=lie)
    stream = streaming(kernel)
    sound = [stream.newest(1).stamp_is_sound for _ in range(20)]
    assert sound.count(False) == stream.counts.wrong_stamps == round(20 * share)


def test_a_stamp_on_another_clock_is_not_believed() -> None:
    kernel, _ = fake(flags=0)
    assert not streaming(kernel).newest(1).stamp_is_sound


# ---- cables ----


def test_unplugging_in_mid_stream_is_told_from_a_stall() -> None:
    kernel, camera = fake()
    stream = streaming(kernel)
    stream.newest(1)
    kernel.at(kernel.now_s + 0.2, lambda: setattr(camera, "plugged", False))
    while camera.plugged:
        try:
            stream.newest(1)
        except UnpluggedError as error:
            assert "was unplugged: plug it in" in str(error)  # noqa: PT017  (it may come in any of the reads)
            break
    with pytest.raises(UnpluggedError, match="was unplugged: plug it in"):
        stream.newest(1)
    assert kernel.now_s < 101

    kernel, camera = fake()
    stream = streaming(kernel)
    stream.newest(1)
    camera.stalled = True
    with pytest.raises(StalledError, match="is there but sent no picture for 1 s"):
        stream.newest(1)


def test_a_poll_error_of_a_camera_that_is_there_is_no_unplugging() -> None:
    kernel, camera = fake()
    stream = streaming(kernel)
    camera.streaming = False
    with pytest.raises(StalledError, match="is there but stopped its stream"):
        stream.newest(1)


def test_closing_what_was_unplugged_is_quiet_and_gives_everything_back() -> None:
    kernel, camera = fake()
    device = Device(PATH, kernel=kernel)
    device.configure(Wanted(width=640, height=480))
    device.start()
    camera.plugged = False
    device.close()
    device.close()
    assert not kernel.opened


def test_a_stream_can_be_started_again() -> None:
    kernel, camera = fake()
    with Device(PATH, kernel=kernel) as device:
        device.configure(Wanted(width=640, height=480))
        for _ in range(12):
            assert device.start().newest(1).sequence == 0
    assert camera.streams == 12


# ---- who and what stands in the way ----


def test_no_camera_a_foreign_camera_and_no_permission_are_told_apart() -> None:
    kernel, camera = fake()
    with pytest.raises(UnpluggedError, match=r"no camera at /dev/video8.*gellight find"):
        Device("/dev/video8", kernel=kernel)
    camera.denied = True
    with pytest.raises(DeniedError, match="sudo gellight install-udev"):
        Device(PATH, kernel=kernel)
    camera.denied, camera.capabilities = False, 0x00800000
    with pytest.raises(CameraError, match="delivers no pictures"):
        Device(PATH, kernel=kernel)
    camera.errors[v.QUERYCAP] = errno.ENOTTY
    with pytest.raises(CameraError, match="no V4L2 device"):
        Device(PATH, kernel=kernel)
    assert not kernel.opened, "what could not be used was closed again"


def test_a_busy_camera_says_who_holds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, _ = fake(busy=True)
    monkeypatch.setattr("gellight.v4l2.errors.holders", lambda path, proc: [(4711, "cheese")])
    with pytest.raises(BusyError, match=r"in use by cheese \(process 4711\): end that programme"):
        V4l2Camera(PATH, kernel=kernel)
    assert not kernel.opened


def test_holders_are_found_by_their_open_files(tmp_path: Path) -> None:
    device = tmp_path / "video7"
    device.touch()
    for number, name in ((4711, "cheese"), (os.getpid(), "ourselves")):
        (tmp_path / f"proc/{number}/fd").mkdir(parents=True)
        (tmp_path / f"proc/{number}/comm").write_text(f"{name}\n")
        (tmp_path / f"proc/{number}/fd/5").symlink_to(device)
    (tmp_path / "proc/12/fd").mkdir(parents=True)
    (tmp_path / "by-id").symlink_to(device)
    assert holders(tmp_path / "by-id", proc=tmp_path / "proc") == [(4711, "cheese")]
    assert holders_text(device, proc=tmp_path / "proc") == "cheese (process 4711)"
    assert "may not see" in holders_text(tmp_path / "other", proc=tmp_path / "proc") or not os.getuid()


def test_an_open_file_of_another_process_is_seen_for_real(tmp_path: Path) -> None:
    import subprocess
    import sys

    path = tmp_path / "device"
    path.touch()
    code = f"import sys; f = open({str(path)!r}); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        assert [number for number, _ in holders(path)] == [other.pid]
        other.communicate()


# ---- controls ----


def controls_of(**changes: FakeControl) -> tuple[FakeCamera, V4l2Controls]:
    kernel, camera = fake()
    return camera, Device(PATH, kernel=kernel).controls


def test_locking_switches_everything_automatic_off_and_keeps_what_is_not_named() -> None:
    camera, controls = controls_of()
    controls.lock({"exposure_us": 8000, "white_balance_k": 5000})
    values = {number: control.value for number, control in camera.controls.items()}
    assert values == {c.EXPOSURE_AUTO: 1, c.EXPOSURE: 80, c.DYNAMIC_RATE: 0, c.GAIN: 0, c.WHITE_BALANCE_AUTO: 0,
                      c.WHITE_BALANCE: 5000, c.POWER_LINE: 0}  # fmt: skip
    assert all(controls.locked().values())
    controls.verify()


def test_values_are_in_units_and_read_back_from_the_camera() -> None:
    camera, controls = controls_of()
    assert controls.names() == ("exposure_us", "gain", "white_balance_k")
    assert controls.range("exposure_us") == (100, 500_000, 100)
    assert controls.set("exposure_us", 7849) == 7800
    assert controls.read("exposure_us") == 7800
    assert controls.set("white_balance_k", 5004) == 5000
    assert camera.controls[c.EXPOSURE_AUTO].value == 1, "set alone switches the automatic off too"


def test_a_value_out_of_range_and_a_control_that_is_not_there_are_refused() -> None:
    camera, controls = controls_of()
    with pytest.raises(InputError, match="takes 2800 to 6500 in steps of 10"):
        controls.set("white_balance_k", 9000)
    del camera.controls[c.GAIN]
    with pytest.raises(CameraError, match=r"no control gain \(it has: exposure_us, white_balance_k\)"):
        controls.set("gain", 3)


def test_an_exposure_longer_than_the_frame_period_is_refused_with_the_way_out() -> None:
    kernel, camera = fake()
    with pytest.raises(InputError, match=r"exposure of 40 ms is longer than the frame period of 33.33 ms.*at most 25"):
        V4l2Camera(PATH, parse_url(f"v4l2://{PATH}?exposure_us=40000")[1], kernel=kernel)
    camera.controls[c.EXPOSURE].value = 500
    with pytest.raises(CameraError, match="exposure of 50 ms is longer"):
        V4l2Camera(PATH, kernel=kernel)
    assert not kernel.opened


@pytest.mark.parametrize("number", [c.EXPOSURE, c.WHITE_BALANCE_AUTO, c.DYNAMIC_RATE])
def test_a_control_that_does_not_hold_is_an_error(number: int) -> None:
    camera, controls = controls_of()
    camera.controls[number].keeps = lambda value: value + 1
    with pytest.raises(CameraError, match=r"does not keep its settings: .* was set to \S+ and is \S+; use a camera"):
        controls.lock({"exposure_us": 8000})


def test_a_control_that_is_reset_when_the_stream_starts_is_an_error() -> None:
    kernel, camera = fake(payload=lambda number: jpeg(scene(number)))
    with V4l2Camera(PATH, parse_url("v4l2://x?exposure_us=8000")[1], shape=(480, 640), kernel=kernel) as opened:
        camera.controls[c.EXPOSURE].value = 157
        with pytest.raises(CameraError, match="exposure_us was set to 8000 and is 15700"):
            opened.read()


def test_a_refusal_by_the_camera_is_told() -> None:
    kernel, camera = fake()
    controls = Device(PATH, kernel=kernel).controls
    camera.errors[v.S_CTRL] = errno.EIO
    with pytest.raises(CameraError, match="refuses the dynamic frame rate = 0"):
        controls.lock({})


# ---- decoding ----

MJPG = Mode(letters="MJPG", width=640, height=480, fps=30)


def test_a_whole_jpeg_is_decoded_and_zeros_behind_it_do_not_matter() -> None:
    image = scene()
    data = jpeg(image)
    assert np.abs(decode(data, MJPG).astype(int) - image).mean() < 3
    assert (decode(data + bytes(40), MJPG) == decode(data, MJPG)).all()


def test_a_jpeg_without_its_huffman_tables_is_decoded_as_cameras_send_it() -> None:
    data = jpeg(scene())
    stripped, place = data[:2], 2
    while data[place + 1] != 0xDA:
        length = 2 + int.from_bytes(data[place + 2 : place + 4])
        stripped += b"" if data[place + 1] == 0xC4 else data[place : place + length]
        place += length
    stripped += data[place:]
    assert len(stripped) < len(data)
    assert (decode(stripped, MJPG) == decode(data, MJPG)).all()


def test_a_jpeg_that_lost_bytes_anywhere_is_never_taken_for_whole() -> None:
    data, rng = jpeg(scene()), np.random.default_rng(1)
    for _ in range(60):
        start = int(rng.integers(700, len(data) - 3000))
        cut = data[:start] + data[start + int(rng.integers(20, 2500)) :]
        with pytest.raises(CorruptPictureError):
            decode(cut, MJPG)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-2],
        lambda data: data[1:],
        lambda data: data[: len(data) // 2] + b"\xff\xd9",
        lambda data: b"\xff\xd8\xff\xd9",
        lambda data: b"",
    ],
)
def test_what_is_no_whole_jpeg_is_refused(change: Callable[[bytes], bytes]) -> None:
    with pytest.raises(CorruptPictureError):
        decode(change(jpeg(scene())), MJPG)


def test_a_jpeg_of_another_size_is_refused() -> None:
    with pytest.raises(CorruptPictureError, match="shape"):
        decode(jpeg(scene(shape=(240, 320))), MJPG)


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
    with open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel=kernel) as camera:
        frames = [camera.read() for _ in range(8)]
    assert all(frame.sequence % 3 != 1 for frame in frames)
    assert camera.counts.corrupt == 4
    assert all(frame.source == f"v4l2://{PATH}?width=640&height=480" for frame in frames)
    assert camera.status()["mode"] == "MJPG 640x480 at 30 fps"
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_a_camera_that_never_sends_a_whole_picture_is_stalled() -> None:
    kernel, _ = fake()
    camera = open_v4l2(f"v4l2://{PATH}?width=640&height=480", kernel=kernel)
    with camera, pytest.raises(StalledError, match="not whole"):
        camera.read()


@pytest.mark.parametrize(
    ("driver", "flags", "setting", "wanted_s"),
    [
        ("other", v.SOURCE_SOE, "0", 0.0),
        ("uvcvideo", v.SOURCE_SOE, "1", 0.0),
        ("uvcvideo", v.SOURCE_SOE, "0", -0.008),
        ("other", 0, "0", -0.008 - 1 / 30),
    ],
)
def test_the_start_of_the_exposure_follows_from_what_the_stamp_means(
    tmp_path: Path, driver: str, flags: int, setting: str, wanted_s: float
) -> None:
    (tmp_path / "module/uvcvideo/parameters").mkdir(parents=True)
    (tmp_path / "module/uvcvideo/parameters/hwtimestamps").write_text(f"{setting}\n")
    kernel, _ = fake(driver=driver, flags=v.TIMESTAMP_MONOTONIC | flags, payload=lambda number: b"\x80" * 32 * 24 * 2)
    options = parse_url("v4l2://x?exposure_us=8000&width=32&height=24")[1]
    with V4l2Camera(PATH, options, kernel=kernel, sysfs=tmp_path) as camera:
        assert camera.read().time_s == pytest.approx(100.0 + wanted_s, abs=1e-5)


def test_a_stamp_in_the_future_gives_way_to_the_arrival() -> None:
    kernel, _ = fake(stamp=lambda number, time_s: time_s + 5, payload=lambda number: b"\x80" * 32 * 24 * 2)
    url = f"v4l2://{PATH}?exposure_us=8000&width=32&height=24&readout_us=12000"
    with open_v4l2(url, kernel=kernel) as camera:
        frame = camera.read()
        assert frame.time_s == pytest.approx(kernel.now_s - 0.020, abs=1e-5)


def test_hardware_stamps_of_a_kernel_without_the_parameter_are_not_assumed(tmp_path: Path) -> None:
    assert not hardware_stamps("uvcvideo", sysfs=tmp_path)


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("format=H264", "format"),
        ("fps=0", "fps"),
        ("speed=3", "speed: Extra inputs.*parameters: width, height, format"),
        ("width=640", "width and height together"),
        ("exposure_us=x", "exposure_us"),
    ],
)
def test_wrong_parameters_of_a_url_are_named(query: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_url(f"v4l2:///dev/video0?{query}")


def test_a_url_keeps_its_path_and_its_options() -> None:
    path, options = parse_url("v4l2:///dev/v4l/by-id/usb-X_1-video-index0?format=yuyv&fps=25&gain=3")
    assert path == "/dev/v4l/by-id/usb-X_1-video-index0"
    assert options.wanted((480, 640)) == Wanted(width=640, height=480, letters="YUYV", fps=25)
    assert options.controls() == {"gain": 3}
