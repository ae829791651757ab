"""Options that several verbs share, and how groups of them are declared; apart from what takes a second to import."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, is_dataclass
from functools import partial
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from gellight.base.allowed import check_name
from gellight.base.errors import InputError, first_line
from gellight.base.settings import Settings, load_settings
from gellight.base.writing import check_place
from gellight.cli.ending import until_interrupted

LONGEST_S = 1e6
"""longest time that can be asked for"""

rare_option = partial(typer.Option, rich_help_panel="More")
"""as `typer.Option`, below those that a verb is used with every day; other files have such groups of their own"""
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Sensor = Annotated[str | None, typer.Option(help="URL of the sensor.", show_default="as in the settings, or auto")]
Calibration = Annotated[str, typer.Option(help="Bundle: a folder, a .gelcal file, or 'synthetic'.")]
Overwrite = Annotated[bool, rare_option("--overwrite", help="Replace what is there.")]


def _checked_name(name: str | None) -> str | None:
    return None if name is None else check_name(name)


def name_option(help_text: str, default: str) -> Any:
    """Return the option `--name` of a sensor; default: what the help says of a sensor without one."""
    return typer.Option("--name", help=help_text, show_default=default, callback=_checked_name)


def simulated_settings(flags: Mapping[str, object]) -> Settings:
    """Return the settings of a verb for the simulated sensor, `sim://` unless a flag or the settings name another.

    Where the settings name a real sensor, neither that nor its calibration counts.
    """
    settings = load_settings(flags)
    if flags.get("sensor.url") is not None or settings.sensor.url.startswith("sim://"):
        return settings
    named = {name: value for name, value in flags.items() if value is not None}
    return load_settings({"sensor.url": "sim://", "sensor.calibration": "synthetic", **named})


def check_out(out: Path, overwrite: bool | None, option: str = "--out") -> None:
    """Refuse to replace a file or a folder unasked, and a place where nothing can be written.

    Called before the work, which may take minutes. overwrite: None for a verb that replaces nothing.
    """
    if out.exists() and not overwrite:
        other = "" if overwrite is None else " or give --overwrite"
        raise InputError(f"{option}: {out} exists: choose another name{other}")
    try:
        check_place(out)
    except OSError as error:
        raise InputError(f"{option}: {out} cannot be written ({first_line(error)}): choose another place") from error


@dataclass(frozen=True)
class NewBundle:
    """Where a bundle is written."""

    out: Annotated[Path, typer.Option(help="Folder of the calibration bundle to write.")]
    overwrite: Overwrite = False

    def __post_init__(self) -> None:
        """Refuse to replace a bundle unasked."""
        check_out(self.out, self.overwrite)


def between(low: float, high: float, unit: str) -> Callable[[typer.CallbackParam, float], float]:
    """Return the callback of an option whose value, in `unit`, has to lie from `low` to `high`; NaN does not."""

    def check(option: typer.CallbackParam, value: float) -> float:
        if not low <= value <= high:
            name = (option.name or "").replace("_", "-")
            raise InputError(f"--{name} {value:g} is not possible: give {low:g} to {high:g} {unit}")
        return value

    return check


Seconds = Annotated[  # as the help says
    float, typer.Option(help="End after this number of seconds; 0: at Ctrl-C.", callback=between(0, LONGEST_S, "s"))
]


def with_options(verb: Callable[..., None]) -> Callable[..., None]:
    """Return a verb for typer: each parameter of `verb` that is a dataclass becomes the options its fields declare."""
    parameters = signature(verb).parameters.values()
    kinds = {one.name: one.annotation for one in parameters if isinstance(one.annotation, type)}
    kinds = {name: kind for name, kind in kinds.items() if is_dataclass(kind)}
    groups = {name: signature(kind).parameters for name, kind in kinds.items()}
    options = [option for one in parameters for option in groups.get(one.name, {one.name: one}).values()]

    def command(**given: Any) -> None:
        made = {one: kind(**{name: given.pop(name) for name in groups[one]}) for one, kind in kinds.items()}
        verb(**made, **given)

    command.__name__, command.__doc__ = verb.__name__, verb.__doc__
    command.__annotations__ = {option.name: option.annotation for option in options}
    # What typer reads. By keyword alone, an option without a default may stand behind one with a default.
    command.__signature__ = Signature(  # type: ignore[attr-defined]
        [option.replace(kind=Parameter.KEYWORD_ONLY) for option in options]
    )
    return command


@dataclass(frozen=True)
class RunOptions:
    """How a sensor runs."""

    calibration: Annotated[str | None, typer.Option(help="Calibration bundle.", show_default="that of the sensor")] = (
        None
    )
    frames: Annotated[int, rare_option(help="Stop after this number of frames; 0: run until Ctrl-C.", min=0)] = 0
    settings: Annotated[
        list[str] | None,
        rare_option(
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
