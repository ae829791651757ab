"""What verbs share that compute many independent things: processes, parts of the whole, a cluster, a progress bar."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.showing import progress, show

if TYPE_CHECKING:
    from gellight.lab.simulator.sweep import ResultStore, SweepOptions

Workers = Annotated[int, typer.Option("--workers", min=0, max=1024, help="Processes; 0: one for each core.")]


@dataclass(frozen=True)
class Sweeping:
    """How a sweep is computed."""

    workers: Workers = 0
    shard: Annotated[str, typer.Option("--shard", metavar="I/N", help="Compute only this part of the sweep.")] = "1/1"
    scheduler: Annotated[str | None, typer.Option("--scheduler", metavar="URL", help="Dask scheduler, tcp://...")] = (
        None
    )

    def __post_init__(self) -> None:
        """Refuse a part that is none, before a folder is made."""
        from gellight.lab.simulator.sweep import parse_shard  # this and what is below: not for the help

        parse_shard(self.shard)

    @contextmanager
    def sweep_in(self, store: "ResultStore", title: str, *, as_json: bool) -> "Iterator[SweepOptions]":
        """Yield how to compute, with a progress bar on a terminal.

        Raises InputError for what the simulator refuses, and says where to go on after Ctrl-C. Ends the command, with
        a line, where results of other shards are missing.
        """
        from gellight.lab.simulator.sweep import SweepIncomplete, SweepOptions, available_cores, parse_shard
        from sim_reference.deformation import NotConverged

        shard, workers = parse_shard(self.shard), self.workers or available_cores()
        with progress(title) as tell:
            try:
                yield SweepOptions(store=store, workers=workers, shard=shard, scheduler=self.scheduler, progress=tell)
            except SweepIncomplete:
                self._answer_part(store, as_json=as_json)
                raise typer.Exit from None
            except (ValueError, NotConverged) as error:
                raise InputError(f"this sensor cannot be simulated: {error}") from error
            except KeyboardInterrupt:
                print(
                    f"stopped; what is done is kept in {store.folder}, the same command goes on there", file=sys.stderr
                )
                raise

    def _answer_part(self, store: "ResultStore", *, as_json: bool) -> None:
        """Print that only a part of the sweep is there."""
        part = {"shard": self.shard, "complete": False, "store": str(store.folder)}
        text = f"shard {self.shard} is done; the others are still missing in {store.folder}"
        show(part, as_json, text)
