"""The options of the verbs that run a sensor: apart from what runs it, which takes a second to import."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.ending import until_interrupted


@dataclass(frozen=True)
class RunOptions:
    """How a sensor runs."""

    calibration: Annotated[str | None, typer.Option(help="Calibration bundle.", show_default="that of the sensor")] = (
        None
    )
    frames: Annotated[int, typer.Option(help="Stop after this number of frames; 0: run until Ctrl-C.", min=0)] = 0
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="SECTION.KEY=VALUE",
            help="Set this for the run, again for another one; `gellight config show --schema` lists them.",
            show_default="none",
        ),
    ] = None

    def flags(self) -> dict[str, object]:
        """Return the settings that were given as options; InputError for one without a value.

        A run of a number of frames is for programs, several of which may run at once: its port is a free one.
        """
        flags = {"sensor.calibration": self.calibration, "dashboard.port": 0 if self.frames else None}
        return {**flags, **dict(map(_pair, self.settings or []))}

    def ended_by_hand(self) -> AbstractContextManager[None]:
        """Return what takes Ctrl-C and SIGTERM for the proper end, unless a number of frames was asked for."""
        return until_interrupted(not self.frames)


def _pair(text: str) -> tuple[str, str]:
    key, is_there, value = text.partition("=")
    if not is_there or "." not in key:
        raise InputError(f"--set {text!r} sets nothing: write SECTION.KEY=VALUE, for example stream.lan=true")
    return key.strip(), value.strip()
