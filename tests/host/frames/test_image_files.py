"""Image files as a camera: order, end, and every kind of file that is not a picture of the gel."""

import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import CameraError, InputError
from gellight.frames import video_files
from gellight.frames.camera import Camera, EndOfStream
from gellight.frames.image_files import ImageCamera, image_files, read_image, read_levels
from gellight.opening import open_camera
from tests.helpers.children import run

SHAPE = (6, 8)


def write_image(path: Path, value: int = 0, shape: tuple[int, ...] = (*SHAPE, 3), kind: type = np.uint8) -> Path:
    image = np.full(shape, value, kind)
    image[0, 0] = 7
    assert cv2.imwrite(str(path), image)
    return path


def test_a_folder_is_read_in_natural_order_and_ends(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        write_image(tmp_path / f"press{number}.png", number)
    (tmp_path / "notes.txt").write_text("not an image")
    with open_camera(tmp_path) as camera:
        assert isinstance(camera, Camera)
        assert camera.image_shape == SHAPE
        assert camera.stage is None
        frames = [camera.read() for _ in range(3)]
        with pytest.raises(EndOfStream, match="all of its 3 images"):
            camera.read()
        with pytest.raises(EndOfStream):
            camera.read()
    assert [int(f.image[1, 1, 0]) for f in frames] == [1, 2, 10]
    assert [f.sequence for f in frames] == [0, 1, 2]
    assert [Path(f.source).name for f in frames] == ["press1.png", "press2.png", "press10.png"]
    assert frames[0].time_s <= frames[1].time_s <= frames[2].time_s
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


@pytest.mark.parametrize("name", ["red.png", "red.webp"])
def test_channels_are_rgb(tmp_path: Path, name: str) -> None:
    bgr = np.zeros((*SHAPE, 3), np.uint8)
    bgr[..., 2] = 200
    cv2.imwrite(str(tmp_path / name), bgr, [cv2.IMWRITE_WEBP_QUALITY, 101])  # without loss
    image = open_camera(tmp_path).read().image
    assert image.dtype == np.uint8
    assert image.flags.c_contiguous
    assert (image == [200, 0, 0]).all()


def test_a_pattern_and_a_single_file_are_read(tmp_path: Path) -> None:
    write_image(tmp_path / "a1.png", 1)
    write_image(tmp_path / "a2.bmp", 2)
    write_image(tmp_path / "b1.png", 3)
    camera = open_camera(str(tmp_path / "a*"))
    assert [Path(camera.read().source).name for _ in range(2)] == ["a1.png", "a2.bmp"]
    assert open_camera(str(tmp_path / "b1.png")).read().image[1, 1, 1] == 3


def test_an_empty_folder_and_what_does_not_exist_are_refused_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match=r"has no images \(\.png"):
        open_camera(tmp_path)
    with pytest.raises(CameraError, match="no images"):
        ImageCamera([])
    with pytest.raises(CameraError, match=r"is no file, no folder and no pattern .* give an image or video file"):
        open_camera(str(tmp_path / "none*.png"))
    with pytest.raises(InputError, match="does not exist: check the name"):
        read_image(tmp_path / "none.png")
    with pytest.raises(InputError, match="image /dev/null is no file: check the name"):
        read_image(Path("/dev/null"))


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_images_are_taken_as_they_are(tmp_path: Path, channels: int, kind: type) -> None:
    """One channel becomes three, 16 bit become 8, alpha is left out; nothing else changes."""
    levels = np.random.default_rng(0).integers(0, 256, (*SHAPE, channels)).astype(kind)
    stored = levels * np.uint16(257) - levels // 2 if kind is np.uint16 else levels
    assert cv2.imwrite(str(tmp_path / "x.png"), stored)
    image = open_camera(tmp_path / "x.png").read().image
    assert (image.dtype, image.shape) == (np.uint8, (*SHAPE, 3))
    np.testing.assert_array_equal(image, np.repeat(levels, 3, axis=2) if channels == 1 else levels[..., 2::-1])
    deep = read_levels(tmp_path / "x.png")
    np.testing.assert_array_equal(deep, stored[..., 0] if channels == 1 else stored[..., 2::-1])


def test_values_of_another_type_are_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "x.tiff"), np.zeros(SHAPE, np.float32))
    with pytest.raises(InputError, match=r"x\.tiff has values of type float32: save it with 8 or 16 bit"):
        open_camera(tmp_path / "x.tiff")


def write_video(path: Path, count: int) -> Path:
    """Write a video whose pictures get brighter one by one."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (64, 48))
    for number in range(count):
        writer.write(np.full((48, 64, 3), 10 * number, np.uint8))
    writer.release()
    return path


def test_pictures_that_are_no_stream_follow_nothing_in_time(tmp_path: Path) -> None:
    """So a frame path that remembers the frame before begins anew with each."""
    camera = ImageCamera([write_image(tmp_path / "a.png"), write_image(tmp_path / "b.png")])
    assert camera.read().time_s == camera.read().time_s


@pytest.mark.parametrize(("suffix", "code"), [(".avi", "MJPG"), (".mp4", "mp4v")])
def test_pictures_of_a_video_have_the_times_of_the_video(suffix: str, code: str, tmp_path: Path) -> None:
    video = tmp_path / f"press{suffix}"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*code), 5, (64, 48))
    for number in range(4):
        writer.write(np.full((48, 64, 3), 10 * number, np.uint8))
    writer.release()
    with open_camera(video) as camera:
        times_s = [camera.read().time_s for _ in range(4)]
    np.testing.assert_allclose(np.diff(times_s), 0.2, atol=1e-6)
    assert time.monotonic() - 60 < times_s[-1] <= time.monotonic()
    assert ImageCamera(image_files(str(video))).read().time_s == 0


def test_a_video_whose_pictures_have_no_stamps_goes_by_its_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unstamped:
        def __init__(self, path: str) -> None:
            self.left = 3

        def isOpened(self) -> bool:  # noqa: N802  (OpenCV's name)
            return True

        def get(self, what: int) -> float:
            return 25.0 if what == cv2.CAP_PROP_FPS else 0.0

        def grab(self) -> bool:
            self.left -= 1
            return self.left >= 0

    monkeypatch.setattr(cv2, "VideoCapture", Unstamped)
    assert video_files._Video(tmp_path / "x.avi").times_s == [0, 0.04, 0.08]


def test_a_video_is_read_picture_by_picture_in_order(tmp_path: Path) -> None:
    video = write_video(tmp_path / "press.avi", 12)
    with open_camera(video) as camera:
        frames = [camera.read() for _ in range(12)]
        with pytest.raises(EndOfStream, match="all of its 12 images"):
            camera.read()
    assert [round(float(frame.image.mean()) / 10) for frame in frames] == list(range(12))
    assert Path(frames[3].source) == video / "press-000003.png"
    # A picture by its name, as a csv of presses gives it, also backwards; what is beyond the end changes nothing.
    for number in (7, 2, 40, 11):
        if number == 40:
            with pytest.raises(InputError, match="ends after 12 pictures: number 40"):
                read_image(video / f"press-{number:06}.png")
            continue
        image = read_image(video / f"press-{number:06}.png")
        np.testing.assert_array_equal(image, frames[number].image)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.mp4", b"no video", r"x\.mp4 is no video that can be decoded: convert it"),
        ("x.csv", b"1,2", r"x\.csv is not an image by its name"),
        ("x.png", b"not an image", r"x\.png is not an image or is cut off"),
        (
            "z.png",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:0",
            r"z\.png .* Git LFS: run `git lfs pull`",
        ),
        ("y.png", b"", r"y\.png is not an image or is cut off"),
    ],
)
def test_a_file_of_another_type_or_damaged_is_refused(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said):
        open_camera(tmp_path / name)


def test_images_of_two_sizes_are_refused_by_name(tmp_path: Path) -> None:
    write_image(tmp_path / "1.png")
    write_image(tmp_path / "2.png", shape=(6, 9, 3))
    camera = open_camera(tmp_path)
    camera.read()
    with pytest.raises(InputError, match=r"2\.png is 9 x 6 px, 1\.png is 8 x 6 px"):
        camera.read()


BOMB = """
import sys
import time
import gellight
from gellight.frames.image_files import read_image
from gellight.base.errors import InputError
from pathlib import Path
try:
    read_image(Path(sys.argv[1]))
except InputError as error:
    print(str(error).splitlines()[0])
print(next(int(line.split()[1]) // 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def test_a_jpeg_that_breaks_off_is_refused_and_what_lies_behind_one_is_not(tmp_path: Path) -> None:
    data = cv2.imencode(".jpg", np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8))[1].tobytes()
    cut, filled = tmp_path / "cut.jpg", tmp_path / "filled.jpg"
    filled.write_bytes(data + bytes(9000))
    assert read_image(filled).shape == (48, 64, 3)
    for damaged in (data[: len(data) // 2], data[: len(data) // 2] + data[-2:]):
        cut.write_bytes(damaged)
        with pytest.raises(InputError, match="copy it again"):
            read_image(cut)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_small_file_that_would_take_gigabytes_is_refused(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bomb{suffix}"
    content = bytearray(cv2.imencode(suffix, np.zeros((24, 32, 3), np.uint8))[1].tobytes())
    if suffix == ".png":
        content[33:37] = b"\xff\xf5\xb7\x49"  # what its second chunk claims to be
    else:
        size = content.index(b"\xff\xc0") + 5
        content[size : size + 4] = (32000).to_bytes(2) * 2
    path.write_bytes(content)
    done = run([sys.executable, "-c", BOMB, path], check=True)
    text, peak_mb = done.stdout.splitlines()
    assert str(path) in text
    assert int(peak_mb) < 1500


def test_a_picture_of_more_than_8192_by_8192_pixels_is_refused(tmp_path: Path) -> None:
    large, larger = tmp_path / "large.png", tmp_path / "larger.png"
    for path, rows in ((large, 8192), (larger, 8193)):
        cv2.imwrite(str(path), np.zeros((rows, 8192), np.uint8))
    assert read_levels(large).shape == (8192, 8192)
    with pytest.raises(InputError, match=r"larger\.png"):
        read_levels(larger)
