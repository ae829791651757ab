"""The guided routine in a terminal: what it shows of the calibration, and the keys that it takes."""

import sys
import threading
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from gellight.base.errors import InputError
from gellight.cli.showing import how_far, lines_in_log
from gellight.lab.calibration.display import Shown
from gellight.lab.calibration.routine import Routine
from gellight.lab.report.pictures import write_png

POLL_S = 0.1  # chosen: how late the screen is while no key is pressed
KEYS = "n: next or enough   d: drop the last press   c X Y R: correct its circle, px   a: accept   q: stop"
_ACTIONS = {"n": "next", "d": "drop", "c": "correct", "a": "accept", "q": "abort"}


def follow(routine: Routine, place: Path, *, interactive: bool, quiet: bool) -> None:
    """Show what the routine says until it ends, and hand it what the user types."""
    typed: SimpleQueue[str] = SimpleQueue()
    if interactive:
        threading.Thread(target=_read_lines, args=(typed,), daemon=True).start()
    console = Console(stderr=True, quiet=quiet)
    version, refusal = -1, ""
    shown: dict[str, object] = {}
    with (
        Live(console=console, auto_refresh=False, transient=False) as live,
        lines_in_log(lambda: line(routine.shown)),
    ):
        while not routine.ended:
            now = routine.shown
            if now.version != version:
                version = now.version
                live.update(screen(now, refusal, keys=interactive), refresh=console.is_terminal)
                if interactive:
                    _show_pictures(routine, place, shown)
            try:
                refusal = obey(routine, typed.get(timeout=POLL_S))
            except Empty:
                continue
        live.update(screen(routine.shown, "", keys=False), refresh=True)
    if not console.is_terminal:
        console.print()  # only a terminal is left on a new line


def line(shown: Shown) -> str:
    """Return what a log says of how far the routine is."""
    progress = shown.progress
    return how_far(shown.step.replace("_", " "), progress.done, progress.wanted, progress.unit)


def _read_lines(typed: SimpleQueue[str]) -> None:
    for line in sys.stdin:
        typed.put(line)
    typed.put("q")  # nobody can type any more


def obey(routine: Routine, line: str) -> str:
    """Do what a line asks for; returns why it cannot be done, empty otherwise."""
    words = line.split() or ["n"]
    action = _ACTIONS.get(words[0].lower(), words[0])
    try:
        numbers = [float(word) for word in words[1:]]
        names = ("center_x_px", "center_y_px", "contact_radius_px")
        routine.act(action, **dict(zip(names, numbers, strict=action == "correct")))
    except (InputError, ValueError) as error:
        return str(error)
    return ""


def _show_pictures(routine: Routine, place: Path, shown: dict[str, object]) -> None:
    """Write the pictures that are new into the folder of the state, because a terminal shows none."""
    pictures = routine.pictures()
    for name in ("press", "cylinder"):
        if pictures.get(name) is not shown.get(name):
            shown[name] = pictures[name]
            with suppress(OSError):  # the routine reports a full disk, because it cannot go on
                write_png(place / f"{name}.png", pictures[name])


def screen(shown: Shown, refusal: str, *, keys: bool) -> RenderableType:
    """Return what the routine shows, with what was refused last; keys: explain the keys."""
    marks = {"done": "●", "now": "◐", "to do": "○"}
    head = "  ".join(f"{marks[step['state']]} {step['name'].replace('_', ' ')}" for step in shown.step_states())
    lines: list[RenderableType] = [Text(head, style="bold"), Text(shown.instruction)]
    progress, press, presses = shown.progress, shown.press, shown.figures.presses
    if progress.done is not None:
        lines.append(Text(f"{progress.done} of {progress.wanted} {progress.unit}", style="cyan"))
    if shown.awaiting:
        lines.append(Text({"press": "▼ press", "lift": "▲ lift"}[shown.awaiting], style="bold green"))
    if press:
        lines.append(Text(f"last press: {press.place}"))
    if presses and shown.step == "presses":
        rows = (" ".join("·" if count == 0 else str(min(count, 9)) for count in row) for row in presses.coverage.places)
        lines.append(Text("\n".join(rows), style="green"))
    if shown.advice:
        lines.append(Text(shown.advice, style="yellow"))
    lines += [Text(words, style="bold red") for words in (shown.problem, refusal) if words]
    return Group(*lines, *([Text(KEYS, style="dim")] if keys else []))
