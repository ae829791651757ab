"""`gellight demo`: the whole sensor, simulated, with its dashboard."""

import os
import shlex
import shutil
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from gellight.cli.options import AsJson, RunOptions, simulated_settings, with_options
from gellight.cli.showing import show

FRAME_TIMEOUT_S = 20.0  # chosen: patience with the first picture of a busy computer


@with_options
def command(
    options: RunOptions,
    sensor: Annotated[str | None, typer.Option(help="URL of the camera.", show_default="sim://")] = None,
    browser: Annotated[bool, typer.Option(help="Open the dashboard in a browser.")] = True,
    as_json: AsJson = False,
) -> None:
    """Press objects into a simulated sensor, and see what it feels."""
    from gellight.cli.one_sensor import follow, in_words, opened  # not for the help

    settings = simulated_settings({"sensor.url": sensor, **options.flags()})
    with options.ended_by_hand(), opened(settings, every=False) as (daemon, url):
        if browser and not options.frames:
            open_browser(url)
        summary = follow(daemon, options.frames, patience_s=FRAME_TIMEOUT_S)
        show(summary, as_json, in_words(summary, options.frames))
    activate = Path(sys.prefix, "bin", "activate")
    if activate.is_file() and not shutil.which("gellight"):
        print(f"`. {shlex.quote(os.path.relpath(activate))}` lets this shell find `gellight`", file=sys.stderr)


def open_browser(url: str) -> None:
    """Open `url` where there is a screen; a browser in the terminal would hide what is printed there.

    By a file that leads there: everybody may read the arguments of a program, and the token is nobody else's.
    """
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        from gellight.base.runtime_folder import folder  # not for the help

        place = folder() / "demo.html"
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        place.touch(0o600)
        place.write_text(f'<meta http-equiv="refresh" content="0; url={url}">')
        webbrowser.open(place.as_uri())
