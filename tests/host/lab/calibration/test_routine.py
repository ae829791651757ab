"""The calibration routine from end to end on the simulated sensor, also with lights that are simply on."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.bundle.bundle import extend_bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.bundle.store import BundleStore
from gellight.frames.camera import Camera
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.presets import PRESETS, preset_called
from gellight.lab.calibration.routine import Routine
from gellight.lab.optics.lens.measuring import add_lens, measure_lens
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.virtual_hand import VirtualHand, hand_of
from gellight.opening import open_camera
from gellight.photometric.lights_file import read_lights
from gellight.photometric.ring_geometry import RingGeometry
from gellight.reconstruction.force_file import ForceRecord
from gellight.reconstruction.lens.undistortion import LensRecord
from tests.benchmarks.objects import mean_errors, object_errors
from tests.helpers.calibration_routine import GEOMETRY, LIT, camera, finished, options, wait_for
from tests.helpers.small_bundles import with_lens

UNTIL_UM = 40.0


def test_the_routine_calibrates_the_simulated_sensor_by_itself(calibrated: tuple[Path, dict[str, Any]]) -> None:
    _, snapshot = calibrated
    assert snapshot["verdict"]["passed"]
    figures = snapshot["figures"]["verify"]
    assert figures["true_normal_deg"] < 0.4
    assert figures["depth_mm"] < 0.02
    assert all(step["state"] == "done" for step in snapshot["steps"])


def test_it_measures_noise_and_pixel_and_finds_every_led_where_it_is(calibrated: tuple[Path, dict[str, Any]]) -> None:
    figures = calibrated[1]["figures"]
    assert figures["reference"]["noise_grey"] == pytest.approx(np.sqrt(1 + 1 / 12), rel=0.05)
    assert figures["pixel_size"]["pixel_size_mm"] == pytest.approx(0.1176, rel=0.004)
    leds = figures["prepare"]["lights"]["leds"]
    assert "".join(led["seen_colour"] for led in leds) == "RRRRGGGGBBBB"
    turned = [(led["azimuth_deg"] - 30 * led["led"] + 180) % 360 - 180 for led in leds]
    assert max(map(abs, turned)) < 12


@pytest.mark.nightly
def test_a_ring_of_eight_leds_is_calibrated_as_its_geometry_says(tmp_path: Path) -> None:
    """A short rehearsal: board, LED check, light and bundle go by led_colours, whose colours are not equally many.

    It presses until presses held out are felt well enough.
    """
    ring = {**GEOMETRY, "led_colours": "RRRGGGBB"}
    with open_camera(LIT, geometry=ring) as sensor:
        tools = options(tmp_path, ring=RingGeometry(led_colours="RRRGGGBB"), presses=30, until_um=UNTIL_UM)
        routine = Routine(sensor, tools, tmp_path / "state", hand=VirtualHand(sensor.stage), install=lambda _: None)
        snapshot = finished(routine)
    assert snapshot["step"] == "finished", snapshot["problem"]
    assert snapshot["verdict"]["passed"]
    lights = snapshot["figures"]["prepare"]["lights"]
    assert "".join(led["seen_colour"] for led in lights["leds"]) == "RRRGGGBB"
    bundle = load_bundle(tmp_path / "bundle")
    assert [led.colour for led in bundle.manifest.led] == list("RRRGGGBB")
    assert read_lights(bundle).ring.led_colours == "RRRGGGBB"
    assert bundle.manifest.light_by_depth
    collected = snapshot["figures"]["presses"]
    assert 8 <= collected["presses"] < 30
    assert collected["held_out_um"] <= UNTIL_UM


def test_a_board_of_another_number_of_leds_is_told(tmp_path: Path) -> None:
    with open_camera(LIT, geometry={**GEOMETRY, "led_colours": "RRRGGGBB"}) as sensor:
        hand = VirtualHand(sensor.stage)
        snapshot = finished(Routine(sensor, options(tmp_path), tmp_path / "state", hand=hand, install=lambda _: None))
    assert "the board drives 8 LEDs, led_colours = 'RRRRGGGGBBBB' has 12" in snapshot["problem"]


def test_a_sensor_that_is_unplugged_later_comes_back_as_it_was_prepared(
    calibrated: tuple[Path, dict[str, Any]],
) -> None:
    prepared = calibrated[1]["figures"]["prepare"]
    assert calibrated[1]["adopted"] == [prepared["camera"], prepared["led"]]


def test_the_colours_of_the_untouched_gel_are_balanced(calibrated: tuple[Path, dict[str, Any]]) -> None:
    uniformity = calibrated[1]["figures"]["prepare"]["uniformity"]
    means = [uniformity[colour]["mean_grey"] for colour in ("red", "green", "blue")]
    assert max(means) - min(means) < 0.015 * np.mean(means)
    assert 150 < max(uniformity[colour]["brightest_grey"] for colour in ("red", "green", "blue")) < 230


def test_the_bundle_knows_its_light_its_camera_and_its_report(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, snapshot = calibrated
    bundle = load_bundle(folder / "bundle")
    assert ForceRecord.in_bundle(bundle) is not None, "the simulated gel knows its own"
    assert snapshot["installed"] == [str(folder / "bundle")]
    assert len(bundle.manifest.led) == 12
    assert set(bundle.manifest.camera) == {"exposure_us", "gain", "white_balance_k"}
    report = BundleStore(tmp_path).add(bundle).report().decode()
    assert "The rim of the ball is felt" in report
    assert "Balls are seen from 53.1 mm above the gel" in report
    assert "felt over expected indentation" in report
    felt = snapshot["figures"]["verify"]["felt_over_expected"]
    # Its gel is linear: a ball stands up to 7 % deeper in its circle than in the gel that is expected. The median is of
    # two circles of 14 px at least, each known to half a pixel. Twelve calibrations gave 1.07 to 1.16.
    assert felt == pytest.approx(1.1, abs=0.1)
    assert f"felt {felt:.2f} times as deep as contact mechanics expect" in snapshot["verdict"]["text"]
    assert report.count("<img") == 7
    # Without the pictures: four letters come by chance in that many.
    words = re.sub(r'"data:image/png;base64,[^"]*"', "", report)
    assert "http" not in words.replace("http://www.w3.org/2000/svg", "")


def test_a_pin_grid_that_its_bundle_feels_tells_the_lens_to_a_tenth_of_a_pixel(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    bundle = load_bundle(calibrated[0] / "bundle")
    with open_camera(LIT, geometry=GEOMETRY, bundle=bundle) as sensor:
        write_png(tmp_path / "untouched.png", sensor.read().image)
        sensor.stage.press("PINS", 0.2, 0.3, -0.2)
        write_png(tmp_path / "grid.png", sensor.read().image)
    pictures = [tmp_path / "grid.png"]
    fit = measure_lens(bundle, pictures, 2.0, str(tmp_path / "untouched.png"))
    assert fit.pins > 200
    assert fit.rms_after_px < 0.1
    assert fit.lens.bend_px < 1.0
    assert LensRecord.in_bundle(add_lens(bundle, fit, pictures, tmp_path / "new")).learnt_from_circles


def test_its_objects_are_measured_under_the_light_it_was_made_with(calibrated: tuple[Path, dict[str, Any]]) -> None:
    errors = object_errors(str(calibrated[0] / "bundle"), LIT, 0.2, geometry=GEOMETRY)
    assert len(errors) == 10
    assert mean_errors(errors.values()).normal_deg < 1.5


def test_what_exists_is_not_overwritten_unasked(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    folder = calibrated[0]
    with camera() as sensor:
        with pytest.raises(InputError, match="exists: choose another name"):
            Routine(sensor, options(folder), tmp_path)
        with pytest.raises(BundleError, match="the bundle of sensor 'one', not of 'two'"):
            Routine(sensor, RoutineOptions(out=folder / "bundle", sensor="two", overwrite=True), tmp_path)


def test_a_bundle_needs_the_controls_it_was_made_with(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(CameraError, match="no control 'exposure_us'"):
        open_camera(tmp_path / "a.png", bundle=load_bundle(calibrated[0] / "bundle"))


class Person:
    """A user of the guided routine: goes on when asked, presses and lifts on the stage."""

    def __init__(self, routine: Routine, sensor: Camera) -> None:
        self.routine, self.stage = routine, sensor.stage
        self.presses = 0

    def go_on(self, step: str) -> None:
        wait_for(self.routine, lambda s: s["step"] == step and "next" in s["actions"])
        self.routine.act("next")

    def press(self, tool: str, depth_mm: float, x: float, y: float) -> dict[str, Any]:
        before = wait_for(self.routine, lambda s: s["awaiting"] == "press")
        self.stage.press(tool, depth_mm, x, y)
        old = before.get("press"), before["problem"]
        told = wait_for(
            self.routine, lambda s: s.get("press") not in (None, old[0]) or s["problem"] not in ("", old[1])
        )
        self.stage.release()
        return told


def test_a_guided_user_corrects_drops_aborts_and_resumes(tmp_path: Path) -> None:
    with camera() as sensor:
        tools = options(tmp_path, cylinder_diameter_mm=8.0)
        routine = Routine(sensor, tools, tmp_path / "state")
        with pytest.raises(InputError, match="choose start"):
            routine.act("next")
        routine.act("start")
        user = Person(routine, sensor)
        user.go_on("prepare")
        user.go_on("reference")
        for place in ((0.0, 0.0), (3.0, 2.0)):
            user.press("CYLINDER", 0.3, *place)
        first = user.press("BALL", 1.0, 5.0, 3.0)["press"]
        assert (first["center_x_px"], first["center_y_px"]) == pytest.approx((202.0, 145.0), abs=0.5)
        routine.act("correct", center_x_px=200.0, center_y_px=140.0, contact_radius_px=15.0)
        corrected = wait_for(routine, lambda s: "press" in s and s["press"]["state"] == "corrected")["press"]
        assert corrected["center_x_px"] == 200.0
        routine.act("correct", center_x_px=200.0, center_y_px=140.0, contact_radius_px=50.0)
        assert "is it a ball of 4 mm" in wait_for(routine, lambda s: s["problem"] != "")["problem"]
        user.press("BALL", 1.2, -5.0, 3.0)
        routine.act("drop")
        wait_for(routine, lambda s: s["progress"]["done"] == 1)
        routine.act("next")
        assert "press at least 7 more times" in wait_for(routine, lambda s: "too few" in s["problem"])["problem"]
        routine.act("abort")
        routine.join(200)
        assert routine.snapshot()["step"] == "aborted"
        with pytest.raises(InputError, match=r"begun with cylinder_diameter_mm 8.0, not 6.0: give the same again"):
            Routine(sensor, options(tmp_path, cylinder_diameter_mm=6.0), tmp_path / "state")
        again = Routine(sensor, tools, tmp_path / "state")
        again.act("start")
        resumed = wait_for(again, lambda s: s["step"] == "presses" and s["progress"].get("done") == 1)
        assert resumed["figures"]["pixel_size"]["presses"] == 2
        again.stop()
        again.join(200)


def test_a_resumed_calibration_that_does_not_pass_replaces_nothing(
    calibrated: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    shutil.copytree(calibrated[0] / "state", tmp_path / "state")
    place = tmp_path / "state/state.json"
    state = json.loads(place.read_text())
    place.write_text(json.dumps({**state, "finished": False, "checks": []}))
    with camera(LIT) as sensor:
        strict = options(tmp_path, limits=Limits(depth_mm=1e-5))
        hand = VirtualHand(sensor.stage)
        snapshot = finished(Routine(sensor, strict, tmp_path / "state", hand=hand, install=lambda bundle: 1 / 0))
    assert snapshot["step"] == "finished", snapshot["problem"]
    assert not snapshot["verdict"]["passed"]
    assert "Nothing was replaced" in snapshot["verdict"]["text"]
    assert snapshot["bundle"] == ""
    assert not (tmp_path / "bundle").exists()
    state = json.loads(place.read_text())
    assert state["extra_presses"] > 0
    assert "fit" not in state["steps"]


def test_the_bundle_keeps_all_that_its_draft_holds(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """Also a lens that an older version measured: the draft is judged without it, for circles are of the picture."""
    shutil.copytree(calibrated[0] / "state", tmp_path / "state")
    place = tmp_path / "state/state.json"
    place.write_text(json.dumps({**json.loads(place.read_text()), "finished": False, "checks": []}))
    draft = load_bundle(tmp_path / "state/draft")
    draft = replace(draft, manifest=draft.manifest.model_copy(update={"bulge": 0.7}))
    lens = with_lens(draft, k1=-0.25).files["lens.json"]
    draft = extend_bundle(draft, tmp_path / "state/draft", {"notes.json": b"{}", "lens.json": lens}, overwrite=True)
    with camera(LIT) as sensor:
        tools = options(tmp_path)
        snapshot = finished(Routine(sensor, tools, tmp_path / "state", hand=VirtualHand(sensor.stage)))
    assert snapshot["step"] == "finished", snapshot["problem"]
    bundle = load_bundle(tmp_path / "bundle")
    changed = {"metrics.json", "report.html"}
    assert {name for name, content in bundle.files.items() if draft.files.get(name) != content} == changed
    assert set(bundle.files) == {*draft.files, "report.html"}
    fields = {"files", "created", "led", "camera", "gel_thickness_mm"}
    assert bundle.manifest.model_dump(exclude=fields) == draft.manifest.model_dump(exclude=fields)
    assert bundle.metrics["training"] == draft.metrics["training"]
    assert bundle.metrics["verification"]["true_depth_mm"] < 0.03
    assert bundle.manifest.gel_thickness_mm == 5.0, "a simulated sensor knows its gel"


PIXEL_MM = 0.2352
SMALL = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": PIXEL_MM}
NO_RING = "sim://?fps=500&board=0"


def fixed(folder: Path, **changes: Any) -> RoutineOptions:
    return options(folder, **{"pixel_size_mm": PIXEL_MM, **changes})


@pytest.mark.nightly
def test_no_ring_and_no_cylinder_are_needed(tmp_path: Path) -> None:
    with open_camera(NO_RING, geometry=SMALL) as camera:
        assert camera.ring is None
        routine = Routine(camera, fixed(tmp_path), tmp_path / "state", hand=hand_of(camera))
        routine.act("start")
        routine.join(200)
        shown = routine.snapshot()
    assert shown["step"] == "finished", shown["problem"]
    assert shown["verdict"]["passed"]
    assert shown["figures"]["pixel_size"] == {"x_mm": PIXEL_MM, "y_mm": PIXEL_MM, "pixel_size_mm": PIXEL_MM}
    assert shown["figures"]["prepare"].get("led") is None
    bundle = load_bundle(tmp_path / "bundle")
    assert bundle.pixel_size_mm == pytest.approx((PIXEL_MM, PIXEL_MM))
    assert bundle.colours is None
    assert "nothing measured it" in bundle.files["report.html"].decode()


def test_a_calibration_goes_on_with_the_pixel_size_it_was_begun_with(tmp_path: Path) -> None:
    with open_camera(NO_RING, geometry=SMALL) as camera:
        Routine(camera, fixed(tmp_path), tmp_path / "state")
        with pytest.raises(InputError, match=r"begun with pixel_size_mm 0.2352, not None"):
            Routine(camera, fixed(tmp_path, pixel_size_mm=None), tmp_path / "state")


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan")])
def test_a_pixel_without_a_size_is_refused(tmp_path: Path, wrong: float) -> None:
    with pytest.raises(InputError, match="pixel_size_mm"):
        fixed(tmp_path, pixel_size_mm=wrong)


def test_presets_are_known_by_name_and_documented() -> None:
    assert preset_called("gelsight-mini").ball_radius_mm == 2.35
    with pytest.raises(InputError, match="did you mean gelsight-mini"):
        preset_called("gelsight")
    pages = ("other-sensors.md", "gelsight-mini.md", "digit.md")
    docs = "".join((Path(__file__).parents[4] / "docs" / page).read_text() for page in pages)
    for preset in PRESETS:
        assert f"`{preset.name}`" in docs
        assert preset.view_mm is None or f"{preset.view_mm[0]:g} x {preset.view_mm[1]:g} mm" in docs
        assert preset.ball_radius_mm is None or f"{preset.ball_radius_mm:g} mm" in docs
