"""From light to grey levels."""

import numpy as np
import pytest

from sim_reference.camera import CameraResponse, digitise, expose, exposure_for, linear_grey

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_an_ideal_camera_is_proportional_to_light() -> None:
    light = np.random.default_rng(0).random((4, 5, 3))
    response = CameraResponse(exposure=0.5, crosstalk=IDENTITY)
    assert linear_grey(light, response) == pytest.approx(127.5 * light)


def test_crosstalk_has_a_row_for_each_channel() -> None:
    red = np.array([[[1.0, 0.0, 0.0]]])
    response = CameraResponse()
    assert linear_grey(red, response)[0, 0] / 255 == pytest.approx([row[0] for row in response.crosstalk])
    assert np.sum(response.crosstalk, axis=1) == pytest.approx(1), "grey light stays grey"


def test_gamma_leaves_black_and_white_where_they_are() -> None:
    light = np.repeat(np.array([0.0, 0.25, 1.0])[:, None, None], 3, axis=2)
    assert linear_grey(light, CameraResponse(gamma=2.0))[:, 0, 0] == pytest.approx([0, 127.5, 255])


def test_the_noise_has_the_stated_deviation_and_quantisation_adds_a_twelfth() -> None:
    picture = digitise(np.full((400, 500, 3), 100.3, np.float32), 2.0, np.random.default_rng(1))
    assert picture.dtype == np.uint8
    assert picture.mean() == pytest.approx(100.3, abs=0.02)
    assert picture.std() == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.01)


def test_too_much_light_clips_and_does_not_wrap() -> None:
    picture = expose(np.full((2, 2, 3), 5.0), CameraResponse(noise_grey=0.0), np.random.default_rng(0))
    assert (picture == 255).all()


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_the_exposure_puts_the_brightest_pixel_where_it_is_wanted(gamma: float) -> None:
    light = np.random.default_rng(2).random((6, 6, 3))
    exposure = exposure_for(light, CameraResponse(gamma=gamma), 200.0)
    assert linear_grey(light, CameraResponse(gamma=gamma, exposure=exposure)).max() == pytest.approx(200.0)


@pytest.mark.parametrize("wrong", [{"exposure": 0.0}, {"gamma": -1.0}, {"noise_grey": -0.1}])
def test_impossible_cameras_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        CameraResponse(**wrong)
