"""The command line as a tree."""

from collections.abc import Iterator
from typing import Any


def loaded(verb: Any) -> Any:
    """Return the command behind what a group shows of a verb."""
    return verb.load() if hasattr(verb, "load") else verb


def verbs(command: Any) -> Iterator[Any]:
    """Yield a command and all below it, imported."""
    command = loaded(command)
    yield command
    for verb in getattr(command, "commands", {}).values():
        yield from verbs(verb)
