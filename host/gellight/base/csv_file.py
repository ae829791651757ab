"""A csv file with names of columns in its first line, read with file, line and value in every refusal, or written."""

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from gellight.base.errors import InputError

Row = dict[str, str | None]


def read_rows(path: Path, what: str, columns: Sequence[str]) -> list[tuple[int, Row]]:
    """Read a csv that must have these columns, each row with its line; InputError as `read_csv`."""
    found, rows = read_csv(path, what)
    if missing := [column for column in columns if column not in found]:
        raise InputError(f"{path} has no column {', '.join(missing)}: its first line must be {','.join(columns)}")
    return rows


def read_csv(path: Path, what: str) -> tuple[list[str], list[tuple[int, Row]]]:
    """Read the names of the columns, and each row with its line.

    Raises InputError, naming `what`, where it cannot be read, and for a row with more values than there are columns.
    """
    try:
        content = path.read_bytes()
        if b"\0" in content:  # UTF-16, or no text at all
            raise csv.Error("it has a zero byte")
        # Names of files need not be UTF-8, and are written as they are.
        reader = csv.DictReader(io.StringIO(content.decode("utf-8-sig", "surrogateescape"), newline=""))
        reader.fieldnames = names = [name.strip() for name in reader.fieldnames or []]
        rows = [(reader.line_num, dict(row)) for row in reader]
    except OSError as error:
        raise InputError(f"{what} {path} cannot be opened ({error.strerror}): check the name") from error
    except csv.Error as error:
        raise InputError(f"{what} {path} is not a csv file ({error}): save it as UTF-8 text") from error
    for line, row in rows:
        if any(row.pop(None, ())):  # where DictReader puts what is left
            raise InputError(f"{path}, line {line}: it has more values than columns; write numbers with a point")
    return names, rows


def number_in(row: Row, column: str, where: str) -> float:
    """Return the number in a column of a row; InputError where there is none."""
    text = row[column]
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: {column} is {text!r}: give a number")
    return value


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return the text of a csv file with these columns."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()
