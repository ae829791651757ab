"""An episode of simulated touches, written by the writers of recordings and read by other people's libraries."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.report.pictures import encode_png
from gellight.lab.touch import Felt, TouchSensor
from gellight.lab.touch.environments import SlideToEdge
from gellight.lab.touch.episode import tactile_frames
from gellight.recording.array_files import write_arrays
from gellight.recording.lerobot_files import write_lerobot
from sim_reference.geometry import SensorGeometry

SMALL = SensorGeometry(image_width_px=64, image_height_px=48, pixel_size_mm=0.588)


@pytest.fixture(scope="module")
def touches() -> list[Felt]:
    env = SlideToEdge(sensor=sensor)
    env.reset(seed=2)
    felt = []
    for _ in range(5):
        assert env.observing.felt is not None
        felt.append(env.observing.felt)
        env.step(np.array([1.0, 0.0, 0.0]))
    return felt


def sensor() -> TouchSensor:
    return TouchSensor(SMALL, size=64, seed=3)


def test_an_episode_is_read_from_zarr(touches: list[Felt], tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr")
    assert write_arrays(tactile_frames(sensor(), touches, fps=10), tmp_path / "a.zarr", task="slide") == 5
    file, same = zarr.open_group(tmp_path / "a.zarr", mode="r"), sensor()
    assert file.attrs["task"] == "slide"
    assert file["figures/force_n"][:] == pytest.approx([felt.force_n for felt in touches])
    for number, felt in enumerate(touches):
        assert np.array_equal(file["image"][number], same.picture(felt))
        assert file["depth_mm"][number] == pytest.approx(same.depth_map_mm(felt), abs=5e-5)
        assert file["gradient_map"][number][..., 0] == pytest.approx(
            np.gradient(same.depth_map_mm(felt), 0.588, axis=1), abs=0.15
        )


def test_an_episode_is_read_from_lerobot(touches: list[Felt], tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    frames = tactile_frames(sensor(), touches, fps=10)
    assert write_lerobot(frames, tmp_path / "a", fps=10, task="slide to an edge", png=encode_png) == 5
    rows = parquet.read_table(tmp_path / "a/data/chunk-000/file-000.parquet").to_pylist()
    same = sensor()
    for number, (row, felt) in enumerate(zip(rows, touches, strict=True)):
        png = np.frombuffer(row["observation.images.gel"]["bytes"], np.uint8)
        assert np.array_equal(cv2.imdecode(png, cv2.IMREAD_COLOR_RGB), same.picture(felt))
        assert row["timestamp"] == pytest.approx(number / 10)
        assert row["observation.state"][2] == pytest.approx(felt.force_n, rel=1e-5)
        assert np.array(row["observation.gel_depth"])[..., 0] == pytest.approx(same.depth_map_mm(felt) / 1e3, abs=5e-8)


def test_the_pressure_on_the_pixels_carries_the_force(touches: list[Felt]) -> None:
    whole = SensorGeometry(image_width_px=160, image_height_px=160, pixel_size_mm=0.4)
    frame = next(tactile_frames(TouchSensor(whole, size=64), touches, fps=10))
    assert frame.force is not None
    assert frame.force.pressure_mpa.sum() * 0.4**2 == pytest.approx(touches[0].force_n, rel=0.02)


@pytest.mark.parametrize("fps", [0, -1, np.nan, np.inf])
def test_a_rate_that_is_none_is_said(touches: list[Felt], fps: float) -> None:
    with pytest.raises(InputError, match="frames a second: give a number above 0"):
        next(tactile_frames(sensor(), touches, fps=fps))
