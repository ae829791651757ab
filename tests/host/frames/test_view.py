"""Pixels on the gel, and its view with perspective and surroundings taken out: the same for files, cameras, bundles."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import extend_bundle, load_bundle
from gellight.frames.dots import find_dots
from gellight.frames.picture import FILE_NAME, PictureSteps
from gellight.frames.pixel_grid import block_means, gel_points_mm, over_gel, plane_means, spread_blocks
from gellight.frames.point_cloud import ply, points_of
from gellight.frames.view import View, read_view
from gellight.lab.optics.lens.lattice import view_of_grid
from gellight.opening import open_camera
from tests.helpers.dotted import CORNERS, TAKEN, from_the_side, with_dots
from tests.helpers.linear_sensor import BUNDLE_SHAPE, linear_bundle
from tests.helpers.ply import read_ply

SHAPE = (120, 160)
VIEW = View.of_corners(CORNERS, TAKEN, SHAPE)


def plainly(image: np.ndarray, side: int) -> np.ndarray:
    """The mean of each block, one after the other, in double precision."""
    rows, columns = image.shape[0] // side, image.shape[1] // side
    blocks = [image[side * r : side * (r + 1), side * c : side * (c + 1)] for r in range(rows) for c in range(columns)]
    means = [block.astype(np.float64).mean(axis=(0, 1)) for block in blocks]
    return np.array(means).reshape(rows, columns, *image.shape[2:])


@pytest.mark.parametrize("side", [1, 3, 4, 8, 20])
@pytest.mark.parametrize("shape", [(24, 32), (25, 39, 3), (41, 40, 2)])
def test_means_are_those_of_each_block_and_odd_ends_are_left_out(shape: tuple[int, ...], side: int) -> None:
    values = np.random.default_rng(side).normal(100, 50, shape)
    np.testing.assert_allclose(block_means(values, side), plainly(values, side), rtol=1e-13)
    single = values.astype(np.float32)
    assert block_means(single, side).dtype == np.float32
    np.testing.assert_allclose(block_means(single, side), plainly(single, side), rtol=2e-6, atol=1e-5)


@pytest.mark.parametrize("side", [4, 8, 16, 17])
def test_means_of_bytes_are_exact_and_the_sums_of_the_brightest_do_not_overflow(side: int) -> None:
    white = np.full((2 * side, 3 * side, 3), 255, np.uint8)
    assert block_means(white, side).dtype == np.float32
    assert (block_means(white, side) == 255).all()
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    assert np.array_equal(block_means(image, 8), plainly(image, 8).astype(np.float32))
    planes = np.random.default_rng(1).normal(size=(5, 17, 24))
    assert np.array_equal(plane_means(planes, 8), np.stack([block_means(plane, 8) for plane in planes]))


@pytest.mark.parametrize("shape", [(6, 8), (7, 8), (5, 7)])
def test_pixels_beyond_the_last_block_are_false_and_blocks_beyond_the_image_are_cut(shape: tuple[int, int]) -> None:
    blocks = np.ones((3, 3), np.bool_)
    assert np.array_equal(spread_blocks(blocks, 2, shape), np.indices(shape).max(axis=0) < 6)
    assert np.array_equal(spread_blocks(blocks, 4, shape), np.ones(shape))


def test_points_of_the_gel_are_measured_from_the_image_centre_and_deep_ones_nearer_to_it_than_seen() -> None:
    points = gel_points_mm((3, 4), (0.5, 2.0))
    assert points[0, :, 0].tolist() == [-0.75, -0.25, 0.25, 0.75]
    assert points[:, 3, 1].tolist() == [-2.0, 0.0, 2.0]
    depth = np.array([[0.0, 2.0], [1.0, 0.5]], np.float32)
    flat, seen = points_of(depth, (0.2, 0.4)), points_of(depth, (0.2, 0.4), 50.0)
    np.testing.assert_allclose(seen[0], [[-0.1, 0.2, 0], [0.1 * 0.96, 0.2 * 0.96, 2]], atol=1e-7)
    np.testing.assert_allclose(seen[..., :2], flat[..., :2] * (1 - depth[..., None] / 50), atol=1e-7)


def waves() -> np.ndarray:
    """A picture in which every place looks different."""
    rows, columns = np.indices(SHAPE)
    waves = [np.sin(columns / 9), np.cos(rows / 7), np.sin((rows + columns) / 11)]
    return np.asarray(np.rint(128 + 90 * np.stack(waves, axis=2)), np.uint8)


def test_what_was_seen_from_the_side_is_seen_straight_again() -> None:
    back = VIEW.of(from_the_side(waves()), "it")
    assert back.shape == (*SHAPE, 3)
    inner = (slice(4, -4), slice(4, -4))
    assert np.abs(back.astype(float) - waves())[inner].mean() < 2
    assert np.abs(back.astype(float) - np.roll(waves(), 2, axis=1))[inner].mean() > 6  # two pixels off would show


def test_a_crop_is_these_pixels_and_no_others() -> None:
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    view = View.of_box((7, 4, 20, 10), (30, 40))
    np.testing.assert_array_equal(view.of(image, "it"), image[4:14, 7:27])
    with pytest.raises(InputError, match="leaves the picture of 40 x 30 px"):
        View.of_box((25, 4, 20, 10), (30, 40))


@pytest.mark.parametrize(
    "corners",
    [
        ((0, 0), (0, 10), (10, 10), (10, 0)),  # anticlockwise
        ((0, 0), (10, 10), (10, 0), (0, 10)),  # crossed
        ((0, 0), (5, 0), (10, 0), (0, 10)),  # three on a line
        ((0, 0), (10, 0), (10, float("nan")), (0, 10)),
    ],
)
def test_corners_that_make_no_view_are_refused(corners: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(InputError, match="give"):
        View.of_corners(corners, (20, 20), (10, 10))


def test_a_grid_of_dots_gives_the_view_and_its_scale() -> None:
    """Dots 16 px apart are 2 mm apart: at 0.1 mm a pixel they are to lie 20 px apart, in straight rows."""
    taken = from_the_side(with_dots(np.full((*SHAPE, 3), 150, np.uint8)))
    view = view_of_grid(taken, 15, pitch_mm=2.0, pixel_size_mm=0.1)
    straight = view.of(taken, "the grid")
    dots = find_dots(straight)
    spots = cv2.connectedComponentsWithStats(dots.mask(straight).astype(np.uint8))[3][1:]
    assert len(spots) >= 40
    off = (spots - 9.5 + 10) % 20 - 10
    assert np.abs(off).max() < 1.5
    with pytest.raises(InputError, match="no grid of at least 3 x 3"):
        view_of_grid(np.full((*TAKEN, 3), 150, np.uint8), 15, 2.0, 0.1)


def test_a_camera_opened_with_a_bundle_shows_the_view_and_no_dots(tmp_path: Path) -> None:
    shape = BUNDLE_SHAPE
    view = View.of_corners(CORNERS, TAKEN, shape)
    steps = PictureSteps.with_view(view)
    linear_bundle(tmp_path / "plain", shape)
    bundle = extend_bundle(load_bundle(tmp_path / "plain"), tmp_path / "bundle", steps.files())
    assert PictureSteps.in_bundle(bundle) == steps
    assert PictureSteps.in_bundle(load_bundle(tmp_path / "plain")) is None
    taken = from_the_side(waves())
    cv2.imwrite(str(tmp_path / "taken.png"), taken[..., ::-1])
    with open_camera(tmp_path / "taken.png", bundle=bundle) as camera:
        assert camera.image_shape == shape
        assert camera.bundle_files[FILE_NAME] == bundle.files[FILE_NAME]
        np.testing.assert_array_equal(camera.read().image, view.of(taken, "it"))
    cv2.imwrite(str(tmp_path / "small.png"), taken[:50])
    with pytest.raises(BundleError, match=r"delivers 220x50 pixels, the calibration takes its view from 220x180"):
        open_camera(tmp_path / "small.png", bundle=bundle)


def test_a_view_file_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "view.json").write_text(VIEW.model_dump_json())
    assert read_view(tmp_path / "view.json") == VIEW
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InputError, match=r"other\.json is no view"):
        read_view(tmp_path / "other.json")
    with pytest.raises(InputError, match="cannot be opened"):
        read_view(tmp_path / "none.json")


def test_a_view_that_is_coarser_shows_no_pattern_however_its_homography_is_scaled() -> None:
    """Slanted, so that the lower part alone is coarse; and H and H / 4 are one view."""
    noise = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    ends = ((100, 0), (219, 0), (319, 239), (0, 239))
    slanted = View.of_corners(ends, (240, 320), (60, 80))
    quarter = tuple(tuple(value / 4 for value in row) for row in slanted.homography)
    same = slanted.model_copy(update={"homography": quarter})
    np.testing.assert_array_equal(slanted.of(noise, "it"), same.of(noise, "it"))
    assert slanted.of(noise, "it")[-10:].std() < 0.4 * noise.std()
    stripes = np.broadcast_to(255 * (np.arange(320) // 2 % 2)[:, None], (240, 320, 3)).astype(np.uint8)
    assert slanted.of(stripes, "it")[-10:, 5:-5].std() < 25


def test_a_large_picture_is_made_smaller_by_a_whole_factor_also_after_another_view() -> None:
    image = np.random.default_rng(0).integers(0, 256, (1850, 2600, 3), np.uint8)
    smaller = View.bounded((1850, 2600))
    assert smaller.image_shape == (616, 866)
    blocks = image[:1848, :2598].reshape(616, 3, 866, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(smaller.of(image, "image"), blocks, atol=0.51)
    assert View.bounded((960, 1280)) is None
    assert View.bounded((960, 1281)) is not None
    cut = View.of_box((100, 40, 2600, 1800), (1850, 2750))
    smaller = View.bounded(cut.image_shape)
    both, points = smaller.after(cut), np.array([[120.0, 60.0], [2000.0, 1500.0]])
    assert (both.taken_shape, both.image_shape) == ((1850, 2750), smaller.image_shape)
    np.testing.assert_allclose(both.places(points), smaller.places(cut.places(points)))
    with pytest.raises(InputError, match="makes pictures of 100 x 90 px, these are of 2600 x 1800 px"):
        smaller.after(View.of_box((0, 0, 100, 90), (1850, 2600)))


def test_the_surface_is_triangles_that_face_the_camera(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(40.0) - 19.5, np.arange(30.0) - 14.5)
    depth = np.exp(-((x - 5) ** 2 + (y + 4) ** 2) / 50).astype(np.float32)
    depth[20:24, 3:9] = np.nan
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    (tmp_path / "gel.ply").write_bytes(ply(depth, (0.5, 0.25), image))
    vertices, triangles, _ = read_ply(tmp_path / "gel.ply")
    assert len(vertices["z"]) == 40 * 30 - 4 * 6
    assert len(triangles) == 2 * (39 * 29 - 5 * 7)
    assert np.array_equal(np.stack([vertices[name] for name in ("red", "green", "blue")], 1), image[~np.isnan(depth)])
    at = np.stack([vertices[name] for name in "xyz"], 1)
    exact = np.exp(-((at[:, 0] / 0.5 - 5) ** 2 + (at[:, 1] / 0.25 - 4) ** 2) / 50)
    assert np.abs(at[:, 2] - exact).max() < 1e-6, "y points up"
    corners = at[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert np.allclose(normals[:, 2], 0.125), "each is half a pixel"


# ---- maps over the gel at rest, against planes, whose pictures follow by hand ----


HEIGHT_MM = 53.1
PIXEL_MM = 0.2
INSIDE = (slice(12, -12), slice(12, -12))
"""beyond, the picture may not show the gel"""
OPENCV_PX = 1 / 32
"""as finely OpenCV tells where between pixels it looks"""


def plane(lean: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth of a leaning plane over the gel, d = 1 + lean x, and in the picture: d (1 + lean p / H) = 1 + lean p."""
    x = np.broadcast_to((np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * PIXEL_MM, SHAPE)
    return (1 + lean * x).astype(np.float32), ((1 + lean * x) / (1 + lean * x / HEIGHT_MM)).astype(np.float32)


@pytest.mark.parametrize("lean", [0.0, 0.05, -0.4])
def test_a_plane_lies_over_the_gel_as_it_is(lean: float) -> None:
    over, seen = plane(lean)
    off_mm = OPENCV_PX * abs(lean) * PIXEL_MM + 1e-6
    np.testing.assert_allclose(over_gel(seen, HEIGHT_MM)[INSIDE], over[INSIDE], atol=off_mm)


def test_other_maps_go_where_the_depth_goes() -> None:
    over, seen = plane(0.2)
    both = over_gel(np.dstack([seen, 3 * seen]), HEIGHT_MM)
    np.testing.assert_allclose(both[..., 1], 3 * both[..., 0], rtol=1e-6)
    np.testing.assert_allclose(both[..., 0][INSIDE], over[INSIDE], atol=OPENCV_PX * 0.2 * PIXEL_MM)


def test_a_camera_far_away_moves_nothing() -> None:
    _, seen = plane(0.2)
    assert over_gel(seen, 0.0) is seen


@pytest.mark.parametrize("middle", [(130, 30), (30, 95)])
def test_a_touch_alone_is_moved_and_lies_where_it_touches(middle: tuple[int, int]) -> None:
    """A bump seen where it belongs, p = x / (1 - d / H); beside it the map stays as it is, to the last bit."""
    y, x = np.indices(SHAPE, dtype=np.float64)
    ways = np.stack([x - (SHAPE[1] - 1) / 2, y - (SHAPE[0] - 1) / 2])
    at = np.array(middle, float)[:, None, None] - np.array([(SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2])[:, None, None]

    def bump(ways: np.ndarray) -> np.ndarray:
        return np.asarray(1.5 * np.exp(-((ways - at) ** 2).sum(axis=0) / 50))

    seen = np.zeros(SHAPE)
    for _ in range(50):  # the depth d in the pixel p is that of the gel at p (1 - d / H)
        seen = bump(ways * (1 - seen / HEIGHT_MM))
    over = over_gel(seen.astype(np.float32), HEIGHT_MM)
    np.testing.assert_allclose(over, bump(ways), atol=0.015)  # between pixels a bump of 5 is linear here
    flat = seen < 1e-4
    assert (over[flat] == seen[flat].astype(np.float32)).mean() > 0.9
    assert np.abs(seen - bump(ways)).max() > 0.03
