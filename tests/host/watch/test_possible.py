"""A frame that cannot be is said: at once, in each frame, and no longer than it lasts; what can be is left alone."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.daemon import assembly
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.training.training import Learning, TrainingOptions, fit
from gellight.watch.findings import gel_thickness_mm, guessed_contact, impossible_depth, no_surface
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.benchmarks.real_sets import SETS
from tests.helpers.analytic_surfaces import gaussian
from tests.helpers.linear_sensor import linear_bundle, photograph
from tests.helpers.places import real
from tests.helpers.weighed import LAYER, force_files

NOISE = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)


def test_the_watch_says_it_at_once_and_no_longer_than_it_lasts(halved: Bundle) -> None:
    watch, path = SensorWatch(halved, thickness_mm=gel_thickness_mm(halved)), Reconstructor(halved)
    kinds = []
    for number, image in enumerate((NOISE[:240, :320], halved.reference.astype(np.uint8))):
        watch.note(path.reconstruct(CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number)))
        kinds.append([finding.kind for finding in watch.findings()])
    assert kinds == [["too_deep"], []]


@pytest.mark.parametrize(
    ("turned_rad", "kinds"), [(0.0, []), (0.3, []), (0.6, ["no_surface"]), (np.pi / 2, ["no_surface"])]
)
def test_slopes_that_contradict_each_other_are_said(tmp_path: Path, turned_rad: float, kinds: list[str]) -> None:
    # Slopes turned by an angle are those of a surface times its cosine; what is left goes round in circles.
    gx, gy = np.moveaxis(gaussian((240, 320), 30, (0, 0), height=9).gradient_map, 2, 0)
    cos, sin = np.cos(turned_rad), np.sin(turned_rad)
    slopes = np.stack([cos * gx - sin * gy, sin * gx + cos * gy], axis=2)
    bundle = linear_bundle(tmp_path / "b", (240, 320))
    frame = Reconstructor(bundle).reconstruct(photograph(slopes))
    frame = replace(frame, contact=replace(frame.contact, mask=np.hypot(gx, gy) > 0.1))
    assert [finding.kind for finding in no_surface(frame, bundle.pixel_size_mm)] == kinds
    for pixels, said in ((16, kinds), (15, [])):  # crumbs of noise are no contact
        crumbs = np.arange(gx.size).reshape(gx.shape) < pixels
        small = replace(frame, contact=replace(frame.contact, mask=crumbs))
        assert [finding.kind for finding in no_surface(small, bundle.pixel_size_mm)] == said


def test_each_frame_of_a_running_sensor_carries_it_by_the_gel_of_its_bundle(tmp_path: Path, synthetic: Bundle) -> None:
    write_png(tmp_path / "noise.png", NOISE)
    sensor = {"url": str(tmp_path / "noise.png"), "calibration": "synthetic"}
    with assembly.open_session(Settings.model_validate({"sensor": sensor}), every=True) as daemon:
        frame = daemon.wait_frame(-1, 30)
        assert frame.provenance.findings == ("too_deep",)
    plain = linear_bundle(tmp_path / "plain", (120, 160))
    weighed = extend_bundle(plain, tmp_path / "weighed", force_files())
    assert [gel_thickness_mm(bundle, 4.0) for bundle in (synthetic, weighed, plain)] == [5.0, LAYER.thickness_mm, 4.0]
    assert gel_thickness_mm(plain) is None


def test_a_contact_where_the_calibration_has_no_press_is_said_while_it_lasts(
    halved_scene: Scene, halved: Bundle, tmp_path: Path
) -> None:
    press = halved_scene.show(Press("BALL", 1.0, -6.0, 0.0))
    image = np.clip(press[0], 0, 255).astype(np.uint8)
    y, x = np.nonzero(press[1].contact)
    rows = np.zeros((len(x), 7), np.float32)
    rows[:, :3], rows[:, 3:5] = (image - halved.reference)[y, x], np.stack([x, y], axis=1)
    rows[:, 5] = 9.0
    for side, kinds in ((0, []), (150, ["not_learnt"])):
        content = io.BytesIO()
        np.savez(content, rows=rows + np.array([0, 0, 0, side, 0, 0, 0], np.float32))
        bundle = extend_bundle(halved, tmp_path / str(side), {"presses.npz": content.getvalue()})
        watch, path = SensorWatch(bundle), Reconstructor(bundle)
        watch.note(path.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0)))
        assert [finding.kind for finding in watch.findings()] == kinds
        at_rest = np.rint(bundle.reference).astype(np.uint8)
        watch.note(path.reconstruct(CameraFrame(image=at_rest, time_s=1.0, sequence=1)))
        assert not watch.findings()


@pytest.mark.parametrize("name", ["BALL", "PINS", pytest.param("PCONVEX", marks=pytest.mark.nightly)])
def test_the_deepest_presses_of_the_simulated_sensor_can_be(halved_scene: Scene, halved: Bundle, name: str) -> None:
    picture = np.clip(halved_scene.show(Press(name, 2.0, 3.0, -2.0))[0], 0, 255).astype(np.uint8)
    frame = Reconstructor(halved).reconstruct(CameraFrame(image=picture, time_s=0.0, sequence=0))
    assert frame.contact.indentation_mm > 1
    assert not [*impossible_depth(frame, gel_thickness_mm(halved)), *guessed_contact(frame)]


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("mini", marks=pytest.mark.real_images("gelsight_mini_ball")),
        pytest.param("digit", marks=pytest.mark.real_images("digit_ball")),
    ],
)
def test_every_press_of_a_real_sensor_can_be_by_its_own_bundle(tmp_path: Path, name: str) -> None:
    known = SETS[name](tmp_path)
    how = Learning(options=TrainingOptions(recipe="fast"))
    bundle = fit(known.presses[::2], known.reference, known.ball, tmp_path / "bundle", sensor=name, how=how)
    path = Reconstructor(bundle)
    frames = [
        path.reconstruct(CameraFrame(image=press.picture(), time_s=0.0, sequence=0)) for press in known.presses[:12]
    ]
    assert min(frame.contact.indentation_mm for frame in frames) > 0.1
    assert not [finding for frame in frames for finding in (*impossible_depth(frame, 5.0), *guessed_contact(frame))]
    unlike = [finding.text for frame in frames for finding in no_surface(frame, path.bundle.pixel_size_mm)]
    assert len(unlike) <= len(frames) // 20, unlike
    if name == "digit":  # a second picture of the untouched gel, of another day
        later = CameraFrame(image=read_image(real("digit_ball") / "background.png"), time_s=1.0, sequence=1)
        untouched = path.reconstruct(later)
        assert untouched.contact.area_mm2 == 0
        assert untouched.depth_mm.max() < 0.1  # 0.47 to 0.55 where only the median of the light is taken off


@pytest.mark.nightly
@pytest.mark.real_images("feelanyforce_drift")
@pytest.mark.real_images("gelslam_ball")
def test_light_that_drifts_on_an_untouched_sensor_is_no_surface(tmp_path: Path) -> None:
    """By the bundle of another unit of the kind: this one's presses nobody has."""
    pictures = [read_image(path) for path in sorted((real("feelanyforce_drift") / "pictures").glob("*.png"))]
    like = SETS["gelslam"](tmp_path)
    how = Learning(options=TrainingOptions(recipe="fast"))
    bundle = fit(like.presses, like.reference, like.ball, tmp_path / "bundle", sensor="like", how=how)
    begun = bundle.with_reference(np.mean(pictures[:2], axis=0, dtype=np.float32), frames=2)
    for followed, most_mm in ((False, 0.55), (True, 0.25)):
        watch, path, felt = SensorWatch(begun), Reconstructor(begun), list[float]()
        for number in range(4 * len(pictures)):  # each is looked at four times: the sensor gave one in 1.5 s
            picture = CameraFrame(image=pictures[number // 4], time_s=1.125 * number, sequence=number)
            frame = path.reconstruct(picture)
            watch.note(frame)
            if frame.contacts:
                felt.append(frame.contact.indentation_mm)
                assert [finding.kind for finding in no_surface(frame, bundle.pixel_size_mm)] == ["no_surface"]
            if followed and not watch.refusal(asked=False):
                zero = watch.propose_zero(asked=False)
                watch.accept_zero(zero)
                path = Reconstructor(begun.with_reference(zero.reference, frames=1))
        print(f"zero followed: {followed}; touched {len(felt) / 4:.0f} of {len(pictures)}, {max(felt):.2f} mm at most")
        assert max(felt) < most_mm
        if not followed:
            assert len(felt) > 2 * len(pictures)  # it is a drift that is felt, but said to be none
