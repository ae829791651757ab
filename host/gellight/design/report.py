"""The report: one page that holds every figure, every table and the comparison with the paper, and the parts."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from gellight.design import designs
from gellight.design.all_studies import AllResults
from gellight.design.output import write_all
from gellight.design.page import page


def write_report(results: AllResults, folder: Path) -> Path:
    """Write report.html and the parts of the given ring and of the chosen one into `folder`; return the page's path.

    Raises InputError if that is impossible.
    """
    for name, geometry in (("given", results.setup.geometry), ("chosen", results.chosen_sensor)):
        write_all(folder / name, designs.parts_of(geometry))
    return write_all(folder, {"report.html": page(results)})[0]


def report_json(results: AllResults, path: Path) -> dict[str, Any]:
    """Return the path of the page, and its statements, gains and designs."""
    return {
        "report": str(path),
        "statements": [asdict(statement) for statement in results.statements()],
        "gains": [designs.gain_json(gain) for gain in results.gains()],
        "given": designs.candidate_json(results.given),
        "chosen": designs.candidate_json(results.chosen),
    }


def report_text(results: AllResults, path: Path) -> str:
    """Return the path of the page, the statements that are not reproduced and the gains as lines of text."""
    rows = results.statements()
    held = sum(row.reproduced for row in rows)
    return "\n".join(
        [
            str(path),
            f"{held} of {len(rows)} statements of the paper reproduced; not reproduced:",
            *(f"  {row.claim}: {row.measured}" for row in rows if not row.reproduced),
            "what each step beyond the paper gains in Top1:",
            *(f"  {gain.in_words()}" for gain in results.gains()),
        ]
    )
