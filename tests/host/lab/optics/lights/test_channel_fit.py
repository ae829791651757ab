"""GelNet with a channel for each light: on pictures of a real sensor under six single lights, and live on a ring."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, ConfigError, GellightError, InputError
from gellight.base.settings import LightingSettings, Settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.daemon.assembly import open_session
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.image_files import read_grey
from gellight.lab.optics.lights import ball_series
from gellight.lab.optics.lights.ball_series import BallSeries, LitBalls, read_series, take_series
from gellight.lab.optics.lights.channel_fit import channel_table, fit_channels
from gellight.lab.training.presses import Ball, Press, contact_circle
from gellight.lab.training.table import TableOptions
from gellight.lab.training.training import TrainingOptions
from gellight.opening import open_camera
from gellight.photometric.directions import levels_of, lights_of
from gellight.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.series_camera import EXPOSURE
from gellight.series.single_light_path import SingleLightPath, frame_of_lights, read_directions
from tests.helpers.command_line import invoke
from tests.helpers.places import REAL_CROPS

OEM = REAL_CROPS / "oem_six_lights"
BALL = Ball(radius_mm=0.2465, pixel_size_mm=0.0136138)
CENTRES = [(74.27 + 146.89 * i - 2.65 * j, 62.29 + 2.54 * i + 147.16 * j) for j in range(3) for i in range(4)]
"""of the balls, from the maker's file, in pixels half as large"""
SMALL = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}
RING = RingGeometry().colours


def run(*arguments: object) -> Any:
    return invoke(*arguments)


def circles(path: Path, centres: list[tuple[float, float]], ball: Ball, image: str) -> Path:
    rows = [f"{image},{x:.2f},{y:.2f},{0.97 * ball.radius_px:.2f}" for x, y in centres]
    path.write_text("\n".join(["image,center_x_px,center_y_px,contact_radius_px", *rows]))
    return path


def test_a_network_of_six_real_lights_in_16_bit_is_trained_judged_and_used(tmp_path: Path) -> None:
    """9 balls teach, 3 judge. Normals were 18.5 degrees off with the ring fitted to the flat gel."""
    for file in OEM.glob("*.png"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    csv = circles(tmp_path / "p.csv", [(x / 2, y / 2) for x, y in CENTRES], BALL, "balls_light1.png")
    given = ["--balls", f"{tmp_path}/balls_*.png", "--untouched", f"{tmp_path}/flat_*.png", "--presses", csv]
    sizes = ["--ball-radius-mm", BALL.radius_mm, "--pixel-size-mm", BALL.pixel_size_mm, "--white", 1020]
    made = run("calibrate", "channels", *given, *sizes, "--out", tmp_path / "b", "--json")
    assert made.exit_code == 0, made.output
    judged = json.loads(made.stdout)["held_out"]
    for way in ("network", "least_squares"):
        assert judged[way]["balls"] == 3
        assert judged[way]["normal_deg"] < 3.5
        assert judged[way]["felt_radius_mm"] == pytest.approx(BALL.radius_mm, rel=0.05)
    bundle = load_bundle(tmp_path / "b")
    vectors = read_directions(bundle).vectors
    assert vectors.shape == (6, 3, 3)
    azimuth_deg = np.degrees(np.arctan2(-vectors[:, 1, 0], vectors[:, 0, 0]))
    steps = np.diff([*azimuth_deg, azimuth_deg[0]]) % 360
    assert np.abs(np.minimum(steps, 360 - steps) - 60).max() < 12, "they stand 60 degrees apart"
    for how in ([], ["--least-squares"]):
        asked = [f"{tmp_path}/balls_*.png", "--calibration", tmp_path / "b", "--white", 1020, *how]
        done = run("reconstruct", *asked, "--out", tmp_path / f"out{len(how)}", "--json")
        assert done.exit_code == 0, done.output
        with np.load(tmp_path / f"out{len(how)}/balls_light1.npz") as maps:
            depth_mm = maps["depth_mm"]
            assert maps["confidence"].shape == depth_mm.shape
            assert not maps["findings"].size
        true = BALL.radius_mm - np.sqrt(BALL.radius_mm**2 - (12 * BALL.pixel_size_mm) ** 2)
        for x, y in CENTRES:
            column, row = round(x / 2), round(y / 2)
            across = depth_mm[row, [column - 12, column, column + 12]]
            assert across[1] - across[[0, 2]].mean() == pytest.approx(true, rel=0.2)
    for wrong in (f"{tmp_path}/balls_light1.png", f"{tmp_path}/*_light1.png"):
        told = run("reconstruct", wrong, "--calibration", tmp_path / "b", "--out", tmp_path / "no")
        assert "and 6 lights: give one image for each light" in str(told.exception)
    with pytest.raises(BundleError, match="shown one after the other"):
        Reconstructor(bundle)
    with pytest.raises(BundleError, match="does not tell how a ring shows them"):
        SingleLightPath(bundle, "network")


def test_half_a_plate_is_no_calibration_of_the_other_half(tmp_path: Path) -> None:
    """A network of the left half is wrong in the right one, and says that it has not learnt there."""
    levels, untouched = (np.stack([read_grey(OEM / f"{kind}_light{n}.png", 1020) for n in range(1, 7)])
                         for kind in ("balls", "flat"))  # fmt: skip
    presses = [
        Press(image=Path("balls"), center_x_px=x / 2, center_y_px=y / 2, contact_radius_px=0.95 * BALL.radius_px)
        for x, y in CENTRES
    ]
    left = [BallSeries(levels=levels, presses=(press,)) for press in presses if press.center_x_px < 150]
    balls = LitBalls(ball=BALL, series=left, untouched=untouched, noise_grey=0.5, sensor="six lights")
    bundle = fit_channels(balls, tmp_path / "b", options=TrainingOptions(epochs=40))
    paths = [OEM / f"balls_light{number}.png" for number in range(1, 7)]
    for mode in ("network", "photometric"):
        frame = frame_of_lights(bundle, mode, paths, 1020)
        guess, shape = frame.confidence.not_learnt, levels.shape[1:]
        sides = {"left": [p for p in presses if p.center_x_px < 150], "right": presses[3::4]}
        told = {
            side: np.mean([guess[contact_circle(press, shape)].mean() for press in some])
            for side, some in sides.items()
        }
        if mode == "photometric":
            assert told == {"left": 0, "right": 0}, "what is measured is no guess"
        else:
            assert told["left"] < 0.05
            assert told["right"] > 0.8


def test_the_rows_are_the_pixels_of_the_balls_and_of_flat_gel() -> None:
    levels = np.full((4, 40, 60), 50, np.float32)
    levels[2] = 60
    press = Press(image=Path("a"), center_x_px=20, center_y_px=20, contact_radius_px=8)
    ball = Ball(radius_mm=1.0, pixel_size_mm=0.1)
    options = TableOptions(inset_px=1, flat_share=0.5, flat_distance=2)
    series = BallSeries(levels=levels, presses=(press,))
    table = channel_table([series, series], np.full((4, 40, 60), 50, np.float32), ball, options)
    assert table.rows.shape[1] == 8
    np.testing.assert_allclose(table.rows[:, :4], np.tile([0, 0, 20, 0], (len(table.rows), 1)), atol=1e-4)
    assert set(table.image.tolist()) == {0, 1}
    away = np.hypot(table.rows[:, 4] - 20, table.rows[:, 5] - 20)
    contact = away < 7
    assert contact.sum() == pytest.approx(2 * np.pi * 49, rel=0.06)
    assert away[~contact].min() > 16
    sloped = np.tan(np.arcsin(away[contact] / 10))
    np.testing.assert_allclose(np.hypot(*table.rows[contact, 6:].T), sloped, atol=1e-4)
    assert not table.rows[~contact, 6:].any()


def test_lights_are_the_colours_of_each_group_and_pictures_are_averaged() -> None:
    groups = np.zeros((2, 4, 3), np.uint8)
    groups[0, 1, 0] = groups[0, 2, 2] = groups[1, 3, 1] = 200
    assert lights_of(groups) == [(0, 0), (0, 2), (1, 1)]
    pictures = [[np.full((2, 3, 3), value, np.uint8) * [1, 2, 3] for value in shown] for shown in ((10, 20), (40,))]
    assert levels_of(pictures, groups)[:, 0, 0].tolist() == [15, 45, 80]
    assert len(lights_of(colour_triples(RING))) == len(lights_of(single_leds(RING))) == 12


def test_pictures_that_are_no_whole_series_or_circles_of_others_are_refused(tmp_path: Path) -> None:
    press = Press(image=Path("x.png"), center_x_px=20, center_y_px=20, contact_radius_px=8)
    with pytest.raises(InputError, match="several whole series"):
        read_series([tmp_path / "a", tmp_path / "b"], [press], 3, None)
    with pytest.raises(InputError, match=r"x\.png in the csv of circles is none of the pictures"):
        read_series([tmp_path / str(n) for n in range(6)], [press], 3, None)


def test_neither_pictures_nor_a_sequence_is_refused(tmp_path: Path) -> None:
    sizes = ["--ball-radius-mm", 4, "--pixel-size-mm", 0.1, "--out", tmp_path / "b"]
    for more in ([], ["--balls", tmp_path], ["--balls", tmp_path, "--sequence", "rgb"]):
        told = run("calibrate", "channels", *sizes, *more)
        assert "give either --balls, --untouched and --presses" in str(told.exception)
    assert not (tmp_path / "b").exists()


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """A bundle of the simulated ring's four groups of three LEDs."""
    with open_camera("sim://?fps=200", geometry=SMALL) as camera:
        camera.controls.set(EXPOSURE, 20000)  # a light is an LED here, of which a channel sees a quarter of the ring's
        height_mm = camera.stage.camera_height_mm
        ball = Ball(radius_mm=4.0, pixel_size_mm=SMALL["pixel_size_mm"], camera_height_mm=height_mm)
        taken = take_series(camera, colour_triples(RING), ball, 8, sensor="simulated", ask=pytest.fail, tell=print)
        assert camera.stage.status()["object"] == "", "the hand lifts at the end"
    return fit_channels(taken, tmp_path_factory.mktemp("live") / "bundle", options=TrainingOptions(recipe="fast"))


def settings(bundle: Bundle, **reconstruction: object) -> Settings:
    url = "sim://?fps=200&object=BALL&depth=1.0&x=2&y=-1"
    sensor = {"url": url, "calibration": bundle.source}
    return Settings.model_validate({"sensor": sensor, "geometry": SMALL, "reconstruction": reconstruction})


@pytest.mark.parametrize(("mode", "said"), [("network", "single_light"), ("photometric", "photometric")])
def test_a_sensor_runs_with_the_lights_of_its_bundle(live: Bundle, mode: str, said: str) -> None:
    with open_session(settings(live, mode=mode)) as daemon:
        frame = daemon.wait_frame(-1, 60)
        status: Any = daemon.status()
    assert (status["mode"], status["lights"], status["watch"]) == (said, 12, None)
    assert frame.exposures.exposures == 4
    assert not frame.exposures.moved
    contact = frame.camera_frame.truth.contact
    felt, true = (maps[contact] for maps in (frame.depth_mm, frame.camera_frame.truth.depth_mm))
    assert np.corrcoef(felt, true)[0, 1] > 0.99
    if mode == "network":  # vectors do not say how near light changes with the place: only the shape is right
        # .13 mm too deep, along parallel rays .02: bent light changes faster over the view than eight balls tell.
        assert np.abs(felt - true).mean() < 0.16
        assert frame.contact.indentation_mm == pytest.approx(1.0, abs=0.17)


def test_what_does_not_go_with_such_a_bundle_is_told(live: Bundle, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"lighting\.sequence = rgb does not go with it"):
        open_session(settings(live).model_copy(update={"lighting": LightingSettings(sequence="rgb")}))
    with pytest.raises(GellightError, match="no light ring"):
        open_session(
            settings(live).model_copy(
                update={"sensor": settings(live).sensor.model_copy(update={"url": "sim://?board=0"})}
            )
        )


@pytest.mark.parametrize(("refused", "enough"), [(60, True), (61, False)])
def test_a_virtual_hand_presses_until_it_was_refused_too_often(
    monkeypatch: pytest.MonkeyPatch, refused: int, enough: bool
) -> None:
    series, answers = BallSeries(levels=np.ones((12, 120, 160), np.float32), presses=()), iter(range(100))

    def one_more(*_: object) -> BallSeries:
        if next(answers) < refused:
            raise InputError("no press")
        return series

    monkeypatch.setattr(ball_series, "_exposed", lambda *_: series.levels)
    monkeypatch.setattr(ball_series, "_series", one_more)
    told: list[str] = []
    with open_camera("sim://?programme=0", geometry=SMALL) as camera:
        given = camera, colour_triples(RING), Ball(radius_mm=4.0, pixel_size_mm=0.2352), 2
        if enough:
            assert take_series(*given, sensor="one", ask=told.append, tell=told.append).series == (series, series)
        else:
            with pytest.raises(InputError, match="no press"):
                take_series(*given, sensor="one", ask=told.append, tell=told.append)
    assert told == ["not used: no press"] * 60
