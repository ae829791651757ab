"""The plane of the untouched gel: found beside a press, held where too little is seen, slow, and the same in C."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.native import judge, library
from gellight.reconstruction.rest_plane import RestPlane, plane_at_rest, tilt
from tests.helpers.native_forms import agree, both

SHAPE = (120, 160)
PLANE = np.array([4e-4, -3e-4])
Y, X = np.indices(SHAPE)


def pressed(x: float = 80, y: float = 60, radius: float = 25) -> tuple[np.ndarray, np.ndarray]:
    """A cap 0.8 mm deep on gel that bulges beside it, tilted; and where it is touched."""
    r = np.hypot(X - x, Y - y)
    depth = np.where(r < radius, 0.8 * (1 - (r / radius) ** 2), -0.03 * np.exp(-(r - radius) / 10))
    return (depth + tilt(PLANE, SHAPE) + 0.1).astype(np.float32), r < radius


def test_the_plane_is_that_of_the_gel_at_rest_and_the_height_stays() -> None:
    depth, touched = pressed()
    found = plane_at_rest(depth, touched)
    np.testing.assert_allclose(found, PLANE, atol=2e-5)
    np.testing.assert_array_equal(RestPlane().following(depth, touched, 0.0), found)


def test_a_touch_that_nobody_noticed_counts_little() -> None:
    depth, touched = pressed()
    unseen = np.hypot(X - 130, Y - 30) < 10
    np.testing.assert_allclose(plane_at_rest(depth + 0.3 * unseen, touched), PLANE, atol=1e-4)


@pytest.mark.parametrize(("x", "known"), [(80, True), (20, True), (None, False)])
def test_three_sides_have_to_be_free(x: float | None, known: bool) -> None:
    depth, touched = pressed(80 if x is None else x)
    if x is None:
        touched = (X < 60) | (Y < 50)
    assert (plane_at_rest(depth, touched) is not None) is known


def test_in_a_video_it_moves_slowly_and_is_held_where_it_cannot_be_seen() -> None:
    path, (depth, touched) = RestPlane(), pressed()
    everywhere = np.ones(SHAPE, np.bool_)
    path.following(depth - tilt(PLANE, SHAPE), touched, 10.0)
    steps = np.array([path.following(depth, touched, 10.0 + k / 30) for k in range(1, 61)])
    share = steps[:, 0] / PLANE[0]
    assert share[0] < 0.1
    assert np.all(np.diff(share) > 0)
    assert share[14] == pytest.approx(1 - np.exp(-1), abs=0.1)
    assert share[-1] > 0.95
    np.testing.assert_array_equal(path.following(depth, everywhere, 12.05), steps[-1])
    np.testing.assert_array_equal(path.following(depth, everywhere, 13.04), steps[-1])
    # A picture of another time stands for itself.
    assert not path.following(depth, everywhere, 14.05).any()
    assert not path.following(depth, everywhere, 0.0).any()


@pytest.mark.skipif(not library.fitting(), reason="no library is built for this machine")
@pytest.mark.parametrize("height_mm", [0.0, 53.12])
def test_the_frame_path_takes_it_off_in_c_as_in_numpy(height_mm: float) -> None:
    shipped = load_bundle("synthetic")
    bundle = replace(shipped, manifest=shipped.manifest.model_copy(update={"camera_height_mm": height_mm}))
    frame = CameraFrame(image=judge.made_up_image(bundle, 0), time_s=0.0, sequence=0)
    native, pixels = both(replace(bundle, manifest=bundle.manifest.model_copy(update={"level_plane": True})))
    found, right = native.reconstruct(frame), pixels.reconstruct(frame)
    agree(found, right)
    if height_mm:  # what is taken off is a plane of the logarithm of the distance to the camera
        return
    without = both(bundle)[0].reconstruct(frame)
    taken = np.gradient(without.depth_mm - found.depth_mm)
    assert np.abs(taken).max() > 1e-6
    for along in taken:
        np.testing.assert_allclose(along, along.mean(), atol=2e-5)
    size_x, size_y = bundle.pixel_size_mm
    change = without.gradient_map - found.gradient_map
    np.testing.assert_allclose(
        change.mean(axis=(0, 1)), [taken[1].mean() / size_x, taken[0].mean() / size_y], atol=1e-3
    )
