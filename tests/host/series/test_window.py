"""Windows that slide over the frames of a sequence: nearly as good as a series, and a result with every frame."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureSeries, LightLabel, LightState, TactileFrame
from gellight.lab.simulator.scene import Press
from gellight.photometric.light_model import LightGroups
from gellight.reconstruction.integration import angle_deg, normals
from gellight.series import window
from gellight.series.reconstructor import PhotometricReconstructor
from gellight.series.window import WindowReconstructor
from tests.helpers.simulated_gel import GROUPS, PIXEL_MM, RING, Gel

BALL = Press("BALL", 1.0, 4.0, -3.0)
TRIPLES = GROUPS[LightGroups.TRIPLES]


@pytest.fixture(scope="module")
def gel() -> Gel:
    gel = Gel(seed=12)
    gel.expose(2.0)
    return gel


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return Gel(seed=13).bundle(tmp_path_factory.mktemp("window") / "bundle")


def windows(gel: Gel, presses: list[Press | None]) -> list[ExposureSeries]:
    """The windows of a sequence, one press a frame, from the fifth frame on."""
    frames = [
        CameraFrame(
            image=gel.picture(press, TRIPLES[n % 4]), time_s=n / 30, sequence=n, source="test",
            label=LightLabel(state=LightState.CLEAN, group=n % 4),
        )
        for n, press in enumerate(presses)
    ]  # fmt: skip
    return [
        ExposureSeries(
            **vars(frames[n]), groups=TRIPLES, frames=tuple((frames[n - (n - k) % 4],) for k in range(4)),
            opening=frames[n - 4], closing=frames[n], exposure_us=16000.0,
        )
        for n in range(4, len(frames))
    ]  # fmt: skip


def normal_error_deg(felt: TactileFrame, gel: Gel, press: Press) -> float:
    surface = gel.scene.show(press)[1]
    return float(angle_deg(felt.normal_map, normals(surface.gradient_map))[surface.contact].mean())


@pytest.mark.parametrize(("pixels", "worse"), [(100_000, 1.3), (1, 3.0)])
def test_a_ball_at_rest_is_felt_as_in_a_series(
    gel: Gel, bundle: Bundle, monkeypatch: pytest.MonkeyPatch, pixels: int, worse: float
) -> None:
    monkeypatch.setattr(window, "MOST_PIXELS", pixels)
    model = Gel(seed=14).model(16)
    path = WindowReconstructor(bundle, model, LightGroups.TRIPLES)
    felt = [path.reconstruct(each) for each in windows(gel, [BALL] * 8)]
    series = PhotometricReconstructor(bundle, model, LightGroups.TRIPLES).reconstruct(windows(gel, [BALL] * 5)[0])
    errors = [normal_error_deg(each, gel, BALL) for each in felt]
    assert errors[0] > 1.5 * errors[1], "the first one knows nothing of the depth yet, so its light is that of flat gel"
    assert max(errors[1:]) < worse * normal_error_deg(series, gel, BALL)
    last = felt[-1]
    assert last.depth_mm.shape == bundle.image_shape
    assert last.contact.indentation_mm == pytest.approx(1.0, abs=0.02)
    assert last.contact.centroid_mm == pytest.approx((4.0, -3.0), abs=0.1)
    assert not last.exposures.moved
    assert last.exposures.lights.shape == last.exposures.moving.shape == bundle.image_shape
    assert last.camera_frame.label == LightLabel(state=LightState.CLEAN, group=3)
    assert last.camera_frame.sequence == 7
    whole = gel.picture(BALL, RING.colours // 2).astype(float)  # the exposure is twice that of the light model
    assert np.abs(last.camera_frame.image - whole).mean() < 3
    assert path.status()["mode"] == "photometric"


def test_only_the_new_frame_is_taken_apart(gel: Gel, bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    count = 0
    take_apart = window.group_signals

    def counted(*arguments):  # type: ignore[no-untyped-def]
        nonlocal count
        count += 1
        return take_apart(*arguments)

    monkeypatch.setattr(window, "group_signals", counted)
    path = WindowReconstructor(bundle, Gel(seed=14).model(4), LightGroups.TRIPLES)
    for each in windows(gel, [None] * 8):
        path.reconstruct(each)
    assert count == 4 + 3


def test_a_ball_that_slides_is_flagged_where_it_is(gel: Gel, bundle: Bundle) -> None:
    path = WindowReconstructor(bundle, Gel(seed=14).model(4), LightGroups.TRIPLES)
    slides: list[Press | None] = [replace(BALL, x_mm=4.0 + 0.2 * n) for n in range(6)]
    felt = [path.reconstruct(each) for each in windows(gel, [BALL] * 5 + slides)]
    before, after = felt[0].exposures, felt[-1].exposures
    assert not before.moving.any()
    assert after.moved
    assert after.moving[felt[-1].contact.mask].mean() > 0.5
    assert not after.moving[:, :60].any()


def test_a_picture_of_odd_size_is_solved_pixel_by_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window, "MOST_PIXELS", 1)
    odd = replace(Gel(seed=14).model(1), image_shape=(239, 321))
    told = SimpleNamespace(camera_height_mm=0.0)
    other: Any = SimpleNamespace(image_shape=(239, 321), pixel_size_mm=PIXEL_MM, files={}, manifest=told)
    path = WindowReconstructor(other, odd, LightGroups.TRIPLES)
    assert path._shape == (239, 321)
