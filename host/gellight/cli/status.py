"""`gellight status`: the daemons that run on this computer."""

from typing import Annotated, Any

import typer

from gellight.base.errors import StreamError
from gellight.cli.ending import Ending
from gellight.cli.options import AsJson
from gellight.cli.showing import show
from gellight.ring.heat import RingHeat, dimmed_text, warm_text
from gellight.stream.running import RunningDaemon, running


def command(
    name: Annotated[str | None, typer.Argument(help="One daemon.", show_default="all of this user")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the daemons of this computer, and how they are.

    The exit status is 1 where none runs, or where one has an error.
    """
    found = [daemon for daemon in running() if name in (None, daemon.name)]
    told = {daemon.name: status_of(daemon) for daemon in found}
    lines = [line(daemon, told[daemon.name]) for daemon in found]
    none = f"no daemon{f' of {name}' if name else ''} runs: start one with `gellight run`"
    show(told, as_json, "\n".join(lines or [none]))
    if not told or any(status["error"] for status in told.values()):
        raise typer.Exit(Ending.JUDGED_BAD)


def status_of(daemon: RunningDaemon) -> dict[str, Any]:
    """Return what a daemon says, with its process; one that does not answer has that as its error."""
    from gellight.stream.subscription import subscribe  # not for the help, nor where nothing runs: half a second

    about = {"process": daemon.process, "since_unix_s": daemon.since_unix_s, "endpoint": daemon.endpoint}
    try:
        with subscribe(daemon.name) as frames:
            return {**about, **frames.status()}
    except StreamError as error:
        return {**about, "sensor": daemon.sensor, "error": str(error)}


def line(daemon: RunningDaemon, status: dict[str, Any]) -> str:
    """Return a line for people."""
    if status["error"]:
        return f"{daemon.name} (process {daemon.process}): {status['error']}"
    age = status["frame_age_ms"].get("median", "?")
    return (
        f"{daemon.name} (process {daemon.process}, {daemon.sensor}): {status['fps']} frames/s, age {age} ms, "
        f"{status['frames']} frames, {status['lost']} lost{touch(status['touch'])}{heat(status.get('ring'))}"
    )


def heat(ring: RingHeat | None) -> str:
    """Return for people how warm the light ring is, as the end of a line."""
    if ring is None:
        return ""
    told = warm_text(ring["chip_c"], ring["ring_c"]), dimmed_text(ring["dimmed"])
    return "".join(f"; {part}" for part in told if part)


def touch(felt: dict[str, Any] | None) -> str:
    """Return for people what the newest frame feels, as the end of a line."""
    if felt is None:
        return ""
    force = felt["force"]
    weighed = f", {force['normal_n']:.2f} ± {force['error_n']:.2f} N" if force else ""
    pressed = f", up to {force['largest_pressure_mpa']:.3f} MPa" if force else ""
    return f"; {felt['indentation_mm']:.3f} mm deep{weighed}{pressed}"
