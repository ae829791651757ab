"""What the verbs share: the sensor, processes, a progress bar, and how they end."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.showing import progress

if TYPE_CHECKING:
    from gellight_design.simulating.processes import Progress

simulation_option = partial(typer.Option, rich_help_panel="Simulation")
GeometryFile = Annotated[
    Path | None,
    typer.Option(
        "--geometry", metavar="FILE", help="Settings file with a section `geometry`.", show_default="the default sensor"
    ),
]
Workers = Annotated[int, simulation_option("--workers", min=0, max=1024, help="Processes; 0: one for each core.")]


@contextmanager
def many(title: str, kept_in: Path) -> "Iterator[Progress]":
    """Yield what is told how far the work is.

    Raises InputError for what the simulator refuses, and says where to go on after Ctrl-C.
    """
    from sim_reference.deformation import NotConverged  # not for the help

    with progress(title) as tell:
        try:
            yield tell
        except (ValueError, NotConverged) as error:
            raise InputError(f"this sensor cannot be simulated: {error}") from error
        except KeyboardInterrupt:
            print(f"stopped; what is done is kept in {kept_in}, the same command goes on there", file=sys.stderr)
            raise
