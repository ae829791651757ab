"""Errors on balls pressed into the simulated sensor: `python -m tests.benchmarks.presses [BUNDLE]`.

The 4 mm ball 1, 1.5 and 2 mm deep at 20 random places, with noise of 1 grey level; a line a figure, a column a depth.
"""

import sys
from dataclasses import asdict

from gellight.bundle.bundle import load_bundle
from gellight.lab.training.synthetic import evaluate_simulated
from tests.helpers.pixel_bound import bound_on_balls_deg

DEPTHS_MM = (1.0, 1.5, 2.0)


def main(source: str = "synthetic", presses: int = 20) -> None:
    bundle = load_bundle(source)
    columns = [
        asdict(evaluate_simulated(bundle, presses=presses, depth_mm=depth))
        | {"pixel_bound_deg": bound_on_balls_deg(presses, depth)}
        for depth in DEPTHS_MM
    ]
    for name in columns[0]:
        print(f"{name:26}" + "".join(f"{column[name]:10.4g}" for column in columns))


if __name__ == "__main__":
    main(*sys.argv[1:2])
