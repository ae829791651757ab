"""What a verb shows: its result, as text or as JSON, and on a terminal how far it is."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

from pydantic import BaseModel

from gellight.cli.advice import with_program_path


def show(result: object, as_json: bool, text: str | None = None) -> None:
    """Print the result of a verb as JSON, on one line unless it is for a terminal, or `text`; None: `table(result)`.

    result: what JSON knows, and in it dataclasses, pydantic's models, and what says `as_json`.
    """
    if as_json:
        text = json.dumps(result, default=_plain, indent=2 if sys.stdout.isatty() else None)
    elif text is None:
        text = table(_plain(result))
    else:
        text = with_program_path(text)
    print(text, flush=True)


def table(result: Mapping[str, object]) -> str:
    """Return a line for each value, after its name; what is None is left out."""
    width = max(map(len, result), default=0)
    return "\n".join(f"{name:{width}}  {value}" for name, value in result.items() if value is not None)


def _plain(result: object) -> dict[str, object]:
    """Return a mapping for what JSON does not know; its values may be unknown too."""
    if isinstance(result, Mapping):
        return dict(result)
    if hasattr(result, "as_json"):
        return dict(result.as_json())
    if isinstance(result, BaseModel):
        return result.model_dump(mode="json")
    if is_dataclass(result):
        return {field.name: getattr(result, field.name) for field in fields(result)}
    raise TypeError(f"{result!r} cannot be shown as JSON")


@contextmanager
def progress(title: str) -> Iterator[Callable[[int | None, int | None, object], None]]:
    """Yield what shows how far the work is: how much is done of how much, and a word on it; nothing off a terminal.

    A number is no word: training tells its loss.
    """
    from rich.console import Console  # not for verbs that end at once
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bar:
        line = bar.add_task(title, total=None)

        def tell(done: int | None, total: int | None, word: object = "") -> None:
            bar.update(
                line,
                completed=done,
                total=total,
                description=f"{title}: {word}" if word and isinstance(word, str) else title,
            )

        yield tell
