"""Means over blocks are what the plain formula says; points of the gel are measured from the image centre."""

import numpy as np
import pytest

from gellight.frames.pixel_grid import block_means, gel_points_mm, plane_means, spread_blocks


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


@pytest.mark.parametrize("side", [4, 16, 17])
def test_sums_of_the_brightest_bytes_do_not_overflow(side: int) -> None:
    white = np.full((2 * side, 3 * side, 3), 255, np.uint8)
    assert block_means(white, side).dtype == np.float32
    assert (block_means(white, side) == 255).all()


def test_means_of_bytes_are_exact_to_the_last_bit() -> None:
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    assert np.array_equal(block_means(image, 8), plainly(image, 8).astype(np.float32))


def test_planes_are_averaged_one_by_one() -> None:
    planes = np.random.default_rng(1).normal(size=(5, 17, 24))
    assert np.array_equal(plane_means(planes, 8), np.stack([block_means(plane, 8) for plane in planes]))


@pytest.mark.parametrize("shape", [(6, 8), (7, 8), (5, 7)])
def test_pixels_beyond_the_last_block_are_false_and_blocks_beyond_the_image_are_cut(shape: tuple[int, int]) -> None:
    blocks = np.ones((3, 3), np.bool_)
    assert np.array_equal(spread_blocks(blocks, 2, shape), np.indices(shape).max(axis=0) < 6)
    assert np.array_equal(spread_blocks(blocks, 4, shape), np.ones(shape))


def test_points_of_the_gel_are_measured_from_the_image_centre() -> None:
    points = gel_points_mm((3, 4), (0.5, 2.0))
    assert points[0, :, 0].tolist() == [-0.75, -0.25, 0.25, 0.75]
    assert points[:, 3, 1].tolist() == [-2.0, 0.0, 2.0]
