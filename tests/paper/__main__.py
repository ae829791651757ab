"""`python -m tests.paper [PIXELS]`: the paper's twenty statements about light, judged by the numbers (two minutes)."""

import argparse

from gellight_design.studies import study_setup
from gellight_design.sweep import run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import fine
from sim_reference.optimizer.coarse import CoarseResult
from sim_reference.optimizer.exposing import LightGroups
from tests.paper.comparison import Judgement, ball_judgements, fine_judgements, summary
from tests.paper.comparison_coarse import coarse_judgements
from tests.paper.heights import FineResult, fine_study
from tests.paper.variants import coarse_readings


def judgements(readings: dict[str, CoarseResult], heights: FineResult, geometry: SensorGeometry) -> list[Judgement]:
    """Return the paper, line by line, each line under its readings."""
    return [*coarse_judgements(readings), *fine_judgements(heights, geometry), *ball_judgements()]


def main() -> None:
    """Judge each statement, and print what was measured and under which readings it holds."""
    parser = argparse.ArgumentParser(prog="python -m tests.paper", description=__doc__)
    parser.add_argument("pixels", type=int, nargs="?", default=256)
    setup = study_setup(SensorGeometry(), 0.9, 1.0, parser.parse_args().pixels)
    readings = run_study(coarse_readings(setup, LightGroups()))
    rows = judgements(readings, run_study(fine_study(setup, fine.HEIGHTS_MM)), setup.geometry)
    for row in rows:
        one, under = row.best, "; or ".join(row.holds_under)
        print(f"{one.section} {one.claim}: {one.measured}\n    {under or f'under no reading: {one.why}'}")
    print(summary(rows))


if __name__ == "__main__":
    main()
