"""Options that are numbers within bounds: what is outside, NaN included, is refused in one line."""

from collections.abc import Callable

import typer

MOST_SECONDS = 1e6


def between(low: float, high: float, unit: str) -> Callable[[typer.CallbackParam, float], float]:
    """Return the callback of an option whose value, in `unit`, has to lie from `low` to `high`."""

    def check(option: typer.CallbackParam, value: float) -> float:
        from gellight.base.errors import InputError

        if not low <= value <= high:
            name = (option.name or "").replace("_", "-")
            raise InputError(f"--{name} {value:g} is not possible: give {low:g} to {high:g} {unit}")
        return value

    return check
