"""A bundle adapted to light that has changed, by the untouched gel alone: judged on presses under that light."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, LedSetting, load_bundle, write_bundle
from gellight.bundle.contents import npz
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training import adapting
from gellight.lab.training.adapting import adapt, light_change, rows_of_now
from gellight.lab.training.level_light import TrainingData, at_rest_depth
from gellight.lab.training.table import LIKE_UNIT, PressTable
from gellight.lab.training.training import Reference, TrainingOptions, train
from gellight.photometric.light_model import LightGroups
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.measures import PRESSES
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.geometry import AS_BUILT
from sim_reference.imaging import ring_irradiance
from sim_reference.surface import Surface, untouched
from sim_reference.view import seen_height_mm
from tests.helpers import small_bundles
from tests.helpers.command_line import invoke

SHAPE, FRAMES, LEDS = small_bundles.SHAPE, 30, 12
EVEN = np.ones(LEDS)
ONE_FADED = np.where(np.arange(LEDS) == 5, 0.4, 1.0)
SPREAD = 1 + 0.1 * np.random.default_rng(8).standard_normal(LEDS)
LIGHT_MODEL = 0.19
"""of the largest change of an LED: so much LEDs side by side may trade"""
PLACES = [(x, y) for x in (-12.0, -6.0, 0.0, 6.0, 12.0) for y in (-8.0, 0.0, 8.0)]
FRESH = [(-9.0, 4.0), (3.0, -5.0), (9.0, 5.0)]


@dataclass(frozen=True)
class Sensor:
    """A simulated sensor whose LEDs fade, of few pixels."""

    scene: Scene

    def light(self, leds: np.ndarray) -> None:
        self.scene.led_gain = leds

    def picture(self, place: tuple[float, float] | None, seed: int, depth_mm: float = 1.0) -> np.ndarray:
        press = None if place is None else Press("BALL", depth_mm, *place)
        return digitise(self.scene.show(press)[0], 1.0, np.random.default_rng(seed))

    def untouched(self, press: Press | None = None, tint: np.ndarray | float = 1.0) -> Reference:
        grey, random = (self.scene.show(press)[0] * tint).astype(np.float32), np.random.default_rng(4)
        mean = np.mean([digitise(grey, 1.0, random) for _ in range(FRAMES)], axis=0)
        return Reference(image=mean.astype(np.float32), frames=FRAMES, noise_grey=1.0)

    def rows(self, place: tuple[float, float]) -> np.ndarray:
        """Labelled pixels of a press, and some around it, without noise."""
        (grey, surface), flat = self.scene.show(Press("BALL", 1.0, *place)), self.scene.show(None)[0]
        change = grey - flat
        near = np.flatnonzero(surface.contact | (surface.depth_mm < -0.01))
        at = np.stack([near % SHAPE[1], near // SHAPE[1]], axis=1)
        slopes = surface.gradient_map.reshape(-1, 2)[near]
        return np.hstack([change.reshape(-1, 3)[near], at, slopes]).astype(np.float32)

    def error_deg(self, bundle: Bundle) -> float:
        """Mean error of the normals in contact of fresh presses."""
        path, errors = Reconstructor(bundle), []
        for place in FRESH:
            frame = CameraFrame(image=self.picture(place, 9, 0.9), time_s=0.0, sequence=0, source="sim")
            surface = self.scene.show(Press("BALL", 0.9, *place))[1]
            felt = path.reconstruct(frame).normal_map
            errors.append(angle_deg(felt, normals(surface.gradient_map))[surface.contact].mean())
        return float(np.mean(errors))


@pytest.fixture(scope="module")
def sensor() -> Sensor:
    geometry = replace(
        AS_BUILT, image_width_px=SHAPE[1], image_height_px=SHAPE[0], pixel_size_mm=small_bundles.PIXEL_MM
    )
    return Sensor(Scene(geometry, CameraResponse(noise_grey=1.0)))


@pytest.fixture(autouse=True)
def as_calibrated(sensor: Sensor) -> None:
    sensor.light(EVEN)


@pytest.fixture(scope="module")
def bundle(sensor: Sensor, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return calibrated(sensor, tmp_path_factory.mktemp("bundle") / "own", seed=0)


def calibrated(sensor: Sensor, out: Path, seed: int) -> Bundle:
    """Write the bundle of a sensor whose LEDs are even."""
    sensor.light(EVEN)
    reference = sensor.untouched().image
    parts = [sensor.rows(place) for place in PLACES]
    table = PressTable.joined(parts, np.arange(len(parts), dtype=np.int32), SHAPE)
    network, record = train(TrainingData(table), TrainingOptions(recipe="fast", seed=seed), untouched=reference)
    leds = [
        LedSetting(colour=colour, rgb=tuple((255 * light).astype(int).tolist()))
        for colour, light in zip(sensor.scene.geometry.led_colours, sensor.scene.light, strict=True)
    ]
    lights = {"lights.json": small_bundles.ordinary().files["lights.json"]}
    return write_bundle(
        out, sensor="C3", reference=reference, reference_frames=FRAMES,
        noise_grey=1.0, network=network, pixel_size_mm=(small_bundles.PIXEL_MM,) * 2, metrics={"training": record},
        presses=table.arrays(), led=tuple(leds), extra_files=lights,
        camera_height_mm=seen_height_mm(AS_BUILT),
    )  # fmt: skip


@pytest.mark.parametrize("leds", [0.9 * EVEN, ONE_FADED, SPREAD], ids=["all darker", "one faded", "all changed"])
def test_presses_are_turned_into_what_they_show_under_the_light_of_now(
    sensor: Sensor, bundle: Bundle, leds: np.ndarray
) -> None:
    sensor.light(leds)
    change = light_change(bundle, sensor.untouched().image, FRAMES)
    seen = np.concatenate([sensor.rows(place) for place in PLACES])
    turned, table = rows_of_now(PressTable.of(bundle), bundle, change), PressTable.of(bundle)
    assert turned[:, 3:] == pytest.approx(seen[:, 3:], abs=1e-4)
    wrong, was_wrong = (np.sqrt(((rows - seen)[:, :3] ** 2).mean()) for rows in (turned, table.rows))
    print(f"off by {was_wrong:.2f} grey levels as they were, {wrong:.2f} turned")
    assert wrong < 0.32 * was_wrong, "of which the noise of the pictures is .09 grey levels"
    if change.leds is not None:
        assert change.leds == pytest.approx(leds, abs=LIGHT_MODEL * np.abs(1 - leds).max())


def test_an_adapted_bundle_feels_as_before_the_light_changed(sensor: Sensor, bundle: Bundle, tmp_path: Path) -> None:
    own_deg, leds = sensor.error_deg(bundle), 0.9 * EVEN
    sensor.light(leds)
    now = sensor.untouched()
    zeroed_deg = sensor.error_deg(bundle.with_reference(now.image, frames=FRAMES))
    made, change = adapt(bundle, now, tmp_path / "now")
    print(f"own {own_deg:.2f}, new zero {zeroed_deg:.2f}, adapted {sensor.error_deg(made):.2f} degrees")
    assert sensor.error_deg(made) < own_deg + 0.35 * (zeroed_deg - own_deg)
    assert made.metrics["adapted"] == {"from": bundle.identity, "frames": FRAMES, **change.as_json()}
    assert load_bundle(tmp_path / "now").identity == made.identity != bundle.identity
    before, after = (read_lights(one).references(LightGroups.SINGLES).mean(axis=(1, 2)) for one in (bundle, made))
    assert after / before == pytest.approx(leds, abs=LIGHT_MODEL * np.abs(1 - leds).max())


@pytest.mark.nightly
def test_so_does_that_of_a_sensor_with_one_faded_led_by_the_mean_of_four_networks(
    sensor: Sensor, tmp_path: Path
) -> None:
    """Of single ones adapting leaves 0.2 to 0.45 of what a new zero leaves."""
    figures = []
    for seed in range(4):
        bundle = calibrated(sensor, tmp_path / f"own-{seed}", seed)
        own_deg = sensor.error_deg(bundle)
        sensor.light(ONE_FADED)
        now = sensor.untouched()
        zeroed_deg = sensor.error_deg(bundle.with_reference(now.image, frames=FRAMES))
        figures.append((own_deg, zeroed_deg, sensor.error_deg(adapt(bundle, now, tmp_path / f"now-{seed}")[0])))
    own_deg, zeroed_deg, adapted_deg = np.mean(figures, axis=0)
    assert adapted_deg < own_deg + 0.35 * (zeroed_deg - own_deg), figures


def test_a_network_of_light_at_rest_learns_such_light_again(
    sensor: Sensor, bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learnt: list[TrainingData] = []

    def train_nothing(of: TrainingData, *_: object, **__: object) -> tuple[bytes, object]:
        learnt.append(of)
        return bundle.network, bundle.metrics["training"]

    monkeypatch.setattr(adapting, "train", train_nothing)
    table = PressTable.of(bundle)
    table = replace(table, depth_mm=np.full(len(table.rows), 0.5, np.float32))
    manifest = bundle.manifest.model_copy(update={"light_by_depth": True})
    at_rest = replace(bundle, manifest=manifest, files={**bundle.files, PRESSES: npz(table.arrays())})
    now = sensor.untouched(tint=0.9)
    (_, _), (made, _) = (adapt(one, now, tmp_path / name) for one, name in ((bundle, "looks"), (at_rest, "rest")))
    (as_it_looks, _, unlit), (level, _, lit) = learnt
    assert unlit is None
    assert len(lit["lit"]) == len(level.rows)
    np.testing.assert_array_equal(PressTable.of(made).rows, as_it_looks.rows)
    own = replace(as_it_looks, depth_mm=table.depth_mm)
    seen = bundle.pixel_size_mm, bundle.manifest.camera_height_mm
    wanted = at_rest_depth(own, read_lights(made), now.image, *seen)
    assert np.abs(wanted.rows - own.rows).max() > 1
    np.testing.assert_allclose(level.rows, wanted.rows, atol=0.01)
    assert made.manifest.light_by_depth


def test_a_like_unit_goes_on_helping(
    sensor: Sensor, bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[PressTable] = []

    def train_nothing(of: TrainingData, *_: object, **__: object) -> tuple[bytes, object]:
        begun.append(of.like)
        return bundle.network, bundle.metrics["training"]

    monkeypatch.setattr(adapting, "train", train_nothing)
    table = PressTable.of(bundle)
    own, of_like = (replace(table, rows=table.rows[part], image=table.image[part]) for part in (np.s_[:99], np.s_[99:]))
    metrics = {**bundle.metrics, "like": "unit A"}
    files = {"metrics.json": json.dumps(metrics).encode(), PRESSES: npz(own.arrays(of_like))}
    made, change = adapt(bundle.with_files(files), sensor.untouched(tint=0.9), tmp_path / "now")
    np.testing.assert_array_equal(begun[0].rows, rows_of_now(of_like, bundle, change))
    np.testing.assert_array_equal(PressTable.of(made, LIKE_UNIT).rows, begun[0].rows)
    assert len(PressTable.of(made).rows) == 99
    with pytest.raises(BundleError, match="does not keep all presses"):
        adapt(bundle.with_files({**files, PRESSES: npz(own.arrays())}), sensor.untouched(), tmp_path / "lost")
    assert not (tmp_path / "lost").exists()


def pressed_by_a_plate(sensor: Sensor, deeper_mm: float) -> np.ndarray:
    flat = untouched(sensor.scene.geometry)
    nearer = Surface(flat.depth_mm + deeper_mm, flat.gradient_map, flat.contact)
    grey = linear_grey(ring_irradiance(nearer, sensor.scene.geometry, sensor.scene.light), sensor.scene.response)
    random = np.random.default_rng(5)
    return np.mean([digitise(grey.astype(np.float32), 1.0, random) for _ in range(FRAMES)], axis=0)


def test_what_light_alone_does_not_explain_is_refused(sensor: Sensor, bundle: Bundle) -> None:
    with pytest.raises(InputError, match=r"something flat pressed the whole gel|as light cannot change it"):
        light_change(bundle, pressed_by_a_plate(sensor, 0.2), FRAMES)
    across = np.linspace(-1, 1, SHAPE[1])[None, :, None]
    for now in (
        sensor.untouched(Press("BALL", 0.2, 2.0, 1.0)),
        sensor.untouched(tint=1 + 0.05 * across - 0.05 * across**2),  # another coating
    ):
        with pytest.raises(InputError, match=r"light cannot change it.*calibrate the sensor again"):
            light_change(bundle, now.image, FRAMES)
    sensor.light(0.9 * EVEN)
    with pytest.raises(InputError, match="light cannot change it"):
        light_change(bundle, sensor.untouched(Press("BALL", 0.2, 2.0, 1.0)).image, FRAMES)
    sensor.light(0.2 * EVEN)
    with pytest.raises(InputError, match="20%, 20%, 20% of their light"):
        light_change(bundle, sensor.untouched().image, FRAMES)


def test_a_bundle_without_leds_follows_the_gains_of_its_channels_alone(sensor: Sensor, bundle: Bundle) -> None:
    unknown = replace(bundle, manifest=bundle.manifest.model_copy(update={"led": ()}))
    sensor.light(0.8 * EVEN)
    change = light_change(unknown, sensor.untouched().image, FRAMES)
    assert change.leds is None
    assert change.gains == pytest.approx([0.8] * 3, abs=0.01)
    sensor.light(ONE_FADED)
    with pytest.raises(InputError, match="light cannot change it"):
        light_change(unknown, sensor.untouched().image, FRAMES)


def test_bundles_that_cannot_learn_again_are_refused(sensor: Sensor, bundle: Bundle, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"has no presses\.npz"):
        adapt(small_bundles.ordinary(), sensor.untouched(), tmp_path / "none")
    silent = bundle.with_files({"metrics.json": b"{}"})
    with pytest.raises(BundleError, match="does not say how it was trained"):
        adapt(silent, sensor.untouched(), tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_the_command_takes_pictures_of_the_untouched_gel(sensor: Sensor, bundle: Bundle, tmp_path: Path) -> None:
    sensor.light(0.9 * EVEN)
    for number in range(3):
        write_png(tmp_path / f"still-{number}.png", sensor.picture(None, number))
        write_png(tmp_path / f"moving-{number}.png", sensor.picture((0.0, 0.0), number, 0.2 + number / 4))
    told = ["calibrate", "adapt", "--calibration", bundle.source, "--out", tmp_path / "now", "--json"]
    refused = invoke(*told, "--reference", tmp_path / "moving-*.png")
    with pytest.raises(InputError, match="touch nothing"):
        raise refused.exception or AssertionError(refused.output)
    assert not (tmp_path / "now").exists()
    said = invoke(*told, "--reference", tmp_path / "still-*.png")
    assert said.exit_code == 0, said.output
    assert json.loads(said.stdout)["gains"] == pytest.approx([0.9] * 3, abs=0.01)
    assert load_bundle(tmp_path / "now").metrics["adapted"]["frames"] == 3
