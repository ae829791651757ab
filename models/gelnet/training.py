"""The training of GelNet, whichever trainer takes the steps: batches, learning rates, errors, files."""

import json
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gelnet.export import export
from gelnet.parameters import PLACE, Floats, Parameters
from gelnet.recipes import Recipe, learning_rates, visits
from gelnet.table import Table


class Trainer(Protocol):
    """A network that learns, and the source of its random numbers."""

    version: str
    """the library that computes, and its version"""

    def order(self, count: int) -> NDArray[np.intp]:
        """Return the numbers below `count` in random order."""

    def normal(self, count: int, inputs: int) -> Floats:
        """Return (count, inputs) random numbers of mean 0 and standard deviation 1."""

    def begin(self, pixels: Floats, gradient: Floats, *, width: int, recipe: Recipe) -> None:
        """Start with random weights; the range of inputs and output is that of the training rows."""

    def step(self, pixels: Floats, gradient: Floats, rate: float) -> float:
        """Learn from a batch, (n, C + 2) and (n, 2), at this learning rate; return its loss before the step."""

    def answer(self, pixels: Floats) -> Floats:
        """Return the (N, 2) gradients of (N, C + 2) pixels."""

    def parameters(self) -> Parameters:
        """Return what has been learnt so far."""


@dataclass(frozen=True, kw_only=True)
class Training:
    """A trained network and how it came about."""

    network: Trainer
    losses: list[float]
    """mean loss of each epoch"""
    epochs: int
    rows: int
    cpu_seconds: float


def train(
    table: Table,
    recipe: Recipe,
    trainer: Trainer,
    *,
    width: int,
    progress: Callable[[int, int, float], None] = lambda epoch, epochs, loss: None,
) -> Training:
    """Train a network on every row of the table.

    A trainer made with the same seed gives the same network on the same machine. progress is called with
    (epoch, epochs, loss) after each epoch.
    """
    started = time.process_time()
    if len(table.rows) > recipe.largest_table:
        table = table.chosen(trainer.order(len(table.rows))[: recipe.largest_table])
    pixels, gradient = table.pixels, table.gradient
    trainer.begin(pixels, gradient, width=width, recipe=recipe)
    epochs = max(recipe.epochs, math.ceil(visits(recipe, len(np.unique(table.image))) / len(pixels)))
    batch = min(recipe.batch, len(pixels))
    rates = learning_rates(recipe, steps=epochs * math.ceil(len(pixels) / batch))
    losses: list[float] = []
    jitter_px = recipe.place_jitter * table.press_distance_px
    places = np.array([*[0] * (pixels.shape[1] - len(PLACE)), *[1] * len(PLACE)], np.float32)
    for epoch in range(1, epochs + 1):
        shifted = pixels + jitter_px * places * trainer.normal(*pixels.shape) if jitter_px else pixels
        losses.append(_one_epoch(trainer, shifted, gradient, batch, rates))
        progress(epoch, epochs, losses[-1])
    return Training(
        network=trainer,
        losses=losses,
        epochs=epochs,
        rows=len(pixels),
        cpu_seconds=time.process_time() - started,
    )


def _one_epoch(trainer: Trainer, pixels: Floats, gradient: Floats, batch: int, rates: Iterator[float]) -> float:
    """Learn from every row once in random order; return the mean loss."""
    order = trainer.order(len(pixels))
    pixels, gradient = pixels[order], gradient[order]
    total = 0.0
    for start in range(0, len(pixels), batch):
        part = slice(start, start + batch)
        total += trainer.step(pixels[part], gradient[part], next(rates)) * len(pixels[part])
    return total / len(pixels)


def unchanged(pixels: Floats) -> Floats:
    """Return the (N, C + 2) pixels at the same places without any change."""
    place = pixels[:, -len(PLACE) :]
    return np.concatenate([np.zeros_like(pixels[:, : -len(PLACE)]), place], axis=1)


def normal_error_deg(network: Trainer, table: Table) -> dict[str, float]:
    """Return mean, median and p95 of the angle between the network's normals and the table's, deg, over all rows.

    The answer to no colour change at the same place is subtracted, as the host does.
    """
    pixels = table.pixels
    found, wanted = _normal(network.answer(pixels) - network.answer(unchanged(pixels))), _normal(table.gradient)
    across = np.linalg.norm(np.cross(found, wanted), axis=1)
    angle = np.degrees(np.arctan2(across, (found * wanted).sum(axis=1)))
    median, p95 = np.percentile(angle, [50, 95])
    return {"mean": float(angle.mean()), "median": float(median), "p95": float(p95)}


def _normal(gradient: Floats) -> NDArray[np.float64]:
    """Return the (N, 3) unit normals."""
    normal = np.concatenate([-gradient.astype(np.float64), np.ones((len(gradient), 1))], axis=1)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def record_of(name: str, recipe: Recipe, width: int, seed: int, trained: Training, table: Table) -> dict[str, Any]:
    """Return how the network was trained, for training.json."""
    return {
        "recipe": name,
        **asdict(recipe),
        "width": width,
        "seed": seed,
        "epochs": trained.epochs,
        "rows": trained.rows,
        "images": len(np.unique(table.image)),
        "cpu_seconds": round(trained.cpu_seconds, 2),
        "losses": trained.losses,
        "trainer": trained.network.version,
    }


def write(network: Trainer, record: dict[str, Any], table: Table, folder: Path) -> None:
    """Write network.onnx and training.json into the folder, both or neither; raises ExportError or OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("network.onnx", "training.json")
    with tempfile.TemporaryDirectory(prefix=".training-", dir=folder) as place:
        partial = Path(place)
        summary = {key: str(record[key]) for key in ("recipe", "seed", "epochs", "rows", "images")}
        difference = export(
            network.parameters(), partial / names[0], rows=table.pixels, answer=network.answer, summary=summary
        )
        text = json.dumps({**record, "export_difference_rad": difference}, indent=2) + "\n"
        (partial / names[1]).write_text(text)
        for name in names:
            (partial / name).replace(folder / name)


def print_progress(epoch: int, epochs: int, loss: float) -> None:
    """Say on stdout, as one line of JSON, how far training is."""
    print(json.dumps({"epoch": epoch, "epochs": epochs, "loss": loss}), flush=True)
