"""The command line in this process, as a user types it, and as a tree."""

from collections.abc import Iterator
from typing import Any

from click.testing import Result
from typer.testing import CliRunner

from gellight.base.errors import GellightError
from gellight.cli.main import app as gellight


def invoke(*words: object, app: Any = gellight, **options: Any) -> Result:
    """Run `gellight` with these words; options: of `CliRunner.invoke`."""
    return CliRunner().invoke(app, [str(word) for word in words], **options)


def succeeded(result: Result) -> Result:
    """Return the result of a verb that came to its good end."""
    assert result.exit_code == 0, (result.output, result.exception)
    return result


def refused(result: Result) -> str:
    """Return why a verb refused what it was asked."""
    assert isinstance(result.exception, GellightError), result.output
    return str(result.exception)


def loaded(verb: Any) -> Any:
    """Return the command behind what a group shows of a verb."""
    return verb.load() if hasattr(verb, "load") else verb


def verbs(command: Any) -> Iterator[Any]:
    """Yield a command and all below it, imported."""
    command = loaded(command)
    yield command
    for verb in getattr(command, "commands", {}).values():
        yield from verbs(verb)
