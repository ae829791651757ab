"""What goes there and back is the same, whatever it is: bundles, zeros, recordings, poses."""

import itertools
import math
import os
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gellight.bundle.bundle import REFERENCE, Bundle, load_bundle, packed_bundle, save_bundle, unpack_bundle
from gellight.bundle.contents import encoded_reference
from gellight.frames.frames import CaptureStamp
from gellight.recording.recording_file import Recording, RecordingWriter
from gellight_scan.tracking.rigid import inverse, pose_of, twist_of
from tests.helpers.drawn_frames import check_same, tactile_frames
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.recorded import read_all

sides = st.integers(2, 40)
numbers = itertools.count()


@pytest.fixture(scope="module", autouse=True)
def no_loss_of_power() -> Iterator[None]:
    """Nothing is flushed to the disk, which takes most of the time; `tests/host/base/test_writing.py` looks at that."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield


def reference(shape: tuple[int, int]) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, (*shape, 3), elements=st.floats(0, 255))


@st.composite
def bundles(draw: st.DrawFn, folder: Path) -> Bundle:
    """A bundle of any size, picture, name, control and metric."""
    shape = draw(sides), draw(sides)
    plain = linear_bundle(folder / str(next(numbers)), shape)
    changed = {
        "sensor": draw(st.text(min_size=1, max_size=12)),
        "created": draw(st.datetimes(datetime(1970, 1, 1), datetime(2100, 1, 1), timezones=st.just(UTC))),
        "noise_grey": draw(st.floats(0, 1e6)),
        "camera": draw(st.dictionaries(st.text(max_size=8), st.booleans() | st.integers(-9, 9) | st.text(max_size=5))),
    }
    described = replace(plain, manifest=plain.manifest.model_copy(update=changed))
    given_files = draw(st.dictionaries(st.sampled_from(["lens.json", "a b", "ä"]), st.binary(max_size=50)))
    return described.with_files({**given_files, REFERENCE: encoded_reference(draw(reference(shape)))})


@given(st.data())
@settings(max_examples=25)
def test_a_bundle_comes_back_from_a_file_and_from_a_folder(tmp_path_factory, data: st.DataObject) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path_factory.mktemp("bundles")
    bundle = data.draw(bundles(folder))
    for back in (unpack_bundle(packed_bundle(bundle), "a file"), save_bundle(bundle, folder / "again")):
        assert (back.manifest, back.files, back.identity) == (bundle.manifest, bundle.files, bundle.identity)
    assert load_bundle(folder / "again").identity == bundle.identity


@given(st.data())
@settings(max_examples=25)
def test_the_zero_of_a_zero_is_the_last_one(tmp_path_factory, data: st.DataObject) -> None:  # type: ignore[no-untyped-def]
    plain = linear_bundle(tmp_path_factory.mktemp("zeros") / "bundle", (6, 8))
    first, second = data.draw(reference((6, 8))), data.draw(reference((6, 8)))
    once = plain.with_reference(second, frames=3)
    twice = plain.with_reference(first, frames=2).with_reference(second, frames=3)
    again = once.with_reference(once.reference, frames=3)
    assert once.identity == twice.identity == again.identity
    assert np.abs(once.reference - second).max() <= 1 / 512


@given(st.lists(st.tuples(tactile_frames(), arrays(np.uint8, (6, 8, 3))), min_size=1, max_size=4))
@settings(max_examples=20, suppress_health_check=[HealthCheck.large_base_example, HealthCheck.data_too_large])
def test_a_replay_of_a_replay_is_what_was_recorded(tmp_path_factory, taken: list) -> None:  # type: ignore[no-untyped-def,type-arg]
    """With its light, its label, and its dots, whatever they are."""
    folder = tmp_path_factory.mktemp("replays")
    bundle = linear_bundle(folder / "bundle", (6, 8))
    sent = [
        replace(frame.camera_frame, image=image, time_s=number / 30, sequence=2 * number)
        for number, (frame, image) in enumerate(taken)
    ]
    for name in ("first.mcap", "second.mcap"):
        with RecordingWriter(folder / name, "finger") as writer:
            for frame in sent:
                writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=1e9 + frame.time_s))
        got = read_all(f"replay://{folder / name}?speed=0")
        for one, other in zip(got, sent, strict=True):
            check_same(one, other, but=("source", "time_s", "encoded"))
        sent = [replace(one, time_s=other.time_s) for one, other in zip(got, sent, strict=True)]
    first, second = (list(Recording(folder / name).frames()) for name in ("first.mcap", "second.mcap"))
    assert [(one.info, one.data) for one in first] == [(one.info, one.data) for one in second]


turns = arrays(np.float64, 3, elements=st.floats(-1.7, 1.7)).filter(lambda turn: np.linalg.norm(turn) < math.pi - 0.1)
places = arrays(np.float64, 3, elements=st.floats(-30, 30))


@given(places, turns, places, places)
@example(np.array([3.0, 0, 0]), np.full(3, 4.6e-7), np.zeros(3), np.zeros(3))
def test_a_pose_and_its_inverse_are_none_and_its_twist_comes_back(
    moved: np.ndarray, turn: np.ndarray, about: np.ndarray, point: np.ndarray
) -> None:
    twist = np.concatenate([moved, turn])
    pose = pose_of(twist, about)
    np.testing.assert_allclose(pose @ inverse(pose), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(twist_of(pose, about), twist, atol=1e-7)
    there = pose @ np.append(point, 1.0)
    np.testing.assert_allclose(inverse(pose) @ there, np.append(point, 1.0), atol=1e-10)
