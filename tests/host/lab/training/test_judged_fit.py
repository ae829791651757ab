"""A calibration that tells its errors: nine in ten pixels keep the bound; and the polynomials that tell them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.stats import spearmanr

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.lab.training import judged_fit
from gellight.lab.training.judged_fit import Samples, fit_errors, fit_judged, in_parts
from gellight.lab.training.polynomial import powers_up_to, terms_of
from gellight.lab.training.presses import Ball, Press, contact_circle, sphere_gradient
from gellight.lab.training.skirts import Skirts
from gellight.lab.training.training import Learning, Reference, TrainingOptions
from gellight.reconstruction.error_bounds import DEG_FLOOR, MM_FLOOR, ErrorRecord, quadratic
from tests.helpers.linear_sensor import GREY_PER_SLOPE

RANDOM = np.random.default_rng(3)
SHAPE, BALL = (48, 64), Ball(radius_mm=4.0, pixel_size_mm=0.2)
SHORT = Learning(options=TrainingOptions(epochs=1, width=4))


def pressed(count: int) -> list[Samples]:
    """Presses whose errors grow with the slope and towards the rim, each off by a factor of its own."""
    found = []
    for _ in range(count):
        signs = RANDOM.uniform([0, 0, -0.2], [1.2, 1, 1], (800, 3))
        size = np.exp(1.5 * signs[:, 0] - signs[:, 2] + 0.05 * RANDOM.standard_normal())
        deg, mm = (scale * size * np.abs(RANDOM.standard_normal(800)) for scale in (2.0, 0.02))
        found.append(Samples(signs=signs, normal_deg=deg, shape_mm=mm))
    return found


def bounds_of(record: ErrorRecord, samples: Sequence[Samples]) -> tuple[np.ndarray, np.ndarray]:
    terms = quadratic(np.clip(np.concatenate([one.signs for one in samples]), record.least, record.most))
    deg, mm = (np.exp(terms @ np.array(weights)) for weights in (record.normal_weights, record.shape_weights))
    return deg - DEG_FLOOR, mm - MM_FLOOR


@pytest.mark.parametrize("count", [10, 30])
def test_nine_in_ten_pixels_of_other_presses_keep_the_bound(count: int) -> None:
    record, judges = fit_errors(pressed(count)), pressed(200)
    for bound, name in zip(bounds_of(record, judges), ("normal_deg", "shape_mm"), strict=True):
        error = np.concatenate([getattr(one, name) for one in judges])
        assert np.mean(error <= bound) == pytest.approx(0.9, abs=0.02)
        by_bound = [error[part].mean() for part in np.array_split(np.argsort(bound), 10)]
        assert (np.diff(by_bound) > 0).all()
        assert spearmanr(bound, error)[0] > 0.3


def kept(count: int, folder: Path) -> Bundle:
    """Of balls pressed into a sensor whose colours are linear in the slope."""
    presses = []
    for number in range(count):
        x, y = RANDOM.uniform((16, 16), (48, 32)).round().tolist()
        press = Press(image=folder / f"{number}.png", center_x_px=x, center_y_px=y, contact_radius_px=11.0)
        slope = np.where(contact_circle(press, SHAPE)[..., None], sphere_gradient(press, BALL, SHAPE), 0.0)
        cv2.imwrite(str(press.image), np.clip(120 + slope @ GREY_PER_SLOPE.T, 0, 255).astype(np.uint8)[..., ::-1])
        presses.append(press)
    reference = Reference(image=np.full((*SHAPE, 3), 120, np.float32), frames=1, noise_grey=1.0)
    return fit_judged(presses, reference, BALL, folder / "bundle", sensor="S", how=SHORT)


def test_each_press_is_judged_once_and_the_bundle_says_how(tmp_path: Path) -> None:
    bundle = kept(4, tmp_path)
    judged, record = bundle.metrics["held_out"], ErrorRecord.in_bundle(bundle)
    assert (judged["folds"], judged["presses"]) == (3, 4)
    assert 0 < judged["normal_error_deg"]["mean"] < 90
    assert record.presses == 4
    assert bundle.metrics["training"]["images"] == 4, "what is kept learns from all"


def test_of_one_press_nobody_knows_the_error(tmp_path: Path) -> None:
    bundle = kept(1, tmp_path)
    assert "held_out" not in bundle.metrics
    assert ErrorRecord.in_bundle(bundle) is None


def samples(*shape_mm: float) -> list[Samples]:
    return [Samples(signs=np.zeros((9, 3)), normal_deg=np.ones(9), shape_mm=np.full(9, mm)) for mm in shape_mm]


@pytest.mark.parametrize(
    ("tilted", "level", "better"),
    [
        ([0.1] * 4, [0.05] * 4, True),
        ([0.1] * 4, [0.095] * 4, False),  # too little
        ([0.1, 0.1, 0.1, 0.5], [0.11, 0.11, 0.11, 0.1], False),  # one press alone
        ([0.1] * 3, [0.05] * 3, False),  # too few
        ([], [], False),
    ],
)
def test_the_plane_is_taken_off_where_presses_held_out_are_clearly_better(
    tilted: list[float], level: list[float], better: bool
) -> None:
    one, other = (judged_fit.Found(level_plane=plane) for plane in (False, True))
    one.samples, other.samples = samples(*tilted), samples(*level)
    assert other.better_than(one) is better


@pytest.mark.parametrize("better", [False, True])
def test_the_bundle_remembers_the_plane(better: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judged_fit.Found, "better_than", lambda *_: better)
    bundle = kept(2, tmp_path)
    assert bundle.manifest.level_plane is better
    assert set(bundle.metrics["held_out"]["depth_mm"]) == {"as_integrated", "without_the_plane_at_rest"}


def test_the_bundle_remembers_the_share_and_feels_by_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judged_fit, "find_skirts", lambda errors_at: Skirts(0.2, errors_at(0.2), 1.76))
    bundle = kept(3, tmp_path)
    assert bundle.manifest.skirt_share == 0.2
    assert bundle.metrics["held_out"]["skirts"] == {"share": 0.2, "felt_with_all": 1.76}
    frame = CameraFrame(image=read_image(tmp_path / "0.png"), time_s=0.0, sequence=0, source="")
    all_of_it = replace(bundle, manifest=bundle.manifest.model_copy(update={"skirt_share": 1.0}))
    shares = [Reconstructor(one).reconstruct(frame) for one in (bundle, all_of_it)]
    assert np.array_equal(shares[0].contact.mask, shares[1].contact.mask)
    assert not np.array_equal(shares[0].depth_mm, shares[1].depth_mm)


def test_several_trainings_are_reported_as_one() -> None:
    told: list[tuple[int, int]] = []
    report = in_parts(lambda epoch, epochs, loss: told.append((epoch, epochs)), 3)
    for epochs in (4, 4, 2):
        for epoch in range(1, epochs + 1):
            report(epoch, epochs, 0.0)
    assert [epoch for epoch, _ in told] == [1, 2, 3, 4, 5, 6, 7, 8, 10, 12]
    assert {epochs for _, epochs in told} == {12}


def test_the_terms_are_all_products_up_to_the_degree_or_some_in_any_order_without_their_parts() -> None:
    x, y = np.random.default_rng(0).normal(size=(2, 20))
    assert sorted(powers_up_to(3, 2)) == sorted((i, j) for i in range(4) for j in range(4 - i))
    for powers in (powers_up_to(3, 2), [(2, 1), (0, 1)]):
        np.testing.assert_allclose(terms_of([x, y], powers), np.stack([x**i * y**j for i, j in powers], axis=1))
