"""Faults of the RP2040's code drawn by chance: each seed is a list that nobody had in mind.

A fault is one small change on one line of C: a statement left out, a bit of a number or a condition turned over,
an operator for its neighbour. Lines are drawn first, all equally likely, then what happens to them.
"""

import random
import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from tests.firmware.helpers.mutations import BOARD, SHARED, Mutation

SOURCES = ("*.c", "*.h")
NUMBER = re.compile(r"\b(0x[0-9a-f]+|\d+)u?\b")
STATEMENT = re.compile(
    r" {4,}(?!return|break|continue|static|case|default)[^{}=]*(\([^{}]*\)|[^=<>!]=[^=][^{}]*|\+\+|--);"
)
DECLARATION = re.compile(r" *(?:const |volatile |struct |enum )*\w+ \*?\w+(?:\[.*\])?(?: =|;|,)")
CONDITION = re.compile(r"(\s*(?:\} else )?(?:if|while) \()(.*)(\)(?: \{)?)")
NEIGHBOURS = ("< <=", "> >=", "== !=", "&& ||", "+ -", "<< >>")


class Change(NamedTuple):
    """A line of a file, numbered from 0, as it is and as the fault has it."""

    file: str
    number: int
    old: str
    new: str

    def planted_in(self, checkout: Path) -> Mutation:
        """Return the fault, with as many lines before as make its place the only one."""
        lines = (checkout / self.file).read_text().splitlines(keepends=True)
        first = self.number
        while "".join(lines).count("".join(lines[first : self.number + 1])) > 1:
            first -= 1
        before = "".join(lines[first : self.number])
        what = f"without {self.old.strip()}" if self.new.strip().startswith(";") else self.new.strip()
        return Mutation(
            f"{Path(self.file).name}:{self.number + 1} {what}", self.file, before + self.old, before + self.new
        )


def drawn(checkout: Path, seed: int) -> Iterator[Mutation]:
    """Yield faults of the board's code, one a line at most, in an order by chance."""
    chance = random.Random(seed)
    changes = [change for folder in (SHARED, BOARD) for change in _changes_below(checkout, folder)]
    lines = [list(group) for _, group in groupby(changes, key=lambda change: change[:2])]
    chance.shuffle(lines)
    for line in lines:
        yield chance.choice(line).planted_in(checkout)


def _changes_below(checkout: Path, folder: str) -> Iterator[Change]:
    for path in sorted(path for kind in SOURCES for path in (checkout / folder).glob(kind)):
        comment = False
        for number, line in enumerate(path.read_text().splitlines(keepends=True)):
            comment = (comment or line.lstrip().startswith("/*")) and "*/" not in line
            code = line.split("/*")[0].rstrip()
            if code.strip() and not comment and not code.startswith(("#include", "#if", "#endif")):
                file = str(path.relative_to(checkout))
                yield from (Change(file, number, line, new + line[len(code) :]) for new in _changed(code))


def _changed(code: str) -> Iterator[str]:
    """Yield what a line may become."""
    if STATEMENT.match(code) and not DECLARATION.match(code):
        yield re.sub(r"\S.*", ";", code)
    if found := CONDITION.fullmatch(code):
        yield f"{found[1]}!({found[2]}){found[3]}"
    for pair in NEIGHBOURS:
        one, other = (f" {word} " for word in pair.split())
        for at in re.finditer(f"{re.escape(one)}|{re.escape(other)}", code):
            yield code[: at.start()] + (other if at[0] == one else one) + code[at.end() :]
    for at in NUMBER.finditer(code):
        number = int(at[1], 0)
        for bit in range(max(number.bit_length(), 1)):
            text = f"{number ^ 1 << bit:#x}" if at[1].startswith("0x") else str(number ^ 1 << bit)
            yield code[: at.start(1)] + text + code[at.end(1) :]
