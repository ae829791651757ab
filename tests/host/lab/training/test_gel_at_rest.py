"""What the gel at rest really does, on pictures of two real sensors: masks, the watch and the zero go by it."""

from pathlib import Path

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.circle import find_circle
from gellight.lab.training.presses import Ball, Press, distance_px
from gellight.lab.training.table import rest_of_presses
from gellight.reconstruction.gelnet import GradientNetwork
from gellight.reconstruction.image_noise import noise_of_one
from gellight.reconstruction.light_drift import difference_of
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.helpers.linear_sensor import linear_network
from tests.helpers.places import real

DIGIT, MINI = real("digit_ball"), real("gelsight_mini_ball")
MINI_BALL = Ball(radius_mm=2.35, pixel_size_mm=0.05107)
DIGIT_BALL = Ball(radius_mm=3.0, pixel_size_mm=0.06)
MINUTES = 3


def digit_presses(numbers: range) -> list[Press]:
    reference, presses = read_image(DIGIT / "background_scripts_0000.png").astype(np.float32), []
    for number in numbers:
        path = DIGIT / f"{number:04d}.png"
        circle = find_circle(read_image(path), reference, ball=DIGIT_BALL)
        presses.append(
            Press(
                image=path,
                center_x_px=circle.center_x_px,
                center_y_px=circle.center_y_px,
                contact_radius_px=circle.contact_radius_px,
            )
        )
    return presses


def digit_bundle(folder: Path, rest_grey: float) -> Bundle:
    reference = read_image(DIGIT / "background_scripts_0000.png").astype(np.float32)
    return write_bundle(
        folder, sensor="digit", reference=reference, reference_frames=1, noise_grey=noise_of_one(reference),
        rest_grey=rest_grey, follow_light=True, pixel_size_mm=(0.06, 0.06), network=linear_network(), metrics={},
    )  # fmt: skip


def shares(presses: list[Press], reference: np.ndarray, rest_grey: float) -> tuple[float, float, float]:
    """Mean share called touched: of the view, of the contact circles, and beyond 3 contact radii."""
    shape = (reference.shape[0], reference.shape[1])
    network = GradientNetwork(linear_network(), shape, noise_grey=noise_of_one(reference), rest_grey=rest_grey)
    found = []
    for press in presses:
        touched = network.touched(difference_of(read_image(press.image), reference, follow_light=True))
        radii = distance_px(press, shape) / press.contact_radius_px
        found.append((touched.mean(), touched[radii < 1].mean(), touched[radii > 3].mean()))
    view, contact, far = np.mean(found, axis=0).tolist()
    return view, contact, far


@pytest.mark.nightly
@pytest.mark.real_images("digit_ball")
def test_on_a_digit_the_contact_and_its_skirt_are_touched_and_not_the_whole_view() -> None:
    reference = read_image(DIGIT / "background_scripts_0000.png").astype(np.float32)
    presses = digit_presses(range(1, 41, 3))
    noise = noise_of_one(reference)
    rest = rest_of_presses(presses[::2], reference, noise_grey=noise, follow_light=True)
    assert 3 < rest < 5
    others = presses[1::2]
    view, contact, far = shares(others, reference, rest)
    assert contact > 0.99
    assert far < 0.05
    assert view < 0.35
    assert shares(others, reference, 0.0)[0] > 0.97, "the noise of a pixel says nothing of the gel at rest"


@pytest.mark.real_images("gelsight_mini_ball")
def test_on_a_mini_the_corners_are_at_rest() -> None:
    """Its gel is soft: at 2.5 contact radii the colours still change by a fifth of what they do in contact."""
    reference = read_image(MINI / "background.png").astype(np.float32)
    presses = read_presses(MINI / "presses.csv", ball=MINI_BALL, image_shape=(320, 240))
    rest = rest_of_presses(presses[::2], reference, noise_grey=noise_of_one(reference), follow_light=True)
    view, contact, far = shares(presses[1::2], reference, rest)
    assert contact > 0.99
    assert far < 0.2
    assert view < 0.65
    assert shares(presses[1::2], reference, 0.0)[0] > 0.99


@pytest.mark.real_images("digit_ball")
@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.nightly
def test_minutes_of_real_drift_are_no_touch_and_the_zero_follows(tmp_path: Path, measured: bool) -> None:
    """From one picture of the untouched gel to another of the same sensor on another day, by two fifths of the way."""
    reference = read_image(DIGIT / "background_scripts_0000.png").astype(np.float32)
    presses = digit_presses(range(1, 41, 5))
    rest = rest_of_presses(presses, reference, noise_grey=noise_of_one(reference), follow_light=True)
    bundle = digit_bundle(tmp_path / "b", rest if measured else 0.0)
    later = read_image(DIGIT / "background.png").astype(np.float32)
    watch, path, random = SensorWatch(bundle), Reconstructor(bundle), np.random.default_rng(4000)
    felt, zeros, told, looks = 0, 0, set(), round(60 * MINUTES / PERIOD_S)
    for number in range(looks):
        grey = reference + 0.4 * number / looks * (later - reference) + random.normal(0, 1.2, reference.shape)
        image = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
        frame = path.reconstruct(CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number))
        felt += frame.contact.area_mm2 > 0.05  # some pixels
        watch.note(frame)
        told |= {finding.kind for finding in watch.findings()}
        if watch.refusal(asked=False) == "":
            zero = watch.propose_zero(asked=False)
            watch.accept_zero(zero)
            zeros += 1
            path = Reconstructor(bundle.with_reference(zero.reference, frames=10))
    if measured:
        assert (felt, told) == (0, set())
        assert zeros >= 10
        watch.note(path.reconstruct(CameraFrame(image=read_image(presses[0].image), time_s=1e3, sequence=looks)))
        assert watch.status()["state"] == "touched"
    else:
        assert felt > 100
        assert zeros < 5


def test_the_noise_of_one_picture_is_never_0_and_never_quantised() -> None:
    random = np.random.default_rng(0)
    smooth = np.full((120, 160, 3), 100.0) + np.linspace(0, 20, 160)[None, :, None]
    assert noise_of_one(np.rint(smooth)) == pytest.approx(np.sqrt(1 / 12), abs=0.1)
    sigmas = np.array([0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.5, 2.5])
    found = [noise_of_one(np.rint(smooth + random.normal(0, sigma, smooth.shape))) for sigma in sigmas]
    np.testing.assert_allclose(found, np.hypot(sigmas, np.sqrt(1 / 12)), rtol=0.06)
