"""`python -m tests.soak`: hours of faults on a simulated sensor, with every check that what it gives is right.

run.py         the soak: faults, recoveries, the report
faults.py      what goes wrong, drawn from a seed, and how it is done to the sensor
hardware.py    the sensor: cameras in a simulated kernel, a bus made of files, a simulated board and its serial line
labelling.py   the same faults on virtual time, where labels can be judged
shift.py       a daemon with recording and subscriber; reader.py and holder.py are programs to be killed
working.py     who calibrates meanwhile; pressed_gel.py: what the sensor looks at
judging.py     what has to hold; memory and handles
"""

import argparse
import json
import logging
import sys
from dataclasses import asdict
from functools import partial

from gellight.base.errors import InputError
from tests.soak.faults import plan
from tests.soak.judging import Invariant, one_arena
from tests.soak.labelling import Labelling
from tests.soak.run import Report, labels, soak
from tests.soak.working import Work


def main() -> int:
    """Run a simulated sensor through the faults of a seed; return 1 where something did not hold or was not judged."""
    parser = argparse.ArgumentParser("python -m tests.soak", description="Quiet time between faults is cut short.")
    parser.add_argument("--hours", type=float, default=8.0, help="simulated hours, about a fault a minute")
    parser.add_argument("--faults", type=int, default=1, metavar="SEED", help="seed that the faults are drawn from")
    parser.add_argument("--labels", action="store_true", help="judge labels of light alone, on virtual time")
    parser.add_argument("--json", action="store_true", help="print all that was found")
    options = parser.parse_args()
    one_arena()
    logging.getLogger("gellight").setLevel(logging.CRITICAL)  # faults are what is made here
    note = partial(print, file=sys.stderr, flush=True)
    if options.labels:
        return labels_alone(labels(options.faults, plan(options.faults, options.hours), note))
    try:
        report = soak(options.faults, options.hours, note)
    except InputError as error:
        parser.error(str(error))
    print(json.dumps(asdict(report), indent=2) if options.json else table(report))
    return 0 if report.passed else 1


def labels_alone(found: Labelling) -> int:
    """Print what was found of labels; return 1 where one was wrong or none was given."""
    judge = found.judge
    print(f"{judge.labels} of {judge.frames} frames were called clean through {found.faults} faults, "
          f"{len(judge.violations)} violations; again within {found.slowest_s:.2f} s")  # fmt: skip
    print("\n".join(f"{one.invariant}: {one.text}" for one in judge.violations), end="")
    return 0 if judge.labels and not judge.violations else 1


def table(report: Report) -> str:
    lines = [
        f"{report.simulated_s / 3600:.2f} simulated hours in {report.wall_s / 60:.1f} min, seed {report.seed}: "
        f"{report.frames} frames, {report.labels} light labels judged, "
        f"given again within {report.slowest_label_s:.2f} s",
        f"memory: {report.memory_growth_mb:+.1f} MB from the third to the last quarter",
        _worked(report.work),
        f"{'fault':20}{'count':>6}{'worst recovery':>17}",
    ]
    lines += [f"{kind:20}{one.count:6d}{one.worst_recovery_s:15.2f} s" for kind, one in sorted(report.faults.items())]
    lines += [f"broken after {one.at_s:.1f} s: {one.invariant}: {one.text}" for one in report.violations]
    lines += [f"not judged: {invariant}" for invariant in report.not_judged]
    return "\n".join([*lines, "everything held" if report.passed else _failed(report)])


def _worked(work: Work) -> str:
    return (
        f"calibrated: {work.calibrations} times, {work.judged_bad} judged bad, {work.taken_up} times gone on with; "
        f"{work.circles} circles, {work.worst_circle_px:.2f} px off at most"
    )


def _failed(report: Report) -> str:
    told = f"{len(report.violations)} violations, {len(report.not_judged)} of {len(Invariant)} not judged"
    return f"{told}: a longer run on an idle machine judges more" if report.not_judged else told


if __name__ == "__main__":
    sys.exit(main())
