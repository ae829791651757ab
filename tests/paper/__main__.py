"""`python -m tests.paper [PIXELS]`: the paper's twenty statements about light, judged by the numbers (two minutes)."""

import sys

from gellight_design.studies import study_setup
from sim_reference.geometry import SensorGeometry
from tests.paper.statements import DEFAULTS, judgements

if __name__ == "__main__":
    judged = judgements(study_setup(SensorGeometry(), 0.9, 1.0, int(sys.argv[1]) if len(sys.argv) > 1 else 256))
    for claim, readings in judged.items():
        print(f"{claim}\n    {'; or '.join(readings) or 'under no reading'}")
    by_default = sum(any(reading in DEFAULTS for reading in readings) for readings in judged.values())
    print(f"{sum(map(bool, judged.values()))} of {len(judged)} hold, {by_default} under the reading of the defaults")
