"""What is known along the gel arrives where it is sent: on the wire, in recordings, in messages of ROS 2."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError, StreamError
from gellight.frames.frames import CaptureStamp, TactileFrame
from gellight.frames.measures import Force
from gellight.frames.shear import DotsSeen, Shear, Unseen
from gellight.opening import open_camera
from gellight.recording.recording_file import Recording, RecordingWriter
from gellight.stream.ros_topics import covariance_of, wrench_of
from gellight.stream.wire import decode, encode
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.streamed import full_frame

REST = np.array([[10.0, 10.0], [30.0, 10.0], [50.0, 10.5]])
DOTS = DotsSeen(
    rest_px=REST, places_px=REST + np.array([[0.5, -0.25], [0, 0], [1.125, 0]]),
    reasons=np.array([Unseen.SEEN, Unseen.MISSING, Unseen.SEEN], np.uint8),
)  # fmt: skip
SHEAR = Shear(
    dots=DOTS, field_mm=np.array([[0.05, -0.025], [np.nan, np.nan], [0.1125, 0]]), force_n=(0.3, -0.4),
    force_error_n=(0.02, 0.03), torque_nmm=1.5, torque_error_nmm=0.25, centre_mm=(2.0, -3.0), flags=("few_dots",),
)  # fmt: skip
PRESSED = Force(normal_n=2.0, error_n=0.1, pressure_of=lambda: np.zeros((1, 1), np.float32))


def frame_of(shear: Shear | None, dots: DotsSeen | None = DOTS) -> TactileFrame:
    felt = full_frame()
    frame = replace(felt, camera_frame=replace(felt.camera_frame, dots=dots))
    vars(frame)["shear"] = shear
    return frame


def no_bundle(zero: str) -> None:
    raise AssertionError("nobody asked for the bundle")


def test_a_gel_without_dots_sends_nothing_of_them() -> None:
    message = encode(frame_of(None, None))
    assert b'"dots":null,"shear":null,"slip":null' in message
    assert decode(message, no_bundle).shear is None
    older = re.sub(rb'"dots":null,"shear":null,"slip":null,', lambda found: b" " * len(found[0]), message)
    assert decode(older, no_bundle).shear is None


@pytest.mark.parametrize("spoil", [
    lambda text: text.replace(b'"reasons":[0,1,0]', b'"reasons":[0,1]  '),
    lambda text: text.replace(b'"reasons":[0,1,0]', b'"reasons":[0,9,0]'),
    lambda text: text.replace(b'"field_mm":[[0.05,-0.025],', b'"field_mm":[              '),
])  # fmt: skip
def test_damaged_dots_are_refused(spoil: Callable[[bytes], bytes]) -> None:
    with pytest.raises(StreamError, match="damaged"):
        decode(spoil(encode(frame_of(SHEAR))), no_bundle)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path, bundle = tmp_path / "dots.mcap", linear_bundle(tmp_path / "bundle")
    with RecordingWriter(path, "finger") as writer:
        for number, dots in enumerate((DOTS, None)):
            frame = replace(full_frame().camera_frame, dots=dots, sequence=number + 1)
            writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + number))
    return path


def test_a_recording_keeps_the_dots_that_are_filled_in_its_pictures(recorded: Path) -> None:
    with open_camera(f"replay://{recorded}?speed=0") as camera:
        first, second = camera.read().dots, camera.read().dots
    np.testing.assert_array_equal(first.places_px, DOTS.places_px)
    np.testing.assert_array_equal(first.seen, [True, False, True])
    assert second is None


def test_damaged_dots_of_a_recording_are_named(recorded: Path) -> None:
    record = next(Recording(recorded).frames())
    spoiled = record.info.model_copy(update={"dots": record.info.dots.model_copy(update={"reasons": (0,)})})
    with pytest.raises(InputError, match="the dots of frame 1 are damaged"):
        replace(record, info=spoiled).camera_frame("x.mcap")


def test_the_wrench_is_about_the_middle_of_the_image_with_y_up() -> None:
    # At (2, 3) mm with y up pulls (0.3, 0.4, 2) N, and 1.5 N mm turn from x towards y down: r x F + M by hand.
    wrench = np.array(wrench_of(PRESSED, SHEAR))
    place, force = np.array([2e-3, 3e-3, 0]), np.array([0.3, 0.4, 2.0])
    np.testing.assert_allclose(wrench[:3], force)
    np.testing.assert_allclose(wrench[3:], np.cross(place, force) + np.array([0, 0, -1.5e-3]))


def test_the_covariance_is_that_of_the_wrench() -> None:
    rng = np.random.default_rng(0)
    x, y, normal = (rng.normal(0, one, 20000) for one in (0.02, 0.03, 0.1))
    turn = rng.normal(0, 0.25, 20000)
    drawn = [
        wrench_of(replace(PRESSED, normal_n=2 + n), replace(SHEAR, force_n=(0.3 + a, -0.4 + b), torque_nmm=1.5 + t))
        for a, b, n, t in zip(x, y, normal, turn, strict=True)
    ]
    found, scale = covariance_of(PRESSED, SHEAR), np.sqrt(np.diag(covariance_of(PRESSED, SHEAR)))
    np.testing.assert_allclose(
        np.cov(np.array(drawn).T) / np.outer(scale, scale), found / np.outer(scale, scale), atol=0.04
    )


def test_an_unknown_force_is_no_number() -> None:
    unknown = Shear(dots=DOTS, field_mm=SHEAR.field_mm, unknown="another gel")
    wrench = np.array(wrench_of(PRESSED, unknown))
    assert np.isnan(wrench[[0, 1, 5]]).all()
    assert wrench[2] == 2.0
