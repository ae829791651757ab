"""Series of exposures of the simulated gel, and windows that slide, from pictures to depth; motion; the live error."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureSeries, LightLabel, LightState, TactileFrame
from gellight.lab.simulator.scene import Press
from gellight.photometric.light_model import LightGroups
from gellight.photometric.solver import LEAST_LIGHTS
from gellight.reconstruction.integration import angle_deg, normals
from gellight.series import window
from gellight.series.reconstructor import STAGES, PhotometricReconstructor
from gellight.series.window import WindowReconstructor
from sim_reference.view import seen_height_mm
from tests.helpers.simulated_gel import GROUPS, PIXEL_MM, RING, SMALL, Gel

BALL = Press("BALL", 1.0, 4.0, -3.0)


@pytest.fixture(scope="module")
def gel() -> Gel:
    return Gel(seed=11)


@pytest.fixture(scope="module")
def bundle(gel: Gel, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return gel.bundle(tmp_path_factory.mktemp("photometric") / "bundle")


@pytest.fixture(scope="module")
def paths(gel: Gel, bundle: Bundle) -> dict[LightGroups, PhotometricReconstructor]:
    model = gel.model(16)
    return {kind: PhotometricReconstructor(bundle, model, kind, smoothing_px=0) for kind in LightGroups}


def exposed(gel: Gel, kind: LightGroups, press: Press | list[Press | None] | None) -> ExposureSeries:
    """A series of three times the exposure of the lights."""
    gel.expose(3.0)
    series = gel.series(kind, press)
    gel.expose(1.0)
    return series


def errors(felt: TactileFrame, gel: Gel, press: Press | None) -> tuple[float, float]:
    """Mean normal error in contact, degrees, and of the depth there, mm; over everything without a contact."""
    _, surface = gel.scene.show(press)
    where = surface.contact if surface.contact.any() else np.ones_like(surface.contact)
    angle = angle_deg(felt.normal_map, normals(surface.gradient_map))
    return float(angle[where].mean()), float(np.abs(felt.depth_mm - surface.depth_mm)[where].mean())


@pytest.mark.parametrize("kind", LightGroups)
def test_a_ball_is_felt_as_it_is(
    gel: Gel, paths: dict[LightGroups, PhotometricReconstructor], kind: LightGroups
) -> None:
    felt = paths[kind].reconstruct(exposed(gel, kind, BALL))
    angle, depth = errors(felt, gel, BALL)
    assert angle < 0.5
    assert depth < 0.01
    assert felt.contact.indentation_mm == pytest.approx(1.0, abs=0.02)
    assert felt.contact.centroid_mm == pytest.approx((4.0, -3.0), abs=0.1)
    assert tuple(felt.stage_seconds) == STAGES
    assert felt.exposures is not None
    assert felt.exposures.exposures == {"triples": 4, "singles": 12}[kind]
    assert felt.depth_mm.dtype == felt.gradient_map.dtype == felt.normal_map.dtype == np.float32


@pytest.mark.nightly  # by day test_solver has the rows
def test_behind_a_window_a_ball_is_felt_from_the_height_of_the_camera_by_bent_light(tmp_path: Path) -> None:
    gel = Gel(seed=11, sensor=replace(SMALL, perspective=True, window=True))
    plain, model, kind = gel.bundle(tmp_path / "bundle"), gel.model(16), LightGroups.TRIPLES
    told = plain.manifest.model_copy(update={"camera_height_mm": seen_height_mm(gel.scene.geometry)})
    bent = replace(model, ring=replace(RING, window_mm=SMALL.window_mm))
    series, press = exposed(gel, kind, BALL), BALL
    path, blind = (
        PhotometricReconstructor(bundle, light, kind, smoothing_px=0)
        for bundle, light in ((replace(plain, manifest=told), bent), (plain, model))
    )
    angle, depth = errors(path.reconstruct(series), gel, press)
    assert angle < 0.6
    assert depth < 0.01
    assert errors(blind.reconstruct(series), gel, press)[0] > 5


def test_the_untouched_gel_is_flat(gel: Gel, paths: dict[LightGroups, PhotometricReconstructor]) -> None:
    felt = paths[LightGroups.TRIPLES].reconstruct(gel.series(LightGroups.TRIPLES, None))
    assert np.abs(felt.depth_mm).max() < 0.02
    assert felt.contact.area_mm2 == 0
    assert not felt.exposures.moved
    assert (felt.exposures.lights == 12).mean() > 0.99


def test_a_longer_exposure_than_that_of_the_lights_changes_nothing_but_noise(
    gel: Gel, paths: dict[LightGroups, PhotometricReconstructor]
) -> None:
    path = paths[LightGroups.TRIPLES]
    short = errors(path.reconstruct(gel.series(LightGroups.TRIPLES, BALL)), gel, BALL)[0]
    long = errors(path.reconstruct(exposed(gel, LightGroups.TRIPLES, BALL)), gel, BALL)[0]
    assert long < short / 2


def test_the_picture_is_that_of_the_whole_ring(gel: Gel, paths: dict[LightGroups, PhotometricReconstructor]) -> None:
    series = replace(exposed(gel, LightGroups.TRIPLES, BALL), exposure_us=24000.0)
    felt = paths[LightGroups.TRIPLES].reconstruct(series)
    whole = gel.picture(BALL, RING.colours).astype(float)
    assert np.abs(felt.camera_frame.image - whole).mean() < 1.5
    assert felt.camera_frame.light.max() == 85
    assert np.abs(felt.difference[:40]).mean() < 1.5, "nothing touches there"


def test_shadows_of_a_plate_are_left_out(gel: Gel, paths: dict[LightGroups, PhotometricReconstructor]) -> None:
    press = Press("CCONVEX", 0.8)
    path, series = paths[LightGroups.TRIPLES], exposed(gel, LightGroups.TRIPLES, press)
    felt = path.reconstruct(series)
    shadowed = felt.exposures.lights < 12
    assert 0.01 < shadowed.mean() < 0.6
    assert (felt.exposures.lights < LEAST_LIGHTS).mean() < 0.01
    truth = normals(gel.scene.show(press)[1].gradient_map)
    aware, blind = (
        angle_deg(result.normal_map, truth)[shadowed].mean() for result in (felt, _blind(path).reconstruct(series))
    )
    assert aware < 0.6 * blind


def _blind(path: PhotometricReconstructor) -> PhotometricReconstructor:
    """A copy that takes every signal for light."""
    from gellight.series import reconstructor

    class Blind(PhotometricReconstructor):
        def _refined(self, scaled, depth, signals):  # type: ignore[no-untyped-def]
            everything = replace(signals, valid=np.ones_like(signals.valid), deviation=signals.deviation * 1e6)
            return super()._refined(scaled, depth, everything)

    blind = object.__new__(Blind)
    blind.__dict__ = dict(path.__dict__)
    assert reconstructor.REFINEMENTS > 0
    return blind


@pytest.mark.parametrize("kind", LightGroups)
def test_a_scene_at_rest_is_never_called_moved(
    gel: Gel, paths: dict[LightGroups, PhotometricReconstructor], kind: LightGroups
) -> None:
    presses = [None, BALL, Press("BALL", 1.5, -7.0, 5.0), Press("TSTEP", 0.8), Press("SINWAVE", 0.8, 1.0)]
    reports = [paths[kind].reconstruct(exposed(gel, kind, press)).exposures for press in presses]
    assert not any(report is None or report.moved for report in reports), [r and r.as_json() for r in reports]


@pytest.mark.parametrize("kind", LightGroups)
def test_a_press_that_deepens_slides_or_returns_is_called_moved(
    gel: Gel, paths: dict[LightGroups, PhotometricReconstructor], kind: LightGroups
) -> None:
    count = len(RING.colours) if kind is LightGroups.SINGLES else 4
    half = count // 2
    deeper: list[Press | None] = [BALL] * half + [replace(BALL, depth_mm=1.1)] * (count + 1 - half)
    slides: list[Press | None] = [BALL] * half + [replace(BALL, x_mm=4.2)] * (count + 1 - half)
    returns: list[Press | None] = [BALL, None, *[BALL] * (count - 1)]
    reports = [paths[kind].reconstruct(exposed(gel, kind, one)).exposures for one in (deeper, slides, returns)]
    assert all(report is not None and report.moved for report in reports), [r and r.as_json() for r in reports]
    last = reports[-1]
    assert last.repetition_grey < last.repetition_limit_grey, "only the misfit can see what came back"
    assert not last.moving.any()
    assert last.misfit > 1


def test_motion_is_flagged_where_it_was_and_nowhere_else(
    gel: Gel, paths: dict[LightGroups, PhotometricReconstructor]
) -> None:
    there, gone = Press("BALL", 0.8, 10.0, -5.0), Press("BALL", 0.8, 10.5, -5.0)
    felt = paths[LightGroups.TRIPLES].reconstruct(exposed(gel, LightGroups.TRIPLES, [there] * 3 + [gone] * 2))
    moving = felt.exposures.moving
    rows, columns = np.nonzero(moving)
    assert moving.shape == felt.depth_mm.shape
    assert columns.min() > 160 + 40, "the left half and the middle rested"
    assert rows.max() < 160
    assert felt.exposures.as_json()["moving"] == pytest.approx(moving.mean(), abs=1e-5)
    assert moving[felt.contact.mask].mean() > 0.5


def test_one_picture_and_lights_of_another_size_are_refused(
    gel: Gel, bundle: Bundle, paths: dict[LightGroups, PhotometricReconstructor]
) -> None:
    series = gel.series(LightGroups.TRIPLES, None)
    with pytest.raises(InputError, match=r"test is one picture.*reconstruction.mode = network"):
        paths[LightGroups.TRIPLES].reconstruct(series.opening)
    with pytest.raises(ValueError, match="the lights are for"):
        PhotometricReconstructor(bundle, replace(gel.model(1), image_shape=(10, 10)), LightGroups.TRIPLES)


# ---- a window that slides: of each frame its exposures alone are new ----


TRIPLES = GROUPS[LightGroups.TRIPLES]


@pytest.fixture(scope="module")
def exposed_gel() -> Gel:
    exposed_gel = Gel(seed=12)
    exposed_gel.expose(2.0)
    return exposed_gel


@pytest.fixture(scope="module")
def window_bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return Gel(seed=13).bundle(tmp_path_factory.mktemp("window") / "bundle")


def windows(exposed_gel: Gel, presses: list[Press | None]) -> list[ExposureSeries]:
    """The windows of a sequence, one press a frame, from the fifth frame on."""
    frames = [
        CameraFrame(
            image=exposed_gel.picture(press, TRIPLES[n % 4]), time_s=n / 30, sequence=n, source="test",
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


def normal_error_deg(felt: TactileFrame, exposed_gel: Gel, press: Press) -> float:
    surface = exposed_gel.scene.show(press)[1]
    return float(angle_deg(felt.normal_map, normals(surface.gradient_map))[surface.contact].mean())


@pytest.mark.parametrize(("pixels", "worse"), [(100_000, 1.3), (1, 3.0)])
def test_a_ball_at_rest_is_felt_as_in_a_series(
    exposed_gel: Gel, window_bundle: Bundle, monkeypatch: pytest.MonkeyPatch, pixels: int, worse: float
) -> None:
    monkeypatch.setattr(window, "MOST_PIXELS", pixels)
    model = Gel(seed=14).model(16)
    path = WindowReconstructor(window_bundle, model, LightGroups.TRIPLES)
    felt = [path.reconstruct(each) for each in windows(exposed_gel, [BALL] * 8)]
    series = PhotometricReconstructor(window_bundle, model, LightGroups.TRIPLES).reconstruct(
        windows(exposed_gel, [BALL] * 5)[0]
    )
    errors = [normal_error_deg(each, exposed_gel, BALL) for each in felt]
    assert errors[0] > 1.5 * errors[1], "the first one knows nothing of the depth yet, so its light is that of flat gel"
    assert max(errors[1:]) < worse * normal_error_deg(series, exposed_gel, BALL)
    last = felt[-1]
    assert last.depth_mm.shape == window_bundle.image_shape
    assert last.contact.indentation_mm == pytest.approx(1.0, abs=0.02)
    assert last.contact.centroid_mm == pytest.approx((4.0, -3.0), abs=0.1)
    assert not last.exposures.moved
    assert last.exposures.lights.shape == last.exposures.moving.shape == window_bundle.image_shape
    assert last.camera_frame.label == LightLabel(state=LightState.CLEAN, group=3)
    assert last.camera_frame.sequence == 7
    whole = exposed_gel.picture(BALL, RING.colours // 2).astype(float)  # the exposure is twice that of the light model
    assert np.abs(last.camera_frame.image - whole).mean() < 3
    assert path.status()["mode"] == "photometric"


def test_only_the_new_frame_is_taken_apart(
    exposed_gel: Gel, window_bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = 0
    take_apart = window.group_signals

    def counted(*arguments):  # type: ignore[no-untyped-def]
        nonlocal count
        count += 1
        return take_apart(*arguments)

    monkeypatch.setattr(window, "group_signals", counted)
    path = WindowReconstructor(window_bundle, Gel(seed=14).model(4), LightGroups.TRIPLES)
    for each in windows(exposed_gel, [None] * 8):
        path.reconstruct(each)
    assert count == 4 + 3


def test_a_ball_that_slides_is_flagged_where_it_is(exposed_gel: Gel, window_bundle: Bundle) -> None:
    path = WindowReconstructor(window_bundle, Gel(seed=14).model(4), LightGroups.TRIPLES)
    slides: list[Press | None] = [replace(BALL, x_mm=4.0 + 0.2 * n) for n in range(6)]
    felt = [path.reconstruct(each) for each in windows(exposed_gel, [BALL] * 5 + slides)]
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
