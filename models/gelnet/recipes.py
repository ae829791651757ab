"""How GelNet is trained: the recipes, and the learning rate of each step.

In every recipe the loss is of the answer to a pixel less the answer to an unchanged pixel at the same place: the host
subtracts it from every frame. The paper does not mention it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How to train."""

    loss: str
    """"gradient": mean absolute difference of the gradients; "normal": mean chord between the unit normals"""
    learning_rate: float
    batch: int
    epochs: int
    least_visits: int
    """a small table is seen more often than `epochs`, until this many rows have been seen, or, of few presses,
    `PRESS_VISITS` a press: these are learnt by heart by then"""
    weight_decay: float
    """Each step shrinks every weight by this times the learning rate (AdamW, Loshchilov and Hutter 2019). A network of
    small weights bends little: it is answered from cells, and errs less on colours that no press had"""
    dropout: float
    largest_table: int
    """more rows than that are thinned out at random"""
    warm_up: float
    """fraction of the steps in which the learning rate rises; then it falls as a cosine. 0: it stays as it is"""
    place_jitter: float
    """standard deviation of a random shift of each pixel's place, in mean distances between presses: light changes
    slowly over the gel, and a few presses must not be taken for a map of it"""


RECIPES = {
    # Section 3.2.4 of the paper: L1, Adam 1e-6, batch 128, 150 epochs, dropout before the last layer.
    "paper": Recipe(
        loss="gradient",
        learning_rate=1e-6,
        batch=128,
        epochs=150,
        least_visits=0,
        weight_decay=0.0,
        dropout=0.1,
        largest_table=10**9,
        warm_up=0,
        place_jitter=0.0,
    ),
    "fast": Recipe(
        loss="normal",
        learning_rate=5e-3,
        batch=2048,
        epochs=10,
        least_visits=1_000_000,
        weight_decay=0.0,
        dropout=0.0,
        largest_table=500_000,
        warm_up=0.05,
        place_jitter=0.5,
    ),
    # For labels that are right to a pixel: steps twice as large, three times as many, and hardly any jitter.
    "thorough": Recipe(
        loss="normal",
        learning_rate=1e-2,
        batch=2048,
        epochs=10,
        least_visits=3_000_000,
        weight_decay=0.0,
        dropout=0.0,
        largest_table=500_000,
        warm_up=0.05,
        place_jitter=0.2,
    ),
    # For many presses with labels without error, those of a simulator: many small steps, every row, no jitter.
    "fine": Recipe(
        loss="normal",
        learning_rate=3.5e-3,
        batch=256,
        epochs=28,
        least_visits=0,
        weight_decay=0.01,
        dropout=0.0,
        largest_table=10**9,
        warm_up=0.05,
        place_jitter=0.0,
    ),
}
DEFAULT_WIDTH = 32
PRESS_VISITS, FEWEST_VISITS = 200_000, 400_000
"""rows a press; rows of the fewest presses"""


def visits(recipe: Recipe, presses: int) -> int:
    """Return how many rows of a table are seen at least."""
    return min(recipe.least_visits, max(FEWEST_VISITS, PRESS_VISITS * presses))


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
