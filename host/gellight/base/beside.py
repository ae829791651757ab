"""What distributions beside this one add, found by entry points; where none does, which one has it."""

from importlib.metadata import entry_points
from typing import Any

from gellight.base.errors import InputError


def installed(group: str, *, name: str = "", what: str, home: str, extra: str) -> Any:
    """Load what an installed distribution has among the entry points `group`; name: of the one that is meant, if any.

    Where there is none, InputError says that `what` comes with `home`, which `gellight[extra]` brings.
    """
    for found in entry_points(group=group):
        if name in ("", found.name):
            return found.load()
    raise InputError(f"{what} {comes_with(home, extra)}")


def comes_with(home: str, extra: str) -> str:
    """Return the end of a sentence about something that `home` has, which is not installed."""
    return (
        f'comes with {home}, which is not installed: pip install "gellight[{extra}]", or ./host/{home} from a clone of '
        "GelLight"
    )
