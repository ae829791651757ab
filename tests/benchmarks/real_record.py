"""What was measured on real presses, by row, in tests/data/real_presses.json; and what is worse than that."""

import json
import statistics
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from gellight.base.writing import write_file
from tests.benchmarks.real_judging import Errors
from tests.helpers.places import CHECKOUT

RECORD = CHECKOUT / "tests/data/real_presses.json"
LEAST_SEEDS = 3
SPREADS = 3.0
"""standard deviations of the seeds: one in some hundreds of networks would be judged worse that is not"""
LEAST_SPREAD = 0.01
"""of a figure: another processor rounds otherwise"""

Measured = dict[str, Errors]
"""means over the presses held out, by judge"""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What was measured of one row."""

    seeds: Mapping[int, Measured]
    presses: int
    """that judged"""

    def figures(self, by: str, what: str) -> list[float]:
        """Return one figure by one judge, of each seed."""
        return [float(getattr(measured[by], what)) for measured in self.seeds.values() if by in measured]

    def limit(self, by: str, what: str) -> float:
        """Return the largest figure that is no worse than what was measured."""
        figures = self.figures(by, what)
        if len(figures) < LEAST_SEEDS:
            raise ValueError(f"{len(figures)} seeds tell no spread: record at least {LEAST_SEEDS}")
        mean = statistics.mean(figures)
        return mean + max(SPREADS * statistics.stdev(figures), LEAST_SPREAD * mean)


class Record:
    """The rows that were measured."""

    def __init__(self, path: Path = RECORD) -> None:
        """Read them; there are none where the file is not there."""
        self._path = path
        text = path.read_text() if path.exists() else "{}"
        self.rows = {name: _recorded(row) for name, row in json.loads(text).items()}

    def add(self, name: str, seed: int, measured: Measured, presses: int) -> None:
        """Keep what was measured of a row with a seed, and write all at once: what was measured before stays."""
        seeds = self.rows[name].seeds if name in self.rows else {}
        self.rows[name] = Recorded(seeds={**seeds, seed: measured}, presses=presses)
        rows = [f"{json.dumps(name)}: {json.dumps(_plain(row))}" for name, row in sorted(self.rows.items())]
        write_file(self._path, ("{\n" + ",\n".join(rows) + "\n}\n").encode())

    def has(self, name: str, seed: int) -> bool:
        """Say whether a row was measured with a seed."""
        return name in self.rows and seed in self.rows[name].seeds

    def forget(self, name: str) -> None:
        """Measure a row anew."""
        self.rows.pop(name, None)


def worse(name: str, measured: Measured, recorded: Recorded) -> list[str]:
    """Say in which figures a row is worse than recorded by more than the spread of its seeds."""
    return [
        f"{name}, {by}: {what} is {value:.4g}, worse than {limit:.4g}, which the record and its spread allow"
        for by, errors in measured.items()
        for what, value in asdict(errors).items()
        if what != "scale" and value > (limit := recorded.limit(by, what))
    ]


def _recorded(row: Mapping[str, Mapping[str, Mapping[str, list[float]]]]) -> Recorded:
    seeds = {int(seed): {by: Errors(*four) for by, four in one.items()} for seed, one in row["seeds"].items()}
    return Recorded(seeds=seeds, presses=row["presses"])  # type: ignore[arg-type]


def _plain(row: Recorded) -> dict[str, object]:
    seeds = {
        str(seed): {by: [round(value, 5) for value in asdict(errors).values()] for by, errors in one.items()}
        for seed, one in sorted(row.seeds.items())
    }
    return {"presses": row.presses, "seeds": seeds}
