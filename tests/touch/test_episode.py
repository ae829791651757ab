"""An episode of simulated touches, written by the writer of recordings and read by another library."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.recording.array_files import write_arrays
from gellight_touch import Felt, TouchSensor
from gellight_touch.environments import SlideToEdge
from gellight_touch.episode import tactile_frames
from sim_reference.geometry import SensorGeometry

ACTIONS = [[1.0, 0.25 * number, 0.0] for number in range(5)]
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
    return TouchSensor(SMALL, size=72, extent_mm=72.0, seed=3)


def test_an_episode_is_read_from_hdf5(touches: list[Felt], tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    assert (
        write_arrays(tactile_frames(sensor(), touches, fps=10), tmp_path / "a.h5", actions=ACTIONS, task="slide") == 5
    )
    file, same = h5py.File(tmp_path / "a.h5"), sensor()
    assert file.attrs["task"] == "slide"
    assert file["figures/action"][:].tolist() == ACTIONS
    assert file["figures/force_n"][:] == pytest.approx([felt.force_n for felt in touches])
    for number, felt in enumerate(touches):
        assert np.array_equal(file["image"][number], same.picture(felt))
        np.testing.assert_allclose(file["depth_mm"][number], same.depth_map_mm(felt), rtol=0, atol=5e-5)
        across = np.gradient(same.depth_map_mm(felt), 0.588, axis=1)
        np.testing.assert_allclose(file["gradient_map"][number][..., 0], across, rtol=0, atol=0.15)


@pytest.mark.parametrize(
    ("actions", "says"),
    [(ACTIONS[:4], "4 actions, and more frames"), ([*ACTIONS, ACTIONS[0]], "6 actions for 5 frames"),
     ([[np.nan]] * 5, "a row of finite numbers for each frame"), ([1.0] * 5, "of shape")],
)  # fmt: skip
def test_actions_that_do_not_fit_leave_nothing(
    touches: list[Felt], tmp_path: Path, actions: list[list[float]], says: str
) -> None:
    frames = tactile_frames(sensor(), touches, fps=10)
    with pytest.raises(InputError, match=says):
        write_arrays(frames, tmp_path / "a.h5", actions=actions)
    assert not list(tmp_path.iterdir())


def test_the_pressure_on_the_pixels_carries_the_force(touches: list[Felt]) -> None:
    whole = SensorGeometry(image_width_px=160, image_height_px=160, pixel_size_mm=0.4)
    frame = next(tactile_frames(TouchSensor(whole, size=72, extent_mm=72.0), touches, fps=10))
    assert frame.force.pressure_mpa.sum() * 0.4**2 == pytest.approx(touches[0].force_n, rel=0.02)


@pytest.mark.parametrize("fps", [0, -1, np.nan, np.inf])
def test_a_rate_that_is_none_is_said(touches: list[Felt], fps: float) -> None:
    with pytest.raises(InputError, match="frames a second: give a number above 0"):
        next(tactile_frames(sensor(), touches, fps=fps))
