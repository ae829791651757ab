"""The guided routine in a terminal: what it shows of the calibration, and the keys that it takes."""

import sys
import threading
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from gellight.base.errors import InputError
from gellight.calibration.routine import Routine
from gellight.report.pictures import write_png

POLL_S = 0.1
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
    with Live(console=console, auto_refresh=False, transient=False) as live:
        while not routine.ended:
            snapshot = routine.snapshot()
            if snapshot["version"] != version:
                version = snapshot["version"]
                live.update(screen(snapshot, refusal, keys=interactive), refresh=console.is_terminal)
                if interactive:
                    _show_pictures(routine, place, shown)
            try:
                refusal = obey(routine, typed.get(timeout=POLL_S))
            except Empty:
                continue
        live.update(screen(routine.snapshot(), "", keys=False), refresh=True)
    if not console.is_terminal:
        console.print()  # only a terminal is left on a new line


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
    for name in ("press", "cylinder", "pins"):
        if pictures.get(name) is not shown.get(name):
            shown[name] = pictures[name]
            with suppress(OSError):  # the routine reports a full disk, because it cannot go on
                write_png(place / f"{name}.png", pictures[name])


def screen(snapshot: dict[str, Any], refusal: str, *, keys: bool) -> RenderableType:
    """Return what is shown of a snapshot of the routine, with what was refused last; keys: explain the keys."""

    marks = {"done": "●", "now": "◐", "to do": "○"}
    head = "  ".join(f"{marks[step['state']]} {step['name'].replace('_', ' ')}" for step in snapshot["steps"])
    lines: list[RenderableType] = [Text(head, style="bold"), Text(snapshot["instruction"])]
    progress = snapshot["progress"]
    if progress.get("done") is not None:
        lines.append(Text(f"{progress['done']} of {progress['wanted']} {progress['unit']}", style="cyan"))
    if snapshot["awaiting"]:
        lines.append(Text({"press": "▼ press", "lift": "▲ lift"}[snapshot["awaiting"]], style="bold green"))
    press = snapshot["press"]
    if press:
        circle = ", ".join(f"{press[k]:.1f}" for k in ("center_x_px", "center_y_px", "contact_radius_px"))
        lines.append(Text(f"last press: centre and radius {circle} px ({press['state']})"))
    if snapshot["coverage"] and snapshot["step"] == "presses":
        lines.append(Text(_map(snapshot["coverage"]["places"]), style="green"))
    if snapshot["advice"]:
        lines.append(Text(snapshot["advice"], style="yellow"))
    lines += [Text(words, style="bold red") for words in (snapshot["problem"], refusal) if words]
    return Group(*lines, *([Text(KEYS, style="dim")] if keys else []))


def _map(places: list[list[int]]) -> str:
    return "\n".join(" ".join("·" if count == 0 else str(min(count, 9)) for count in row) for row in places)
