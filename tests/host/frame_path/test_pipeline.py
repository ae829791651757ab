"""The whole frame path on a sensor whose answer is known in closed form."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.dashboard.messages import encode as page_message
from gellight.dashboard.view import ReferenceViews
from gellight.frame_path.pipeline import Reconstructor
from gellight.frame_path.sequence_path import SequencePath
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.reconstruction.integration import far_from_touch
from gellight.reconstruction.stages import STAGES
from tests.helpers.analytic_surfaces import gaussian, smooth_cap
from tests.helpers.linear_sensor import linear_bundle, photograph

SHAPE = (240, 320)
SIZE = 0.05


def angles_deg(normal_map: np.ndarray, gradient_map: np.ndarray) -> np.ndarray:
    gx, gy = gradient_map[..., 0], gradient_map[..., 1]
    true = np.stack([-gx, -gy, np.ones_like(gx)], axis=2)
    cross = np.linalg.norm(np.cross(normal_map, true), axis=2)
    return np.degrees(np.arctan2(cross, (normal_map * true).sum(axis=2)))


@pytest.mark.parametrize("masked", [True, False])
@pytest.mark.parametrize("place", [(10.3, -20.7), (150.0, 0.0)])
def test_a_pressed_bump_comes_back_in_mm(tmp_path: Path, masked: bool, place: tuple[float, float]) -> None:
    bump = gaussian(SHAPE, 18, place, height=16)
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE), masked=masked)
    frame = reconstructor.reconstruct(photograph(bump.gradient_map, noise_grey=1.0))
    assert np.abs(frame.depth_mm - bump.depth * SIZE).max() < 0.012
    assert frame.contact.indentation_mm == pytest.approx(16 * SIZE, abs=0.012)
    touched = bump.depth > 1
    assert angles_deg(frame.normal_map, bump.gradient_map)[touched].mean() < 0.4
    if place[0] < 100:
        assert frame.contact.centroid_mm == pytest.approx((place[0] * SIZE, place[1] * SIZE), abs=0.03)
        assert frame.contact.area_mm2 == pytest.approx(np.pi * (1.24 * 18 * SIZE) ** 2, rel=0.05)


def test_untouched_gel_is_exactly_flat_and_depth_zero_beside_a_touch_even_if_most_is_touched(tmp_path: Path) -> None:
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE))
    frame = reconstructor.reconstruct(photograph(np.zeros((*SHAPE, 2)), noise_grey=1.0))
    assert not frame.gradient_map.any()
    assert not frame.depth_mm.any()
    assert (frame.normal_map == [0, 0, 1]).all()
    assert frame.contact.area_mm2 == 0
    assert frame.contact.centroid_mm is None
    cap = smooth_cap(SHAPE, 290, (0, 0), height=40)
    assert (cap.depth > 0).mean() > 0.7
    frame = reconstructor.reconstruct(photograph(cap.gradient_map, noise_grey=1.0))
    assert np.abs(frame.depth_mm - cap.depth * SIZE).max() < 0.04
    assert np.abs(frame.depth_mm[cap.depth == 0]).max() < 0.02


def test_a_bulge_around_the_touch_does_not_shift_the_zero(tmp_path: Path) -> None:
    """Depth counts from the gel at rest far away, and not from the gel that was pushed up beside the object."""
    pressed, bulge = gaussian(SHAPE, 12, (-90, 60), height=12), gaussian(SHAPE, 45, (-90, 60), height=-0.6)
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE))
    frame = reconstructor.reconstruct(photograph(pressed.gradient_map + bulge.gradient_map, noise_grey=1.0))
    true_mm = (pressed.depth + bulge.depth) * SIZE
    assert np.abs(frame.depth_mm - true_mm).max() < 0.008
    assert frame.depth_mm.min() == pytest.approx(true_mm.min(), abs=0.003)


@pytest.mark.parametrize("shape", [(7, 9), (61, 83), (240, 320)])
def test_rest_is_the_far_quarter_of_the_untouched_view_and_always_a_part_of_it(shape: tuple[int, int]) -> None:
    touched = np.zeros((480, 640), np.bool_)
    touched[100:200, 0:160] = True
    far = far_from_touch(touched)
    assert 0.2 < far.mean() < 0.3
    assert far[:, 500:].all()
    assert not far[:, :400].any()
    rng = np.random.default_rng(0)
    for share in (0.0, 0.01, 0.5, 0.99, 1.0):
        touched = rng.uniform(size=shape) < share
        far = far_from_touch(touched)
        assert far.shape == shape
        assert not (far & touched).any()
        assert far.all() == (not touched.any())


def test_what_a_touch_encloses_is_not_at_rest() -> None:
    touched = np.zeros((240, 320), np.bool_)
    touched[40:200, 80:240] = True
    touched[56:184, 96:224] = False  # a square end, whose middle is farther from its walls than any other free pixel
    far = far_from_touch(touched)
    assert far.any()
    assert not far[56:184, 96:224].any()
    touched[:, :] = True
    touched[56:184, 96:224] = False  # nothing else is free: then it is the best that there is
    assert far_from_touch(touched)[100:140, 140:180].any()


@pytest.mark.parametrize("native", [True, False])
def test_a_flat_end_that_fills_the_view_is_felt_as_deep_as_it_is(tmp_path: Path, native: bool) -> None:
    rows, columns = np.indices(SHAPE)
    inside = 100 - np.maximum(np.abs(rows - 119.5), np.abs(columns - 159.5))
    depth = np.clip(inside, 0, 10) * 0.8
    slopes = np.stack(np.gradient(depth)[::-1], axis=2)
    frame = Reconstructor(linear_bundle(tmp_path / "b", SHAPE), native=native).reconstruct(photograph(slopes))
    assert frame.depth_mm[100:140, 140:180].mean() == pytest.approx(8 * SIZE, rel=0.05)
    assert np.abs(frame.depth_mm[:12]).max() < 0.02


def test_results_have_the_promised_types_and_stages(tmp_path: Path) -> None:
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE))
    camera_frame = photograph(gaussian(SHAPE, 18, (0, 0), height=9).gradient_map)
    frame = reconstructor.reconstruct(camera_frame)
    assert frame.camera_frame is camera_frame
    assert [(a.shape, a.dtype) for a in (frame.difference, frame.gradient_map, frame.normal_map, frame.depth_mm)] == [
        ((*SHAPE, 3), np.float32),
        ((*SHAPE, 2), np.float32),
        ((*SHAPE, 3), np.float32),
        (SHAPE, np.float32),
    ]
    assert tuple(frame.stage_seconds) == STAGES
    assert min(frame.stage_seconds.values()) > 0


def test_a_later_frame_changes_nothing_of_an_earlier_one(tmp_path: Path) -> None:
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE))
    first = reconstructor.reconstruct(photograph(gaussian(SHAPE, 18, (0, 0), height=9).gradient_map))
    arrays = (first.difference, first.gradient_map, first.normal_map, first.depth_mm, first.contact.mask)
    kept = [a.copy() for a in arrays]
    second = reconstructor.reconstruct(photograph(gaussian(SHAPE, 30, (40, 9), height=12).gradient_map))
    for array, copy in zip(arrays, kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    assert not any(np.shares_memory(a, b) for a in arrays for b in (second.depth_mm, second.gradient_map))


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (
            np.zeros((120, 160, 3), np.uint8),
            r"press\.png is 160 x 120 px, the calibration .* is for 320 x 240 px: set the camera to that size",
        ),
        (np.zeros((240, 320), np.uint8), r"press\.png is \(240, 320\) uint8: give \(H, W, 3\) uint8"),
        (np.zeros((240, 320, 4), np.uint8), r"\(240, 320, 4\)"),
        (np.zeros((240, 320, 3), np.float32), "float32"),
    ],
)
def test_an_image_of_another_size_or_type_is_refused(tmp_path: Path, image: np.ndarray, message: str) -> None:
    reconstructor = Reconstructor(linear_bundle(tmp_path / "b", SHAPE))
    with pytest.raises(InputError, match=message):
        reconstructor.reconstruct(CameraFrame(image=image, time_s=0, sequence=0, source="press.png"))


def test_an_unsteady_gel_gives_the_same_depth_as_a_steady_one(tmp_path: Path) -> None:
    """The gel at rest is no witness of a tilt: on real presses a plane through it makes depth worse."""
    bundle = linear_bundle(tmp_path / "b", SHAPE)
    slopes = gaussian(SHAPE, 12, (10, -5), height=9).gradient_map + np.array((0.006, -0.004), np.float32)
    depths = []
    for rest_grey in (0.4, 1.0):
        manifest = bundle.manifest.model_copy(update={"rest_grey": rest_grey})
        depths.append(Reconstructor(replace(bundle, manifest=manifest)).reconstruct(photograph(slopes)).depth_mm)
    assert np.abs(depths[0] - depths[1]).mean() < 0.003


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return load_bundle("synthetic")


@pytest.fixture(scope="module")
def path(bundle: Bundle) -> SequencePath:
    return SequencePath(Reconstructor(bundle), groups_of(bundle))


def groups_of(bundle: Bundle) -> np.ndarray:
    return np.stack([bundle.colours // 2, bundle.colours])


def frame(bundle: Bundle, label: LightLabel | None, **changes: Any) -> CameraFrame:
    image = np.clip(np.rint(bundle.reference), 0, 255).astype(np.uint8)
    light = groups_of(bundle)[label.group] if label and label.group is not None else None
    same = {"image": image, "time_s": 1.0, "sequence": 3, "source": "test", "label": label, "light": light}
    return CameraFrame(**{**same, **changes})


def test_under_the_light_of_the_calibration_there_is_depth(bundle: Bundle, path: SequencePath) -> None:
    felt = path.reconstruct(frame(bundle, LightLabel(state=LightState.CLEAN, group=1)))
    assert np.isfinite(felt.depth_mm).all()
    assert felt.contact.indentation_mm < 0.05
    assert path.status()["mode"] == "sequence"
    assert path.status()["groups_with_depth"] == [1]


@pytest.mark.parametrize(
    "label",
    [
        LightLabel(state=LightState.CLEAN, group=0),
        LightLabel(state=LightState.MIXED),
        LightLabel(state=LightState.UNKNOWN),
        None,
    ],
)
def test_under_any_other_light_nothing_is_said_of_the_depth(
    bundle: Bundle, path: SequencePath, label: LightLabel | None
) -> None:
    felt = path.reconstruct(frame(bundle, label))
    assert felt.camera_frame.label == label
    for array in (felt.depth_mm, felt.gradient_map, felt.normal_map):
        assert np.isnan(array).all()
    assert np.isnan([felt.contact.indentation_mm, felt.contact.area_mm2]).all()
    assert not felt.contact.mask.any()
    assert felt.contact.centroid_mm is None
    assert np.abs(felt.difference).max() <= 0.5
    with pytest.raises(InputError, match="64 x 48 px"):
        path.reconstruct(frame(bundle, label, image=np.zeros((48, 64, 3), np.uint8)))
    page_message(felt, pixel_size_mm=bundle.pixel_size_mm, references=ReferenceViews())
