"""What the checks of `doctor` find: each finding has a level, a text and a remedy."""

from dataclasses import asdict, dataclass
from enum import StrEnum

from gellight.base.errors import GellightError


class Level(StrEnum):
    """How much a finding matters."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"


@dataclass(frozen=True)
class Finding:
    """What one check found."""

    level: Level
    check: str
    text: str
    remedy: str = ""
    """what to do; empty where nothing is to be done"""

    def as_json(self) -> dict[str, str]:
        """Return it by name."""
        return {name: str(value) for name, value in asdict(self).items()}


def judged(check: str, text: str, *, bad: bool, remedy: str) -> Finding:
    """Return a warning with its remedy where something is `bad`, else that all is well."""
    return warning(check, text, remedy) if bad else ok(check, text)


def ok(check: str, text: str) -> Finding:
    """Return a finding that all is well."""
    return Finding(Level.OK, check, text)


def warning(check: str, text: str, remedy: str) -> Finding:
    """Return a finding that costs quality."""
    return Finding(Level.WARNING, check, text, remedy)


def problem(check: str, text: str, remedy: str) -> Finding:
    """Return a finding that prevents use."""
    return Finding(Level.PROBLEM, check, text, remedy)


def failure(check: str, error: GellightError) -> Finding:
    """Return the finding that an error is: its text ends with the remedy already, after the last colon."""
    text, _, remedy = str(error).rpartition(": ")
    return problem(check, text or remedy, remedy)
