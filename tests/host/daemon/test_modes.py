"""The modes as a user runs them, on the simulated sensor: board, ring, rolling shutter, exposure and all."""

import json

import numpy as np
import pytest

from gellight.base.errors import CameraError, ConfigError, GellightError
from gellight.base.settings import ReconstructionSettings, Settings, load_settings
from gellight.bundle.bundle import load_bundle
from gellight.daemon.active_pipeline import path_for
from gellight.daemon.assembly import open_session
from gellight.daemon.configuration import mode_config
from gellight.frame_path.sequence_path import SequencePath
from gellight.lab.training.synthetic import ball_presses
from sim_reference.geometry import AS_BUILT
from tests.benchmarks.photometric import Bench, object_presses
from tests.helpers.children import gellight

HELD = "sim://?object=BALL&depth=1.0&x=3&y=-2"


def test_the_photometric_demo_works_at_once_and_feels_the_ball() -> None:
    run = gellight("demo", "--set", "reconstruction.mode=photometric", "--frames", "2", "--json", "--sensor", HELD)
    assert run.returncode == 0, run.stderr
    status = json.loads(run.stdout.splitlines()[-1])
    assert status["mode"] == "photometric"
    assert status["exposures"]["exposures"] == 4
    assert status["exposures"]["moved"] is False
    assert status["lost"] == 0
    assert status["selfcheck"]["passed"], status["selfcheck"]
    assert status["selfcheck"]["contact_normal_error_deg"] < 0.3
    assert status["selfcheck"]["depth_error_mm"] < 0.005
    assert status["indentation_mm"] == pytest.approx(1.0, abs=0.02)


def test_a_camera_without_a_ring_says_how_to_go_on() -> None:
    settings = load_settings({"sensor.url": "sim://?board=0", "reconstruction.mode": "photometric"})
    with pytest.raises(CameraError, match="no light ring"):
        open_session(settings)


def test_an_unknown_mode_lists_the_modes() -> None:
    with pytest.raises(ConfigError, match="network, photometric"):
        load_settings({"reconstruction.mode": "magic"})


@pytest.mark.nightly
def test_a_second_look_under_other_lights_errs_by_little_more_than_half_as_much() -> None:
    """Over four balls; over twenty it is 0.54."""
    bench = Bench(load_bundle("synthetic"), 1.0, 31)
    rows = bench.measure("balls", list(ball_presses(AS_BUILT, 4, np.random.default_rng(8))))
    assert [row.exposures for row in rows] == [1, 4, 12, 4, 12]
    assert rows[0].over_network == 1.0
    assert rows[3].over_network < 0.6
    assert rows[4].over_network < 0.6
    assert rows[3].exposure_us == pytest.approx(25200, rel=0.02)


def test_the_bench_presses_every_object_once_and_needs_the_simulated_sensor(tmp_path) -> None:
    from tests.helpers.linear_sensor import linear_bundle

    presses = object_presses(np.random.default_rng(0))
    assert len({press.object_name for press in presses}) == 10
    with pytest.raises(GellightError, match="not of the simulated sensor"):
        Bench(linear_bundle(tmp_path / "b"), 1.0, 0)


@pytest.mark.parametrize("wanted", [True, False])
def test_the_settings_say_whether_cast_shadows_are_made_good(wanted: bool) -> None:
    settings = Settings(reconstruction=ReconstructionSettings(cast_shadows=wanted))
    bundle = load_bundle("synthetic")
    path = path_for(mode_config(bundle, settings), bundle)
    assert isinstance(path, SequencePath)
    assert path._network.cast_shadows is wanted
