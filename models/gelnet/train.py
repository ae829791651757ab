"""Train GelNet on a table of labelled pixels: `python -m gelnet.train --table TABLE.npz --out DIR`.

Writes DIR/network.onnx and DIR/training.json, both or neither, and one JSON object a line on stdout as it goes.
A table that cannot be learnt from is refused with one line on stderr and exit status 2.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from gelnet.export import ExportError, export
from gelnet.network import GelNet
from gelnet.table import Table, TableError, load_table, split_by_image

Loss = Callable[[Tensor, Tensor], Tensor]


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How to train."""

    loss: str
    """"gradient": mean absolute difference of the gradients; "normal": mean chord between the unit normals"""
    learning_rate: float
    batch: int
    epochs: int
    least_visits: int
    """a small table is seen more often than `epochs`, until this many rows have been seen"""
    dropout: float
    largest_table: int
    """more rows than that are thinned out at random"""
    warm_up: float
    """fraction of the steps in which the learning rate rises; then it falls as a cosine. 0: it stays as it is"""
    place_jitter: float
    """standard deviation of a random shift of each pixel's place, in mean distances between presses: light changes
    slowly over the gel, and a few presses must not be taken for a map of it"""
    zero_based: bool
    """subtract the answer to an unchanged pixel at the same place, as the host does with every frame"""


RECIPES = {
    # Section 2.4 of the paper: L1, Adam 1e-6, batch 128, 150 epochs, dropout before the last layer.
    "paper": Recipe(
        loss="gradient",
        learning_rate=1e-6,
        batch=128,
        epochs=150,
        least_visits=0,
        dropout=0.1,
        largest_table=10**9,
        warm_up=0,
        place_jitter=0.0,
        zero_based=False,
    ),
    "fast": Recipe(
        loss="normal",
        learning_rate=5e-3,
        batch=2048,
        epochs=10,
        least_visits=1_000_000,
        dropout=0.0,
        largest_table=500_000,
        warm_up=0.05,
        place_jitter=0.5,
        zero_based=True,
    ),
    # For labels that are right to a pixel: steps twice as large, three times as many, and hardly any jitter.
    "thorough": Recipe(
        loss="normal",
        learning_rate=1e-2,
        batch=2048,
        epochs=10,
        least_visits=3_000_000,
        dropout=0.0,
        largest_table=500_000,
        warm_up=0.05,
        place_jitter=0.2,
        zero_based=True,
    ),
}
HELD_OUT = 0.1
"""Fraction of the images the error is measured on (9:1 in the paper)."""
DEFAULT_WIDTH = 32


@dataclass(frozen=True, kw_only=True)
class Training:
    """A trained network and how it came about."""

    network: GelNet
    losses: list[float]
    """mean loss of each epoch"""
    epochs: int
    rows: int
    cpu_seconds: float


_PLACE = torch.tensor([0.0, 0.0, 0.0, 1.0, 1.0])
"""the two of the five inputs that say where a pixel is"""


def train(
    table: Table,
    recipe: Recipe,
    *,
    width: int = DEFAULT_WIDTH,
    seed: int = 0,
    progress: Callable[[int, int, float], None] = lambda epoch, epochs, loss: None,
) -> Training:
    """Train a network on every row of the table; the same seed on the same machine gives the same network.

    progress is called with (epoch, epochs, loss) after each epoch.
    """
    torch.manual_seed(seed)
    started = time.process_time()
    pixels, gradient = _tensors(table, recipe.largest_table)
    network = GelNet(width, dropout=recipe.dropout)
    network.fit_range(pixels, gradient)
    epochs = max(recipe.epochs, math.ceil(recipe.least_visits / len(pixels)))
    optimiser = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate, fused=True)
    batch = min(recipe.batch, len(pixels))
    rates = learning_rates(recipe, steps=epochs * math.ceil(len(pixels) / batch))
    losses: list[float] = []
    jitter_px = recipe.place_jitter * table.press_distance_px
    network.train()
    for epoch in range(1, epochs + 1):
        shifted = pixels + jitter_px * _PLACE * torch.randn_like(pixels) if jitter_px else pixels
        losses.append(_one_epoch(network, optimiser, rates, shifted, gradient, batch, recipe))
        progress(epoch, epochs, losses[-1])
    network.eval()
    return Training(
        network=network,
        losses=losses,
        epochs=epochs,
        rows=len(pixels),
        cpu_seconds=time.process_time() - started,
    )


def _tensors(table: Table, largest: int) -> tuple[Tensor, Tensor]:
    rows = torch.from_numpy(table.rows)
    if len(rows) > largest:
        rows = rows[torch.randperm(len(rows))[:largest]]
    return rows[:, :5].contiguous(), rows[:, 5:].contiguous()


def learning_rates(recipe: Recipe, *, steps: int) -> Iterator[float]:
    """Yield the learning rate of each step: linear warm-up, then half a cosine; or always the same."""
    rising = max(1, round(recipe.warm_up * steps))
    for step in range(steps):
        if recipe.warm_up == 0:
            factor = 1.0
        elif step < rising:
            factor = (step + 1) / rising
        else:
            factor = (1 + math.cos(math.pi * (step - rising) / max(1, steps - rising))) / 2
        yield recipe.learning_rate * factor


def _one_epoch(
    network: GelNet,
    optimiser: torch.optim.Optimizer,
    rates: Iterator[float],
    pixels: Tensor,
    gradient: Tensor,
    batch: int,
    recipe: Recipe,
) -> float:
    """See every row once in random order; return the mean loss."""
    order = torch.randperm(len(pixels))
    pixels, gradient = pixels[order], gradient[order]
    loss_of = _LOSSES[recipe.loss]
    total = 0.0
    for start in range(0, len(pixels), batch):
        seen, wanted = pixels[start : start + batch], gradient[start : start + batch]
        for group in optimiser.param_groups:
            group["lr"] = next(rates)
        loss = loss_of(answer(network, seen, zero_based=recipe.zero_based), wanted)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        total += float(loss.detach()) * len(seen)
    return total / len(pixels)


def answer(network: GelNet, pixels: Tensor, *, zero_based: bool) -> Tensor:
    """Return (N, 2) gradients; zero_based: less the answer to no colour change at the same places."""
    gradient: Tensor = network(pixels)
    if zero_based:
        unchanged = torch.cat([torch.zeros_like(pixels[:, :3]), pixels[:, 3:]], dim=1)
        gradient = gradient - network(unchanged)
    return gradient


def _gradient_loss(found: Tensor, wanted: Tensor) -> Tensor:
    return torch.mean(torch.abs(found - wanted))


def _normal_loss(found: Tensor, wanted: Tensor) -> Tensor:
    """Mean chord between unit normals, which is the angle for small angles and bounded for steep slopes."""
    squared = (_normal(found) - _normal(wanted)).square().sum(dim=1)
    return torch.mean(torch.sqrt(squared + 1e-6))


_LOSSES: dict[str, Loss] = {"gradient": _gradient_loss, "normal": _normal_loss}


def _normal(gradient: Tensor) -> Tensor:
    normal = torch.cat([-gradient, torch.ones_like(gradient[:, :1])], dim=1)
    return nn.functional.normalize(normal, dim=1)


def normal_error_deg(network: GelNet, table: Table, *, zero_based: bool = True) -> dict[str, float]:
    """Return mean, median and p95 of the angle between the network's normals and the table's, deg, over all rows."""
    with torch.no_grad():
        blocks = torch.split(torch.from_numpy(table.rows[:, :5]), 65536)
        found = _normal(torch.cat([answer(network, block, zero_based=zero_based) for block in blocks])).double()
    wanted = _normal(torch.from_numpy(table.rows[:, 5:])).double()
    across = torch.linalg.cross(found, wanted, dim=1).norm(dim=1)
    angle = np.degrees(torch.atan2(across, (found * wanted).sum(dim=1)).numpy())
    median, p95 = np.percentile(angle, [50, 95])
    return {"mean": float(angle.mean()), "median": float(median), "p95": float(p95)}


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Train as the command line asks, write the two files, and return the content of training.json.

    The error is measured on images that were held out; the network that is kept is that very network.
    """
    table = load_table(options.table)
    training, held_out = split_by_image(table, fraction=HELD_OUT, seed=options.seed)
    recipe = RECIPES[options.recipe]
    if options.epochs:
        recipe = replace(recipe, epochs=options.epochs, least_visits=0)
    trained = train(training, recipe, width=options.width, seed=options.seed, progress=print_progress)
    record = record_of(options.recipe, recipe, options.width, options.seed, trained, training, held_out)
    write(trained.network, record, table, options.out)
    return record


def record_of(
    name: str, recipe: Recipe, width: int, seed: int, trained: Training, training: Table, held_out: Table
) -> dict[str, Any]:
    """Return the content of training.json: how the network was trained, and its error on what was held out."""
    return {
        "recipe": name,
        **asdict(recipe),
        "width": width,
        "seed": seed,
        "epochs": trained.epochs,
        "rows": trained.rows,
        "images": len(np.unique(training.image)),
        "cpu_seconds": round(trained.cpu_seconds, 2),
        "losses": trained.losses,
        "held_out_images": np.unique(held_out.image).tolist(),
        "held_out_normal_error_deg": normal_error_deg(trained.network, held_out),
        "torch": torch.__version__,
    }


def write(network: GelNet, record: dict[str, Any], table: Table, folder: Path) -> None:
    """Write network.onnx and training.json into the folder, both or neither; raises ExportError or OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("network.onnx", "training.json")
    with tempfile.TemporaryDirectory(prefix=".training-", dir=folder) as place:
        partial = Path(place)
        summary = {key: str(record[key]) for key in ("recipe", "seed", "epochs", "rows", "images")}
        difference = export(network, partial / names[0], rows=table.rows[:, :5], summary=summary)
        text = json.dumps({**record, "export_difference_rad": difference}, indent=2) + "\n"
        (partial / names[1]).write_text(text)
        for name in names:
            (partial / name).replace(folder / name)


def print_progress(epoch: int, epochs: int, loss: float) -> None:
    """Say on stdout, as one line of JSON, how far training is."""
    print(json.dumps({"epoch": epoch, "epochs": epochs, "loss": loss}), flush=True)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m gelnet.train", description="Train GelNet on a table of presses.")
    parser.add_argument("--table", type=Path, required=True, help="npz with rows (N, 7), image (N,), image_size (2,)")
    parser.add_argument("--out", type=Path, required=True, help="folder for network.onnx and training.json")
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="fast")
    parser.add_argument("--width", type=int, default=DEFAULT_WIDTH, help="units in each hidden layer")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--epochs", type=int, help="instead of the recipe's number")
    parser.add_argument("--threads", type=int, default=1, help="of torch")
    options = parser.parse_args(arguments)
    for name in ("width", "threads"):
        if getattr(options, name) < 1:
            parser.error(f"--{name} {getattr(options, name)}: give at least 1")
    if options.epochs is not None and options.epochs < 1:
        parser.error(f"--epochs {options.epochs}: give at least 1")
    return options


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _arguments(arguments)
    torch.set_num_threads(options.threads)
    torch.set_deterministic_debug_mode("error")  # as use_deterministic_algorithms, which loads torch's compiler too
    try:
        run(options)
    except (TableError, ExportError, OSError) as error:
        print(f"gelnet.train: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
