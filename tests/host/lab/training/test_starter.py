"""A bundle learnt on other units: it feels a touch, and says that it is not of this unit."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, load_bundle, write_bundle
from gellight.lab.report.pictures import write_png
from gellight.lab.training.starter import pooled
from gellight.lab.training.table import PressTable
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.watch.monitor import SensorWatch
from gellight.watch.possible import learnt_elsewhere
from tests.helpers import small_bundles
from tests.helpers.command_line import invoke


def unit(path: Path, name: str, channels: int = 3) -> Bundle:
    """Write a bundle that learnt that slopes are the differences of two colours."""
    rng, whole = np.random.default_rng(len(name)), small_bundles.ordinary()
    changes = rng.uniform(-60, 60, (4000, channels)).astype(np.float32)
    places = (rng.random((4000, 2)) * np.subtract(whole.image_shape[::-1], 1)).astype(np.float32)
    slopes = (changes[:, :2] - changes[:, 2:3]) / 100
    table = PressTable(rows=np.hstack([changes, places, slopes]), image=np.arange(4000, dtype=np.int32) % 8,
                       image_size=whole.image_shape[::-1])  # fmt: skip
    return write_bundle(
        path / name, sensor=name, reference=whole.reference, reference_frames=1, noise_grey=1.0, network=whole.network,
        pixel_size_mm=whole.pixel_size_mm, metrics={}, presses=table.arrays(),
    )  # fmt: skip


@pytest.fixture
def units(tmp_path: Path) -> list[Bundle]:
    return [unit(tmp_path, name) for name in ("left", "other one")]


def test_places_are_scaled_and_no_image_is_mixed_with_another(units: list[Bundle]) -> None:
    table, first = pooled(units, (240, 320)), PressTable.of(units[0])
    assert table.image_size == (320, 240)
    assert table.rows[:4000, 3:5] == pytest.approx(first.rows[:, 3:5] * [319 / 159, 239 / 119])
    assert (table.rows[:4000, [0, 1, 2, 5, 6]] == first.rows[:, [0, 1, 2, 5, 6]]).all()
    assert set(table.image[:4000]).isdisjoint(table.image[4000:])


def test_a_bundle_without_presses_or_of_single_lights_is_refused(units: list[Bundle], tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"has no presses\.npz"):
        pooled([small_bundles.ordinary()], (120, 160))
    with pytest.raises(InputError, match="a channel for each of 6 lights"):
        pooled([*units, unit(tmp_path, "single lights", 6)], (120, 160))


def test_it_learns_from_all_and_says_that_it_is_not_of_this_unit(units: list[Bundle], tmp_path: Path) -> None:
    names = [one.source for one in units]
    write_png(tmp_path / "untouched.png", np.full((120, 160, 3), 120, np.uint8))
    told = ["--reference", tmp_path / "untouched.png", "--pixel-size-mm", "0.2", "--out", tmp_path / "rough"]
    said = invoke("calibrate", "starter", *names, *told, "--recipe", "fast")
    assert said.exit_code == 0, said.output
    assert "not your unit: this bundle was learnt on others (left, other one)" in said.output
    starter = load_bundle(tmp_path / "rough")
    assert [finding.kind for finding in SensorWatch(starter).findings()] == ["starter"]
    assert learnt_elsewhere(units[0]) == []
    asked = np.array([[30, 0, 10], [0, -20, 10]], np.float32)
    felt = GradientNetwork(starter.network, starter.image_shape, noise_grey=1.0).infer(
        asked, np.full((2, 2), 80, np.float32)
    )
    assert felt == pytest.approx((asked[:, :2] - asked[:, 2:]) / 100, abs=0.07)  # of slopes up to 1.2
