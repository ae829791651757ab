"""The statements of the paper are judged by the numbers."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gellight_design import output, studies
from gellight_design.sweep import run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import BENCHMARK_NAMES, ObjectParameters
from sim_reference.optimizer import near_field
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.studies import own_cache, setup
from tests.paper import statements
from tests.paper.heights import ANY_ESTIMATE, LEAST_SQUARES, least_error, mean_errors_deg
from tests.paper.statements import BEST_ANGLE, COARSE, DEFAULTS, STEEPEST

__all__ = ["own_cache"]


@pytest.mark.nightly
def test_all_but_two_statements_of_the_paper_hold_under_a_reading() -> None:
    """At a quarter of the pixels; `python -m tests.paper` judges at 256 x 256, where the first of the two holds."""
    given = studies.study_setup(SensorGeometry(), 0.9, 1.0, 128)
    readings = statements.coarse_readings(given)
    judged = statements.coarse_judgements(readings) | statements.fine_judgements(given) | statements.ball_judgements()
    assert len(judged) == 20
    assert [claim for claim, holds_under in judged.items() if not holds_under] == [
        "SCROWN and SINWAVE have a large blue region",
        STEEPEST,
    ]
    assert sum(any(reading in DEFAULTS for reading in holds_under) for holds_under in judged.values()) == 10
    noisy, plain, prisms = (readings[name] for name in (DEFAULTS[0], "no noise", "no noise; CCONVEX as prisms"))
    assert np.degrees(plain.mean_best_angle_rad()) == pytest.approx(32.2)
    assert np.degrees(noisy.best_angle_rad()) == pytest.approx(29)
    assert statements.nearest_step_deg(noisy) == 37, "34.6° is nearer to 37° than to 29°"
    assert statements.nearest_step_deg(plain) == 29
    others = [name != "CCONVEX" for name in BENCHMARK_NAMES]
    np.testing.assert_array_equal(plain.errors_rad[others], prisms.errors_rad[others])
    assert (plain.errors_rad != prisms.errors_rad).any()


BASE = setup(48)
OF_THE_LIGHT: list[dict[str, Any]] = [
    *({"noise_grey": grey} for grey in (0.0, 0.5, 2.0, 4.0, 8.0)),
    {"cast_shadows": False},
    {"full_scale_grey": 160.0},
]
OF_THE_SURFACE = [
    *(replace(BASE, sampling=replace(BASE.sampling, press_depth_mm=depth)) for depth in (0.5, 0.7, 1.0)),
    *(
        replace(
            BASE,
            parameters=ObjectParameters(relief_mm=relief),
            sampling=replace(BASE.sampling, press_depth_mm=0.9 * relief),
        )
        for relief in (0.5, 1.5)
    ),
    *(replace(BASE, geometry=replace(BASE.geometry, coating_smoothing_mm=width)) for width in (0.0, 0.2, 0.3)),
    replace(BASE, parameters=ObjectParameters(wavelength_mm=3.5)),
]


@pytest.mark.nightly
def test_the_best_angle_depends_on_the_surface_and_hardly_on_the_light() -> None:
    """Twenty-nine degrees is the answer for surfaces with slopes of some sixty degrees, not a law of nature."""
    chosen = LightGroups(numbers=(CHOSEN_NUMBER,))
    light = [(BASE, replace(chosen, **changed)) for changed in OF_THE_LIGHT]
    surface = [(changed, chosen) for changed in OF_THE_SURFACE]
    best = [
        [np.degrees(run_study(studies.coarse_study(*varied)).best_angle_rad()) for varied in kind]
        for kind in (light, surface)
    ]
    assert np.ptp(best[0]) < 9 < 20 < np.ptp(best[1])


def test_the_window_leaves_no_room_for_leds_further_down() -> None:
    errors = mean_errors_deg(setup(32, ("SCROWN",)), (0.0, 12.0, 24.0, 36.0))
    assert np.isfinite(errors["air"][LEAST_SQUARES]).all()
    assert np.isfinite(errors["window"][ANY_ESTIMATE]).tolist() == [True, True, True, False]


def test_a_beam_as_the_papers_is_one_reading_and_not_two() -> None:
    assert len(statements.fine_readings(SensorGeometry())) == 6
    readings = statements.fine_readings(SensorGeometry(beam_angle_rad=np.radians(160)))
    assert [reading.split("; ")[1] for reading in readings] == ["beam of 160°"] * 3


def level() -> CoarseResult:
    errors = np.tile(np.radians(np.linspace(1, 60, 77)).reshape(1, 7, 11, 1), (10, 1, 1, 3))
    return CoarseResult(BENCHMARK_NAMES, LightGroups(), errors)


def test_objects_that_are_level_are_among_the_first_alike() -> None:
    assert COARSE["SCROWN and SINWAVE have a large blue region"](level())
    assert not COARSE["a simple form with a sharp step, TSTEP, has a large error"](level())


def test_the_best_angle_is_said_to_be_tuned_where_it_is_given() -> None:
    assert output.coarse_json(level())["best_angle_is"].startswith("tuned")
    text = output.coarse_text(level())
    assert re.search(r"best angle with 12 lights: \d+ degrees \(tuned: the measures of the objects", text)


def test_a_statement_that_does_not_hold_is_not_reproduced() -> None:
    result = run_study(studies.coarse_study(setup(48), LightGroups()))
    assert COARSE[BEST_ANGLE](result)
    assert not COARSE[BEST_ANGLE](replace(result, errors_rad=result.errors_rad[:, :, ::-1]))


def plane() -> near_field.Scene:
    return near_field.Scene("plane", 0, np.array([[0.0, 0.0, 1.0]]), np.full((near_field.HORIZONS, 1), -np.inf))


def test_the_least_error_is_that_of_the_noise_where_there_is_no_shadow() -> None:
    # A plane under n even lights: each slope has the standard deviation sd / G sqrt(2 / n) / sin(phi), two slopes twice
    # its square.
    count, angle = 12, np.radians(29)
    turns = 2 * np.pi * np.arange(count) / count
    vectors = np.stack([np.sin(angle) * np.cos(turns), np.sin(angle) * np.sin(turns), np.full(count, np.cos(angle))], 1)
    ring = near_field.Ring(vectors[:, None, :], turns[:, None] % (2 * np.pi), np.full((count, 1), 1 / np.tan(angle)))
    camera = LightGroups(noise_grey=2.0)
    mae, _, top1 = least_error(plane(), ring, np.eye(count), camera, gain=1.0)
    s = np.sqrt(4 + 1 / 12) / camera.full_scale_grey * np.sqrt(2 / count) / np.sin(angle)
    assert mae == top1 == pytest.approx(np.sqrt(2) * s)


def test_a_point_that_two_colours_do_not_reach_has_no_least_error() -> None:
    ring = near_field.Ring(np.array([[[0.5, 0.0, 0.5]]]), np.zeros((1, 1)), np.ones((1, 1)))
    assert least_error(plane(), ring, np.eye(1), LightGroups(), gain=1.0)[0] == pytest.approx(np.pi / 2)
