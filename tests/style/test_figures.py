"""The figures in the documents are those that the commands printed: tests/data/figures keeps what they printed.

Who changes what a figure depends on runs its command again and stores what it prints, under its `$ command` line.
"""

import re
from collections.abc import Iterator

from tests.helpers.places import CHECKOUT

RECORDS = [path.read_text().split("\n", 1) for path in sorted((CHECKOUT / "tests/data/figures").glob("*.txt"))]
PRINTED = {
    head.removeprefix("$ "): {float(number) for number in re.findall(r"\d+(?:\.\d+)?", text)} for head, text in RECORDS
}
NUMBER = re.compile(r"(?<![\w.])(?:\d{1,3}(?: \d{3})+|\d+(?:\.\d+)?)(?![\w.]*\w)")
SCALES = (1, 1000, 100)
"""a figure may be given in um or per cent where mm or a share was printed"""


def printed(command: str, number: str) -> bool:
    """Say whether the command printed a value that this is, rounded to the nearest or up (`within 0.006 mm`)."""
    value, unit = float(number.replace(" ", "")), 10.0 ** -len(number.partition(".")[2])
    return any(-0.501 <= (value - scale * was) / unit < 0.999 for was in PRINTED[command] for scale in SCALES)


FIRST, *SECTIONS = (CHECKOUT / "docs/figures.md").read_text().split("\n## ")
"""the large table, then a section for each subject"""


def rows(text: str) -> Iterator[list[str]]:
    """Yield the cells of every row of every table."""
    for line in text.splitlines():
        if line.startswith("|") and not line.startswith("|---"):
            yield [cell.strip() for cell in line.strip("|").split("|")]


def quoted() -> Iterator[tuple[str, str, str]]:
    """Yield where a figure stands, the command that prints it, and the figure."""
    command = ""
    for what, measured, _, said in rows(FIRST):
        command = "" if said.startswith("version") else next(iter(re.findall("`(.*?)`", said)), command)
        yield from (("figures.md: " + what, command, number) for number in NUMBER.findall(measured))
    for what, *cells in rows((CHECKOUT / "README.md").read_text()):
        for cell in cells:
            for text, command in re.findall(r"(.*): `(.*?)`", cell):
                yield from (("README.md: " + what, command, number) for number in NUMBER.findall(text))
    for (title, command), lines in TABLES.items():
        (section,) = (text for text in SECTIONS if text.startswith(title + "\n"))
        for line in rows(section):
            if line[0] in lines:
                for number in NUMBER.findall(" | ".join(line[1:])):
                    yield f"{title}: {line[0]}", f"python -m tests.benchmarks.{command}", number


TABLES = {
    ("Tracking", "tracking.judge DIR"): (
        "TSTEP turns by 40°",
        "CCONVEX slides",
        "PCONVEX tilts by 5°",
        "BALLVEX tilts",
        "peg, all six",
        "wavy bead rolls by 360°",
        "fine bead rolls by 360°",
        "*key, all six*",
        "*gentle bead rocks by 50°*",
    ),
    ("Scanning", "scan --kept-apart"): ("0.06", "0.15"),
    ("Force", "force"): ("layer", "N per mm³ of all that is pressed in", "N per mm³ of the contact patch"),
    ("Photometric stereo", "photometric"): ("GelNet, 1 picture", "4 exposures"),
}
FIGURES = [figure for figure in quoted() if figure[1] in PRINTED]


def test_a_figure_is_what_its_command_printed() -> None:
    assert [figure for figure in FIGURES if not printed(*figure[1:])] == []


def test_every_record_is_quoted() -> None:
    assert {command for _, command, _ in FIGURES} >= PRINTED.keys()


def test_a_figure_that_was_not_printed_is_noticed() -> None:
    assert printed("python -m tests.benchmarks.selfcheck", "0.008")
    assert not printed("python -m tests.benchmarks.presses", "0.253")
