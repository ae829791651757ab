"""The model of the untouched sensor on pictures that carry little."""

from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import write_bundle
from gellight.watch.untouched_model import UntouchedModel
from tests.helpers.linear_sensor import linear_network


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("dark", [(), (2,)], ids=["even", "blue is dark"])
def test_an_even_or_dark_channel_gives_numbers(tmp_path: Path, dark: tuple[int, ...]) -> None:
    """Neither the move of an even picture nor the gain of a black channel can be fitted; the rest can."""
    reference = np.full((96, 128, 3), 100.0)
    reference[..., dark] = 0
    bundle = write_bundle(
        tmp_path / "bundle",
        sensor="even",
        reference=reference,
        reference_frames=8,
        noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1),
        network=linear_network(),
        metrics={},
    )
    model = UntouchedModel(bundle)
    brighter = 0.1 * model.reference
    rest = model.judge(brighter)
    assert not rest.outliers.any()
    np.testing.assert_allclose(rest.fitted, brighter, atol=0.01)
