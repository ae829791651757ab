"""What a verb shows: its result, as text or as JSON, and on a terminal how far it is."""

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass

from pydantic import BaseModel

LOG_S = 10.0
"""between two lines of a log on how far the work is"""


def show(result: object, as_json: bool, text: str | None = None) -> None:
    """Print the result of a verb as JSON, on one line unless it is for a terminal, or `text`; None: `table(result)`.

    result: what JSON knows, and in it dataclasses, pydantic's models, and what says `as_json`.
    """
    if as_json:
        text = json.dumps(result, default=_plain, indent=2 if sys.stdout.isatty() else None)
    elif text is None:
        text = table(_plain(result))
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
def progress(title: str, takes: str = "") -> Iterator[Callable[[int | None, int | None, object], None]]:
    """Yield what shows how far the work is: how much is done of how much, and a word on it.

    A bar on a terminal, a line every `LOG_S` seconds in a log. takes: how long it usually takes, said when the work
    first tells something: by then it was not refused. A number is no word: training tells its loss.
    """
    from rich.console import Console  # not for verbs that end at once
    from rich.progress import Progress

    console = Console(stderr=True, soft_wrap=True, highlight=False)
    with (
        Progress(console=console, transient=True, disable=not sys.stderr.isatty()) as bar,
        lines_in_log(lambda: how_far(bar.tasks[0].description, bar.tasks[0].completed, bar.tasks[0].total)),
    ):
        line = bar.add_task(title, total=None)

        def tell(done: int | None, total: int | None, word: object = "") -> None:
            nonlocal takes
            if takes:
                console.print(f"{title}: takes {takes}")
                takes = ""
            bar.update(
                line,
                completed=done,
                total=total,
                description=f"{title}: {word}" if word and isinstance(word, str) else title,
            )

        yield tell


def how_far(what: str, done: float | None, wanted: float | None, unit: str | None = "") -> str:
    """Return how far something is, for a log."""
    return f"{what}, {done or 0:g} of {wanted:g} {unit or ''}".rstrip() if wanted else what


@contextmanager
def lines_in_log(say: Callable[[], str]) -> Iterator[None]:
    """Print what `say` returns every `LOG_S` seconds, and for how long it has gone on; nothing on a terminal."""
    ended, begun_s = threading.Event(), time.monotonic()

    def talk() -> None:
        while not ended.wait(LOG_S):
            print(f"{say()} ({time.monotonic() - begun_s:.0f} s)", file=sys.stderr, flush=True)

    talking = threading.Thread(target=talk, name="log", daemon=True)
    if not sys.stderr.isatty():
        talking.start()
    try:
        yield
    finally:
        ended.set()
        if talking.is_alive():
            talking.join()
