"""Any lights, from balls: exact where the model holds, and on pictures of a real sensor under six single lights."""

import json
import re
from contextlib import nullcontext
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle, save_bundle
from gellight.frames.image_files import read_grey
from gellight.lab.optics.lights import channel_fit
from gellight.lab.optics.lights.ball_series import BallSeries, divided
from gellight.lab.optics.lights.channel_fit import check_lights, lights_from_balls
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.photometric.directions import view_places
from gellight.reconstruction.integration import normals
from gellight.series.single_light_path import read_directions
from tests.helpers.command_line import invoke
from tests.helpers.places import REAL_CROPS
from tests.helpers.small_bundles import ordinary, with_directions

SHAPE = (150, 200)
BALL = Ball(radius_mm=2.0, pixel_size_mm=0.1)
PRESSES = [
    Press(image=Path(f"{x}-{y}.png"), center_x_px=x, center_y_px=y, contact_radius_px=15.0)
    for y in (30.0, 75.0, 120.0)
    for x in (35.0, 100.0, 165.0)
]
OEM = REAL_CROPS / "oem_six_lights"
OEM_BALL = Ball(radius_mm=0.2465, pixel_size_mm=0.0136138)
OEM_CENTRES = [(74.27 + 146.89 * i - 2.65 * j, 62.29 + 2.54 * i + 147.16 * j) for j in range(3) for i in range(4)]
"""of the balls, from the maker's file, in pixels half as large"""


def surface(presses: list[Press]) -> np.ndarray:
    """(H, W, 3) normals of balls pressed into a flat gel."""
    gradient = np.zeros((*SHAPE, 2), np.float32)
    for press in presses:
        inside = contact_circle(press, SHAPE)
        gradient[inside] = sphere_gradient(press, BALL, SHAPE)[inside]
    return normals(gradient)


def series(levels: np.ndarray, presses: list[Press]) -> BallSeries:
    return BallSeries(levels=levels, presses=tuple(presses))


def shaded(vectors: np.ndarray, normal: np.ndarray, untouched: np.ndarray, noise: float = 0.3) -> np.ndarray:
    places = view_places(SHAPE, np.arange(SHAPE[0] * SHAPE[1]))
    lights = np.einsum("kij,jn->kin", vectors, places).reshape(len(vectors), 3, *SHAPE)
    grey = untouched * np.einsum("kihw,hwi->khw", lights, normal)
    return np.asarray(grey + np.random.default_rng(0).normal(0, noise, grey.shape), np.float32)


@pytest.fixture(scope="module")
def vectors() -> np.ndarray:
    """Five lights at no regular azimuths, of which two are low, all changing over the view."""
    middles = np.array([[0.5, 0.1, 1], [0.2, -0.6, 1], [-0.7, -0.2, 1], [-0.3, 0.5, 1], [0.35, 0.4, 1]])
    over_the_view = np.random.default_rng(1).normal(0, 0.06, (5, 3, 2)) * [[1], [1], [0]]
    return np.concatenate([middles[..., None], over_the_view], axis=2)


def test_lights_of_any_number_and_place_are_found_and_balls_felt(vectors: np.ndarray) -> None:
    rows, columns = np.indices(SHAPE)
    untouched = np.stack([80 + 0.2 * k * columns + 0.1 * rows for k in range(5)]).astype(np.float32)
    pictures = shaded(vectors, surface(PRESSES), untouched)
    lights = lights_from_balls([series(pictures, PRESSES[1:])], untouched, BALL, 0.3)
    np.testing.assert_allclose(lights.vectors, vectors, atol=0.03)
    judged = check_lights(lights, [series(pictures, PRESSES[:1])], BALL)
    assert judged.normal_deg < 0.6
    assert judged.felt_radius_mm == pytest.approx(2.0, rel=0.01)


def test_several_series_of_one_ball_each_say_the_same_as_one_picture_of_all(vectors: np.ndarray) -> None:
    untouched = np.full((5, *SHAPE), 100, np.float32)
    apart = [series(shaded(vectors, surface([press]), untouched), [press]) for press in PRESSES]
    lights = lights_from_balls(apart[1:], untouched, BALL, 0.3)
    np.testing.assert_allclose(lights.vectors, vectors, atol=0.03)
    learnt, judging = divided(apart)
    assert [one.presses[0] for one in judging] == [PRESSES[0], PRESSES[4], PRESSES[8]]
    assert len(learnt) == 6
    with pytest.raises(InputError, match="give at least 6"):
        divided(apart[:4])


def test_lights_that_do_not_explain_the_balls_are_refused(vectors: np.ndarray) -> None:
    untouched = np.full((5, *SHAPE), 100, np.float32)
    pictures = shaded(vectors, surface(PRESSES), untouched)
    lights = lights_from_balls([series(pictures, PRESSES[1:])], untouched, BALL, 0.3)
    with pytest.raises(InputError, match="degrees off, 12 are allowed"):
        check_lights(lights, [series(pictures[[1, 0, 3, 2, 4]], PRESSES[:1])], BALL)
    with pytest.raises(InputError, match="at least 3 lights"):
        lights_from_balls([series(pictures[:2], PRESSES)], untouched[:2], BALL, 0.3)
    with pytest.raises(InputError, match="too few to find lights by"):
        lights_from_balls([series(pictures, PRESSES[:3])], untouched, BALL, 0.3)
    assert len(lights_from_balls([series(pictures, PRESSES[:4])], untouched, BALL, 0.3).vectors) == 5


@pytest.mark.parametrize(("lean", "enough"), [(0.095, False), (0.105, True)])
def test_lights_from_straight_above_are_refused(lean: float, enough: bool) -> None:
    untouched = np.full((3, *SHAPE), 100, np.float32)
    above = np.tile(np.array([[lean, 0, 0], [0, 0, 0], [1, 0, 0]]), (3, 1, 1))
    pictures = shaded(above, surface(PRESSES), untouched, noise=0.0)
    with nullcontext() if enough else pytest.raises(InputError, match="straight above"):
        assert len(lights_from_balls([series(pictures, PRESSES)], untouched, BALL, 0.3).vectors) == 3


@pytest.mark.parametrize(("normal_deg", "right"), [(11.9, True), (12.1, False)])
def test_held_out_balls_are_felt_within_twelve_degrees(
    normal_deg: float, right: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(channel_fit, "held_out", lambda *given: Mock(normal_deg=normal_deg))
    with nullcontext() if right else pytest.raises(InputError, match=r"felt 12\.1 degrees off"):
        assert check_lights(Mock(), [], BALL).normal_deg == normal_deg


def test_six_real_lights_in_16_bit_are_found_on_balls_and_feel_others(tmp_path: Path) -> None:
    """9 balls teach, 3 judge. Normals were 18.5 degrees off with the ring fitted to the flat gel."""
    rows = [f"balls_light1.png,{x / 2:.2f},{y / 2:.2f},{0.97 * OEM_BALL.radius_px:.2f}" for x, y in OEM_CENTRES]
    (tmp_path / "p.csv").write_text("\n".join(["image,center_x_px,center_y_px,contact_radius_px", *rows]))
    for number in range(1, 7):
        for kind in ("balls", "flat"):
            name = f"{kind}_light{number}.png"
            (tmp_path / name).write_bytes((OEM / name).read_bytes())
    sizes = ["--ball-radius-mm", str(OEM_BALL.radius_mm), "--pixel-size-mm", str(OEM_BALL.pixel_size_mm)]
    series = ["--balls", f"{tmp_path}/balls_*.png", "--untouched", f"{tmp_path}/flat_*.png", "--white", "1020"]
    given = ["channels", *series, *sizes, "--presses", tmp_path / "p.csv", "--out", tmp_path / "l", "--epochs", "1"]
    result = invoke("calibrate", *given, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["held_out"]["least_squares"]
    assert found["balls"] == 3
    assert found["normal_deg"] < 3.5
    assert found["felt_radius_mm"] == pytest.approx(OEM_BALL.radius_mm, rel=0.03)
    # They stand 60 degrees apart.
    x, y, _ = read_directions(load_bundle(tmp_path / "l")).vectors[:, :, 0].T
    azimuth_deg = np.degrees(np.arctan2(-y, x))
    steps = np.diff([*azimuth_deg, azimuth_deg[0]]) % 360
    assert np.abs(np.minimum(steps, 360 - steps) - 60).max() < 12
    asked = [f"{tmp_path}/balls_*.png", "--calibration", tmp_path / "l", "--white", "1020", "--out", tmp_path / "out"]
    assert invoke("reconstruct", *asked, "--least-squares", "--json").exit_code == 0
    with np.load(tmp_path / "out/balls_light1.npz") as maps:
        depth_mm = maps["depth_mm"]
    for x, y in OEM_CENTRES:
        column, row = round(x / 2), round(y / 2)
        across = depth_mm[row, [column - 12, column, column + 12]]
        cap = across[1] - across[[0, 2]].mean()
        true = OEM_BALL.radius_mm - np.sqrt(OEM_BALL.radius_mm**2 - (12 * OEM_BALL.pixel_size_mm) ** 2)
        assert cap == pytest.approx(true, rel=0.2)


def test_a_series_of_another_number_is_refused(tmp_path: Path) -> None:
    bundle = save_bundle(with_directions(ordinary()), tmp_path / "lights")
    cv2.imwrite(str(tmp_path / "a.png"), np.full(bundle.image_shape, 511, np.uint16))
    assert read_grey(tmp_path / "a.png", 1022.0)[0, 0] == pytest.approx(127.5)
    result = invoke("reconstruct", tmp_path / "a.png", "--calibration", tmp_path / "lights", "--out", tmp_path / "out")
    assert re.match("1 images and [0-9]+ lights: give one image for each light", str(result.exception))
