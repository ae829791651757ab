"""The report: one page that holds every figure, every table and the comparison with the paper, and the parts."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from gellight.design import answers, designs
from gellight.design.findings import Findings
from gellight.design.page import page


def write_report(found: Findings, folder: Path) -> Path:
    """Write report.html and the parts of the given ring and of the chosen one into `folder`; return the page's path.

    Raises InputError if that is impossible.
    """
    for name, geometry in (("given", found.subject.geometry), ("chosen", found.chosen_sensor)):
        answers.write_all(folder / name, designs.parts_of(geometry))
    return answers.write_all(folder, {"report.html": page(found)})[0]


def report_answer(found: Findings, path: Path) -> dict[str, Any]:
    """Return where the page is, and its verdicts, gains and designs."""
    return {
        "report": str(path),
        "statements": [asdict(statement) for statement in found.statements()],
        "gains": [designs.gain_answer(gain) for gain in found.gains()],
        "given": designs.candidate_answer(found.given),
        "chosen": designs.candidate_answer(found.chosen),
    }


def report_text(found: Findings, path: Path) -> str:
    """Return the same in a few lines."""
    rows = found.statements()
    held = sum(row.reproduced for row in rows)
    return "\n".join(
        [
            str(path),
            f"{held} of {len(rows)} statements of the paper reproduced; not reproduced:",
            *(f"  {row.claim}: {row.measured}" for row in rows if not row.reproduced),
            "what each step beyond the paper gains in Top1:",
            *(f"  {gain.in_words()}" for gain in found.gains()),
        ]
    )
