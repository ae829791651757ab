"""JPEGs that are not whole are never taken for whole, and JPEGs as cameras send them are."""

import re
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from gellight.frames.jpeg import CorruptPictureError, decode_jpeg, layout_of
from tests.helpers.v4l2_pictures import SAMPLINGS, coded_jpeg, jpeg, scene

SHAPE = (240, 320)
KINDS = [(sampling, restart) for sampling in SAMPLINGS for restart in (0, 4, 40)]
MARKER = re.compile(rb"\xff[\xd0-\xd9]")


def data_at(data: bytes) -> int:
    layout = layout_of(data)
    return layout.data_at


def accepted(data: bytes) -> bool:
    try:
        decode_jpeg(data, SHAPE)
    except CorruptPictureError:
        return False
    return True


# ---- whole ones ----


def test_a_jpeg_nearly_as_tall_as_its_header_can_say_is_of_a_kind_that_cannot_be_judged() -> None:
    """None may be so much taller that too much data would show."""
    for rows, judged in ((64_000, True), (65_500, False)):
        data = coded_jpeg(np.zeros((rows, 16, 3), np.uint8), "4:2:0", 0)
        assert (layout_of(data) is not None) is judged
        assert decode_jpeg(data, (rows, 16)).shape == (rows, 16, 3)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("restart", [0, 4])
@pytest.mark.parametrize("own_tables", [0, 1])
def test_a_grey_gel_under_white_light_is_decoded(sampling: str, restart: int, own_tables: int) -> None:
    """Its last blocks may be exactly at the mid-grey that blocks without data have."""
    slope = 0.02 * np.indices(SHAPE)[::, ::-1, ::-1].sum(axis=0)
    for level in np.arange(126.0, 131.0, 0.5):
        grey = level + slope + np.random.default_rng(0).normal(0, 1, SHAPE)
        image = np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2)
        options = [cv2.IMWRITE_JPEG_QUALITY, 50, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, SAMPLINGS[sampling],
                   cv2.IMWRITE_JPEG_RST_INTERVAL, restart, cv2.IMWRITE_JPEG_OPTIMIZE, own_tables]  # fmt: skip
        assert accepted(cv2.imencode(".jpg", image, options)[1].tobytes()), level


@pytest.mark.parametrize(("sampling", "restart"), KINDS)
@pytest.mark.parametrize("shape", [SHAPE, (60, 80), (36, 50)])
def test_a_whole_jpeg_is_decoded_as_by_opencv_to_the_last_row_without_a_word(
    sampling: str, restart: int, shape: tuple[int, int], capfd: pytest.CaptureFixture[str]
) -> None:
    """The decoder writes to standard error by itself: a line for every picture would bury everything else."""
    for image in (scene(shape=shape), np.zeros((*shape, 3), np.uint8), np.full((*shape, 3), 127, np.uint8)):
        data = coded_jpeg(image, sampling, restart)
        plain = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
        capfd.readouterr()
        assert (decode_jpeg(data, shape) == plain).all()
        assert capfd.readouterr().err == ""


def test_a_jpeg_with_tables_of_its_own_is_decoded_too(capfd: pytest.CaptureFixture[str]) -> None:
    options = [cv2.IMWRITE_JPEG_QUALITY, 90, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    data = cv2.imencode(".jpg", scene(shape=SHAPE), options)[1].tobytes()
    assert accepted(data)
    assert capfd.readouterr().err == ""
    assert not accepted(data[: len(data) // 2] + data[-2:])


def test_only_tables_of_its_own_are_unusual() -> None:
    """A camera may leave the usual ones out; then the decoder takes them by itself."""
    data = coded_jpeg(scene(shape=SHAPE))
    own = cv2.imencode(".jpg", scene(shape=SHAPE), [cv2.IMWRITE_JPEG_OPTIMIZE, 1])[1].tobytes()
    without = data
    while (at := without.find(b"\xff\xc4")) >= 0:
        without = without[:at] + without[at + 2 + int.from_bytes(without[at + 2 : at + 4]) :]
    assert [layout_of(one).usual for one in (data, own, without)] == [True, False, True]
    assert (decode_jpeg(without, SHAPE) == decode_jpeg(data, SHAPE)).all()


@pytest.mark.parametrize(("place", "length"), [(5, 2), (7, 2), (11, 1)], ids=["height", "width", "sampling"])
def test_a_header_without_a_size_has_no_layout(place: int, length: int) -> None:
    data = coded_jpeg(scene(shape=SHAPE))
    at = data.index(b"\xff\xc0") + place
    assert layout_of(data[:at] + bytes(length) + data[at + length :]) is None


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_a_whole_jpeg_of_any_width_is_decoded(sampling: str) -> None:
    """Where a width is no multiple of an MCU, the last of each row is cut off."""
    for width in (2, 7, 9, 17, 24, 30, 132, 136, 140, 264, 270):
        assert (decode_jpeg(coded_jpeg(scene(shape=(24, width)), sampling), (24, width))).shape == (24, width, 3)


def test_filling_behind_the_end_and_zeros_before_it_do_not_matter() -> None:
    data = coded_jpeg(scene(shape=SHAPE))
    whole = decode_jpeg(data, SHAPE)
    for filling in (bytes(40), bytes(range(200)) * 10, b"\xff" * 9, coded_jpeg(scene(1, SHAPE), restart=40)[-3000:]):
        assert (decode_jpeg(data + filling, SHAPE) == whole).all()
    assert (decode_jpeg(data[:-2] + bytes(300) + data[-2:], SHAPE) == whole).all()


@pytest.mark.parametrize(("sampling", "restart"), KINDS)
def test_ten_bytes_too_many_before_each_marker_do_not_matter_as_some_cameras_leave_them(
    sampling: str, restart: int
) -> None:
    rng = np.random.default_rng(4)
    data = coded_jpeg(scene(shape=SHAPE), sampling, restart)
    begin = data_at(data)

    def padded(marker: re.Match[bytes]) -> bytes:
        return bytes(rng.integers(1, 255, int(rng.integers(11)), np.uint8)) + marker.group()

    for _ in range(5):
        assert accepted(data[:begin] + MARKER.sub(padded, data[begin:]))


def test_mid_grey_that_was_seen_is_no_fault() -> None:
    corner = scene(shape=SHAPE)
    corner[200:, 250:] = 128
    assert accepted(coded_jpeg(corner, quality=50))
    smooth = np.broadcast_to(np.linspace(126, 130, 320)[:, None].astype(np.uint8), (*SHAPE, 3))
    assert accepted(coded_jpeg(smooth, restart=4, quality=50))


# ---- damaged ones ----


@pytest.mark.parametrize(("sampling", "restart"), KINDS)
def test_a_jpeg_that_lost_bytes_is_not_taken_for_whole(sampling: str, restart: int) -> None:
    data, rng = coded_jpeg(scene(shape=SHAPE), sampling, restart), np.random.default_rng(1)
    begin, taken = data_at(data), 0
    for _ in range(40):
        start = int(rng.integers(begin, len(data) - 1500))
        taken += accepted(data[:start] + data[start + int(rng.integers(20, 1200)) :])
    assert taken <= 1, "OpenCV takes all 40 where restart markers are far apart"


@pytest.mark.parametrize(("sampling", "restart"), [*KINDS[::3], ("4:2:2", 4)])
def test_two_pictures_that_were_spliced_are_not_taken_for_one(sampling: str, restart: int) -> None:
    pictures, rng = [coded_jpeg(scene(seed, SHAPE), sampling, restart) for seed in range(2)], np.random.default_rng(2)
    begin, taken = data_at(pictures[0]), 0
    for _ in range(40):
        leave, join = (int(rng.integers(begin + 50, len(data) - 300)) for data in pictures)
        taken += accepted(pictures[0][:leave] + pictures[1][join:])
    assert taken <= 2, "half of them have data enough, or too much"


def test_a_restart_marker_that_is_lost_or_out_of_order_is_noticed() -> None:
    data = coded_jpeg(scene(shape=SHAPE), restart=40)
    begin = data_at(data)
    places = [begin + found.start() for found in MARKER.finditer(data[begin:])]
    with pytest.raises(CorruptPictureError, match="13 of 14 restart markers"):
        decode_jpeg(data[: places[5]] + data[places[5] + 2 :], SHAPE)
    with pytest.raises(CorruptPictureError, match="6 of 14 restart markers"):
        decode_jpeg(data[: places[5]] + data[places[13] :], SHAPE)
    with pytest.raises(CorruptPictureError, match="not in their order"):
        decode_jpeg(data[: places[5]] + b"\xff\xd7" + data[places[5] + 2 :], SHAPE)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-2],
        lambda data: data[1:],
        lambda data: data[: len(data) // 2] + b"\xff\xd9",
        lambda data: data[:300] + b"\xff\xd9",
        lambda data: b"\xff\xd8\xff\xc0\xff\xd9",
        lambda data: b"\xff\xd8\xff\xd9",
        lambda data: b"\xff\xd8\xff\xc0\x00\x02\xff\xda\x00\x02\xff\xd9",
        lambda data: b"\xff\xd8\xff\xc0\x00\x0b\x08\x00\xf0\x01\x40\x03\xff\xda\x00\x02\xff\xd9",
        lambda data: b"",
    ],
)
def test_what_is_no_whole_jpeg_is_refused(change: Callable[[bytes], bytes]) -> None:
    assert accepted(coded_jpeg(scene(shape=SHAPE)))
    assert not accepted(change(coded_jpeg(scene(shape=SHAPE))))


def test_a_jpeg_of_another_size_is_refused() -> None:
    with pytest.raises(CorruptPictureError, match="of 160x120"):
        decode_jpeg(jpeg(scene(shape=(120, 160))), SHAPE)
