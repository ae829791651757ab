"""Streams on a kernel made of nothing: the newest picture, everything else counted, cables told apart."""

import ctypes
import errno
from collections.abc import Callable

import numpy as np
import pytest

from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.errors import StalledError, UnpluggedError
from tests.helpers.v4l2_pictures import fake, streaming

# ---- structures ----


def test_requests_flags_and_controls_have_the_numbers_of_the_kernel_headers() -> None:
    assert (v.QUERYCAP, v.ENUM_FMT, v.G_FMT, v.S_FMT) == (0x80685600, 0xC0405602, 0xC0D05604, 0xC0D05605)
    assert (v.REQBUFS, v.QUERYBUF, v.QBUF, v.DQBUF) == (0xC0145608, 0xC0585609, 0xC058560F, 0xC0585611)
    assert (v.STREAMON, v.STREAMOFF, v.G_PARM, v.S_PARM) == (0x40045612, 0x40045613, 0xC0CC5615, 0xC0CC5616)
    assert (v.G_CTRL, v.S_CTRL, v.QUERYCTRL) == (0xC008561B, 0xC008561C, 0xC0445624)
    assert (v.ENUM_FRAMESIZES, v.ENUM_FRAMEINTERVALS) == (0xC02C564A, 0xC034564B)
    assert ctypes.sizeof(v.Buffer) == 88
    places = v.StreamParameters.numerator, v.FrameSize.size, v.Format.fmt, v.FrameInterval.values, v.Buffer.m
    assert [place.offset for place in places] == [12, 12, 8, 20, 64]
    assert (v.CAPTURE, v.MMAP, v.FIELD_NONE, v.FRAME_DISCRETE, v.CTRL_DISABLED) == (1, 1, 1, 1, 1)
    assert (v.CAP_VIDEO_CAPTURE, v.CAP_STREAMING, v.CAP_DEVICE_CAPS) == (0x1, 0x4000000, 0x80000000)
    assert (v.FLAG_ERROR, v.TIMESTAMP_MASK, v.TIMESTAMP_MONOTONIC) == (0x40, 0xE000, 0x2000)
    assert (v.SOURCE_MASK, v.SOURCE_SOE) == (0x70000, 0x10000)
    assert (c.EXPOSURE_AUTO, c.EXPOSURE, c.DYNAMIC_RATE, c.FOCUS_AUTO) == (0x9A0901, 0x9A0902, 0x9A0903, 0x9A090C)
    assert (c.WHITE_BALANCE_AUTO, c.WHITE_BALANCE) == (0x98090C, 0x98091A)
    assert (c.GAIN_AUTO, c.GAIN, c.POWER_LINE, c.EXPOSURE_MANUAL) == (0x980912, 0x980913, 0x980918, 1)


# ---- the newest picture ----


def test_every_picture_comes_once_and_in_order_also_where_its_numbers_wrap_around() -> None:
    kernel, _ = fake()
    stream = streaming(kernel)
    assert [stream.newest(1).sequence for _ in range(50)] == list(range(50))
    assert stream.counts.delivered == 50
    assert sum(stream.counts.as_json().values()) == 50, "nothing else was counted"
    kernel, _ = fake(sequence=lambda number: (number + 2**32 - 3) % 2**32)
    stream = streaming(kernel)
    assert [stream.newest(1).sequence for _ in range(5)] == [2**32 - 3, 2**32 - 2, 2**32 - 1, 0, 1]
    assert stream.counts.lost == stream.counts.duplicated == 0


def test_no_reader_however_irregular_gets_an_old_picture_and_all_are_accounted_for() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        latency_s = float(rng.uniform(0.001, 0.08))
        kernel, _ = fake(latency_s=latency_s)
        stream = streaming(kernel, buffers=int(rng.integers(3, 9)))
        for _ in range(60):
            kernel.sleep(float(rng.exponential(rng.choice([0.005, 0.03, 0.1, 0.4]))))
            picture = stream.newest(1)
            assert kernel.now_s - picture.stamp_s <= 1 / 30 + latency_s + 1e-6
        counts = stream.counts
        assert counts.delivered + counts.skipped + counts.lost == picture.sequence + 1


def test_pictures_that_never_came_are_counted_and_those_that_come_again_are_not_delivered() -> None:
    kernel, _ = fake(missing=lambda number: number % 5 == 3)
    stream = streaming(kernel)
    last = [stream.newest(1).sequence for _ in range(40)][-1]
    assert stream.counts.lost == sum(number % 5 == 3 for number in range(last))
    kernel, _ = fake(sequence=lambda number: number - (number % 4 == 3))
    stream = streaming(kernel)
    seen = [stream.newest(1).sequence for _ in range(30)]
    assert len(set(seen)) == 30
    assert stream.counts.duplicated == sum(number % 4 == 3 for number in range(seen[-1]))
    kernel, _ = fake(stamp=lambda number, time_s: time_s - (number % 2) / 30)
    stream = streaming(kernel)
    seen = [stream.newest(1).sequence for _ in range(10)]
    assert seen == list(range(0, 20, 2)), "the same time stamp twice is the same picture twice"


def test_damaged_and_empty_pictures_and_those_that_the_driver_gives_up_are_counted_and_not_delivered() -> None:
    kernel, _ = fake(
        bad=lambda number: v.FLAG_ERROR if number % 3 == 1 else 0,
        payload=lambda number: b"" if number % 3 == 2 else b"x" * 10,
    )
    stream = streaming(kernel)
    assert [stream.newest(1).sequence % 3 for _ in range(10)] == [0] * 10
    assert stream.counts.damaged == 18
    kernel, camera = fake()
    stream = streaming(kernel)
    camera.errors[v.DQBUF] = errno.EIO
    with pytest.raises(StalledError, match="only damaged pictures"):
        stream.newest(1)
    assert stream.counts.damaged == 60
    del camera.errors[v.DQBUF]
    stream.newest(1)
    assert stream.counts.delivered == 1


@pytest.mark.parametrize(
    ("lie", "share"),
    [
        (lambda number, time_s: time_s + 1.0, 1.0),
        (lambda number, time_s: time_s - 1.95, 0.0),
        (lambda number, time_s: time_s - 2.05, 1.0),
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


def test_unplugging_in_mid_stream_is_told() -> None:
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


def test_a_poll_error_of_a_camera_that_is_there_is_no_unplugging() -> None:
    kernel, camera = fake()
    stream = streaming(kernel)
    camera.streaming = False
    with pytest.raises(StalledError, match="is there but stopped its stream"):
        stream.newest(1)
