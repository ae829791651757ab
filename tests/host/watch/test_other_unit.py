"""A bundle of another unit is found out by the picture; drift, touches, dark LEDs and pictures with little are not."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.lab.simulator.scene import Press, Scene
from gellight.reconstruction.fine_pattern import FinePattern, pattern_match
from gellight.watch.monitor import PERIOD_S, SensorWatch
from gellight.watch.other_unit import UnitCheck, UnitFigures
from gellight.watch.untouched_model import UntouchedModel
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import AS_BUILT, SensorGeometry
from tests.helpers.linear_sensor import bundle_of
from tests.helpers.places import REAL_CROPS, real

MINI, DIGIT = real("gelsight_mini_ball"), real("digit_ball")


def unit_of(folder: Path, untouched: np.ndarray, own: list[np.ndarray]) -> Bundle:
    """A bundle whose calibration has seen pictures of its `own` unit."""
    return bundle_of(folder, untouched.astype(float), metrics={"pattern_match": pattern_match(own, untouched)})


def presses(folder: Path) -> list[np.ndarray]:
    return [read_image(path) for path in sorted(folder.glob("[0-9]*.png"))]


@pytest.fixture(scope="module")
def mini(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return unit_of(tmp_path_factory.mktemp("mini") / "b", read_image(MINI / "background.png"), presses(MINI)[::4])


@pytest.mark.real_images("gelsight_mini_ball", "digit_ball")
def test_no_press_of_the_own_unit_is_another_unit(mini: Bundle, tmp_path: Path) -> None:
    check = UnitCheck(mini)
    assert [check.figures(image).reason for image in presses(MINI)] == [""] * 33
    others = [read_image(DIGIT / "background_scripts_0000.png"), *presses(DIGIT)]
    digit = UnitCheck(unit_of(tmp_path / "digit", read_image(DIGIT / "background.png"), presses(DIGIT)[::4]))
    assert {digit.figures(image).reason for image in others} == {""}


@pytest.mark.real_images("gelsight_mini_ball", "digit_ball", "dots")
def test_every_picture_of_another_make_is_another_unit(mini: Bundle, tmp_path: Path) -> None:
    others = [read_image(DIGIT / "background.png"), read_image(real("dots") / "bg-0.jpg"), *presses(DIGIT)[::4]]
    check = UnitCheck(mini)
    assert all("fine pattern" in check.figures(image).reason for image in others)
    digit = UnitCheck(unit_of(tmp_path / "digit", read_image(DIGIT / "background.png"), []))
    assert all("colours differ by" in digit.figures(image).reason for image in presses(MINI))


@pytest.mark.parametrize("unit", [1, 2])
def test_two_white_units_of_one_make_are_told_apart_by_their_pattern(unit: int, tmp_path: Path) -> None:
    def pictures(number: int) -> list[np.ndarray]:
        return [read_image(REAL_CROPS / f"ninedtact/{number}_{name}.png") for name in ("untouched", "press")]

    untouched = read_image(REAL_CROPS / f"ninedtact/{unit}_view.png")
    check = UnitCheck(unit_of(tmp_path / "b", untouched, pictures(unit)))
    assert [check.figures(image).reason for image in pictures(unit)] == ["", ""]
    assert all("fine pattern" in check.figures(image).reason for image in pictures(3 - unit))


@pytest.mark.real_images("digit_ball")
def test_three_minutes_between_two_real_pictures_of_a_unit_are_no_other_unit(tmp_path: Path) -> None:
    first, last = (read_image(DIGIT / name).astype(float) for name in ("background.png", "background_scripts_0000.png"))
    check, random = UnitCheck(unit_of(tmp_path / "b", first, presses(DIGIT)[::4])), np.random.default_rng(1)
    for share in np.linspace(0, 1, 19):
        image = first + share * (last - first) + random.normal(0, 2, first.shape)
        assert check.figures(np.clip(np.rint(image), 0, 255).astype(np.uint8)).reason == ""


# ---- simulated units, whose pictures are smooth ----

SMALL = {"image_width_px": 320, "image_height_px": 240, "pixel_size_mm": 0.1176}


RANDOM = np.random.default_rng(0)


def picture(geometry: SensorGeometry, press: Press | None = None, gain: np.ndarray | None = None) -> np.ndarray:
    """A picture with noise of its own: the same noise twice would be a fine pattern."""
    return digitise(Scene(geometry, CameraResponse(noise_grey=1.0), gain).show(press)[0], 1.0, RANDOM)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> UnitCheck:
    own = [picture(replace(AS_BUILT, **SMALL), Press("BALL", 0.5))]
    folder = tmp_path_factory.mktemp("simulated") / "b"
    return UnitCheck(unit_of(folder, picture(replace(AS_BUILT, **SMALL)), own))


def test_a_simulated_unit_with_drift_touches_and_dark_leds_is_the_same(simulated: UnitCheck) -> None:
    own = replace(AS_BUILT, **SMALL)
    gains = [np.full(12, 0.8), np.where(np.arange(12) == 5, 0.0, 1.0), np.where(np.arange(12) % 4 == 0, 0.0, 1.0)]
    gains.append(np.random.default_rng(2).normal(1, 0.1, 12))
    pictures = [picture(own, gain=gain) for gain in gains]
    pictures += [picture(own, Press(name, 0.8)) for name in ("BALL", "BALLVEX", "WAVE")]
    pictures.append(np.zeros_like(pictures[0]))  # the light is off: that is another finding
    assert [simulated.figures(image).reason for image in pictures] == [""] * len(pictures)


@pytest.mark.parametrize("other", [{"led_colours": "GGGGBBBBRRRR"}, {"led_colours": "RGBRGBRGBRGB"}])
def test_a_simulated_unit_of_another_ring_is_another(simulated: UnitCheck, other: dict[str, Any]) -> None:
    image = picture(replace(AS_BUILT, **SMALL, **other))
    assert "colours differ by" in simulated.figures(image).reason
    with pytest.raises(BundleError, match=r"made with another unit: colours differ .*calibrate this sensor"):
        simulated.refuse(image)


OTHER = {"colour_deg": 8.1, "light_share": 0.41, "gain": 1.0, "pattern": None, "own_pattern": None}


@pytest.mark.parametrize(
    ("figures", "other"),
    [
        ({}, True),
        ({"colour_deg": 7.9}, False),
        ({"light_share": 0.39}, False),
        ({"gain": 0.21}, True),
        ({"gain": 0.19}, False),
        ({"gain": 4.9}, True),
        ({"gain": 5.1}, False),
        ({"pattern": 13.9, "own_pattern": 30.0}, True),
        ({"pattern": 14.1, "own_pattern": 30.0}, False),
        ({"pattern": 9.9, "own_pattern": 30.0, "colour_deg": 0.0}, True),
        ({"pattern": 10.1, "own_pattern": 30.0, "colour_deg": 0.0}, False),
        ({"pattern": 7.9, "own_pattern": 16.0, "colour_deg": 0.0}, True),
        ({"pattern": 8.1, "own_pattern": 16.0, "colour_deg": 0.0}, False),
    ],
)
def test_a_unit_is_another_one_beyond_limits(figures: dict[str, Any], other: bool) -> None:
    assert (UnitFigures(**{**OTHER, **figures}).reason != "") == other


@pytest.mark.parametrize(("own", "judged"), [(13.9, False), (14.1, True)])
def test_only_a_unit_with_a_certain_pattern_is_judged_by_it(own: float, judged: bool) -> None:
    picture = np.random.default_rng(0).normal(100, 5, (160, 200, 3)).astype(np.float32)
    check = UnitCheck(SimpleNamespace(reference=picture, metrics={"pattern_match": own}, source="it"))  # type: ignore[arg-type]
    assert (check.figures(picture.astype(np.uint8)).pattern is not None) == judged
    dark = SimpleNamespace(reference=np.full((16, 24, 3), 1, np.float32), metrics={}, source="it")
    found = UnitCheck(dark).figures(np.full((16, 24, 3), 4, np.uint8))  # type: ignore[arg-type]
    assert found.gain == pytest.approx(2), "what is nearly black counts as two grey levels"


# ---- the watch ----


def test_the_watch_says_it_within_three_seconds_and_the_zero_does_not_follow(halved: Bundle) -> None:
    watch = SensorWatch(halved)
    images = [picture(replace(AS_BUILT, **SMALL, led_colours="GGGGBBBBRRRR")), halved.reference.astype(np.uint8)]
    for number in range(9):
        assert watch.findings() == []
        note(watch, images[0], number)
    (finding,) = watch.findings()
    assert finding.kind == "other_unit"
    assert finding.figures["felt_deg"] > 20
    assert 9 * PERIOD_S < 3
    assert "another unit" in watch.refusal(asked=True)
    own = SensorWatch(halved)
    for number in range(9):
        note(own, images[1], number)
    assert own.findings() == []


def note(watch: SensorWatch, image: np.ndarray, number: int) -> None:
    camera_frame = CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number)
    felt = {"measures": None, "exposures": None, "gradient_map": np.zeros((1, 1, 2))}
    watch.note(SimpleNamespace(camera_frame=camera_frame, **felt))  # type: ignore[arg-type]


# ---- the pattern ----


def test_a_pattern_is_found_again_after_drift_noise_and_a_shift() -> None:
    random = np.random.default_rng(0)
    grain = cv2.GaussianBlur(random.normal(0, 1, (200, 260)), (0, 0), 1.0)
    smooth = 120 + 40 * np.sin(np.linspace(0, 3, 260))[None, :]
    one, two = (np.repeat((smooth + 2 * part)[..., None], 3, 2) for part in (grain, np.roll(grain, (3, -5), (0, 1))))
    pattern = FinePattern(one)
    noisy = 0.8 * two + random.normal(0, 1, two.shape)
    assert pattern.match(noisy) > 14
    other = np.repeat((smooth + 2 * cv2.GaussianBlur(random.normal(0, 1, (200, 260)), (0, 0), 1.0))[..., None], 3, 2)
    assert pattern.match(other) < 8


def test_small_pictures_are_not_judged_by_a_pattern() -> None:
    image = np.random.default_rng(0).normal(128, 5, (100, 200, 3))
    assert pattern_match([image], image) == 0.0
    with pytest.raises(ValueError, match="the pattern"):
        FinePattern(image).match(image[:50])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("dark", [(), (2,)], ids=["even", "blue is dark"])
def test_an_even_or_dark_channel_gives_numbers(tmp_path: Path, dark: tuple[int, ...]) -> None:
    """Neither the move of an even picture nor the gain of a black channel can be fitted; the rest can."""
    reference = np.full((96, 128, 3), 100.0)
    reference[..., dark] = 0
    model = UntouchedModel(bundle_of(tmp_path / "bundle", reference))
    brighter = 0.1 * model.reference
    rest = model.judge(brighter)
    assert not rest.outliers.any()
    np.testing.assert_allclose(rest.fitted, brighter, atol=0.01)
