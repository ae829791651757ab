"""The errors from which the bounds of the self-check are made: `python -m tests.benchmarks.selfcheck_bounds`.

Each object is pressed to each depth of a grid at the places below, one frame each, and measured with the shipped
bundle. Printed are the worst errors of each object and depth, as `tests/helpers/selfcheck.py` holds them.
"""

import json
import sys

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.lab.simulator.simulated_camera import open_simulated
from tests.helpers.selfcheck import KINDS, SelfCheck

DEPTHS_MM = (0.4, 0.8, 1.2, 1.6, 2.0)
PLACES_MM = ((0.0, 0.0), (-10.0, 6.0), (10.0, -6.0))


def main() -> None:
    """Print the table as JSON: object, depth, worst errors in the order of `KINDS`."""
    bundle = load_bundle("synthetic")
    reconstructor = Reconstructor(bundle)
    table: dict[str, dict[float, list[float]]] = {}
    with open_simulated("sim://?programme=0&fps=1000") as camera:
        judge = SelfCheck(camera, bundle.pixel_size_mm)
        for name in camera.stage.objects:
            table[name] = {}
            for depth in DEPTHS_MM:
                results = []
                for x, y in PLACES_MM:
                    camera.stage.press(name, depth, x, y)
                    results.append(judge.compare(reconstructor.reconstruct(camera.read())))
                table[name][depth] = [round(max(getattr(r, kind) for r in results), 4) for kind in KINDS]
                print(name, depth, table[name][depth], file=sys.stderr, flush=True)
    print(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
