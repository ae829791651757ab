"""Cosine transforms in C against SciPy's, and results whose memory is used again."""

import numpy as np
import pytest
from scipy import fft

from gellight.reconstruction.native import build, library
from gellight.reconstruction.native.cosine import CosineRows, radices_of
from gellight.reconstruction.native.lent_arrays import ArrayPool

RUNNABLE = [pytest.param(name, id=name) for name in library.fitting()]
LENGTHS = (32, 36, 60, 64, 80, 90, 160, 306, 320, 33, 46)
"""with radices 2 to 5 in many orders; the last three are left to SciPy"""


@pytest.mark.skipif(not RUNNABLE, reason="no library is built for this machine")
@pytest.mark.parametrize("name", RUNNABLE)
@pytest.mark.parametrize("length", LENGTHS)
def test_cosine_transforms_are_right_and_come_back(name: str, length: int) -> None:
    loaded = library.Library(build.library_file(name))
    for rows in (1, 7, 16, 33):
        maps = np.random.default_rng(rows).normal(size=(rows, length)).astype(np.float32)
        transforms = CosineRows(loaded, maps.shape)
        waves = transforms.forwards(maps.copy())
        right = fft.dct(maps.astype(np.float64), type=2, norm="ortho", axis=1)
        np.testing.assert_allclose(waves, right, atol=2e-6)
        np.testing.assert_allclose(transforms.backwards(waves.copy()), maps, atol=2e-6)


def test_lengths_without_small_factors_are_left_to_scipy() -> None:
    assert radices_of(320) == [4, 4, 4, 5]
    assert radices_of(153) is None


def test_memory_is_used_again_only_when_nobody_has_it() -> None:
    arrays = ArrayPool((5, 7))
    first = arrays.take()
    first[:] = 1
    part = first[2:, ::2].T
    del first
    second = arrays.take()
    second[:] = 2
    assert (part == 1).all()
    address = second.ctypes.data
    del second
    assert arrays.take().ctypes.data == address


def test_few_are_kept() -> None:
    arrays = ArrayPool((3,), np.bool_)
    held = [arrays.take() for _ in range(10)]
    assert len({array.ctypes.data for array in held}) == 10
    del held
    assert len(arrays._free) == 3
