"""`python -m tests.paper`: the study of heights, and parts of a sweep."""

import json
from pathlib import Path
from typing import Any

import pytest

from gellight.lab.simulator.sweep import SweepOptions, run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import fine
from tests.helpers.command_line import invoke
from tests.helpers.studies import setup
from tests.paper.__main__ import app
from tests.paper.heights import fine_json, fine_study


def study(*arguments: str) -> Any:
    result = invoke(*arguments, app=app, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_report_takes_shards_too(tmp_path: Path) -> None:
    # The 200th task is of the last study; it is computed although those of the other studies are missing.
    answer = study(
        "report", "--shard", "200/300", "--workers", "1", "--size", "32", "--out", str(tmp_path / "out"), "--json"
    )
    assert answer["complete"] is False
    assert len(list(Path(answer["store"]).iterdir())) == 1
    assert not list((tmp_path / "out").iterdir())


def test_the_fine_study_prints_json() -> None:
    answer = study("fine", "--size", "48", "--step", "12", "--workers", "1", "--json")
    assert answer["height_mm"] == [0, 12, 24, 36]
    assert len(answer["sat"]) == len(answer["nsd"]) == len(answer["normal_error_deg"]) == 4
    assert answer["nsd"] == sorted(answer["nsd"])
    assert answer["errors_deg"]["window"]["one exposure"]["mae"][3] is None


def test_the_light_of_a_height_is_told_as_a_share_of_that_of_the_first(options: SweepOptions) -> None:
    study = run_study(fine_study(setup(32, ("SCROWN",)), (0.0, 12.0, 24.0)), options)
    told = fine_json(study)["mean_light"]
    lights = [fine.illumination(fine.at_height(SensorGeometry(), height), fine.View()) for height in study.heights_mm]
    assert told == pytest.approx([one.mean / lights[0].mean for one in lights], abs=1e-5)
    assert told[0] == 1
    assert told[0] < told[1] < told[2], "the LEDs stand nearer to the gel"
