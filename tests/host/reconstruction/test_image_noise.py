"""The noise that limits on means need: of a plain camera its pixels', of one that compresses what neighbours share."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.bundle.bundle import load_bundle
from gellight.frames.frames import CameraFrame
from gellight.lab.calibration.sensing import TouchDetector
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.image_noise import measure_noise

COUNT, FRESH = 20, 4
SIGMA = 1.5


@pytest.fixture(scope="module")
def plain() -> list[NDArray[np.uint8]]:
    """Frames of the untouched gel with white noise."""
    random = np.random.default_rng(5)
    reference = load_bundle("synthetic").reference
    return [
        np.rint(reference + random.normal(0, SIGMA, reference.shape)).clip(0, 255).astype(np.uint8)
        for _ in range(COUNT)
    ]


def compressed(images: list[NDArray[np.uint8]], quality: int) -> list[NDArray[np.uint8]]:
    """As a camera sends them by MJPG, colours halved across."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
               cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422]  # fmt: skip
    codes = [cv2.imencode(".jpg", image[..., ::-1], options)[1] for image in images]
    return [np.ascontiguousarray(cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1]) for code in codes]


def mean_of(images: list[NDArray[np.uint8]]) -> NDArray[np.float32]:
    return np.mean(images, axis=0, dtype=np.float32)


def test_white_noise_is_its_own_standard_deviation_on_every_scale(plain: list[NDArray[np.uint8]]) -> None:
    found = measure_noise(plain, mean_of(plain))
    rounded = np.sqrt(SIGMA**2 + 1 / 12)
    assert found.pixel_grey == pytest.approx(rounded, rel=0.01)
    assert found.white_grey == pytest.approx(rounded, rel=0.03)


def test_a_change_of_all_the_light_is_not_noise(plain: list[NDArray[np.uint8]]) -> None:
    drifting = [np.clip(image.astype(int) + number % 3, 0, 255).astype(np.uint8) for number, image in enumerate(plain)]
    found = measure_noise(drifting, mean_of(drifting))
    assert found.white_grey == pytest.approx(measure_noise(plain, mean_of(plain)).white_grey, rel=0.05)


def test_means_that_seldom_jump_far_count_beyond_their_spread(plain: list[NDArray[np.uint8]]) -> None:
    """Blocks at the edge between two steps of a compression: one in a thousand is brighter by 5 times its noise."""
    random = np.random.default_rng(6)
    blocks = np.array(plain[0].shape[:2]) // 8
    jumping = [image + (random.random((*blocks, 1)) < 1e-3).repeat(8, 0).repeat(8, 1) for image in plain]
    rare, usual = (measure_noise(images, mean_of(images)).white_grey for images in (jumping, plain))
    assert 1.7 < rare / usual < 2.3


def test_one_picture_tells_no_noise(plain: list[NDArray[np.uint8]]) -> None:
    with pytest.raises(ValueError, match="at least 2"):
        measure_noise(plain[:1], mean_of(plain[:1]))


@pytest.mark.parametrize("quality", [95, 80])
def test_gel_at_rest_stays_untouched_behind_a_camera_that_compresses(
    plain: list[NDArray[np.uint8]], quality: int
) -> None:
    frames = compressed(plain, quality)
    recorded, fresh = frames[:-FRESH], frames[-FRESH:]
    reference = mean_of(recorded)
    noise = measure_noise(recorded, reference)
    assert noise.white_grey > 1.5 * noise.pixel_grey
    bundle = load_bundle("synthetic")
    shares = {
        limit: [
            GradientNetwork(bundle.network, bundle.image_shape, noise_grey=limit).touched(image - reference).mean()
            for image in fresh
        ]
        for limit in (noise.white_grey, noise.pixel_grey)
    }
    assert np.count_nonzero(shares[noise.white_grey]) <= 1, "else every frame costs what a touch does"
    assert min(shares[noise.pixel_grey]) > 0.2, "the noise of single pixels would let most of the gel look touched"
    watcher = TouchDetector(reference, noise.white_grey)
    assert watcher.look(CameraFrame(image=fresh[0], time_s=0.0, sequence=0)).free
