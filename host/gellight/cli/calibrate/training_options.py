"""On what and how a network is trained, as options: apart from what trains, which takes a second to import."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.base.errors import InputError
from gellight.lab.training.child import RECIPES

if TYPE_CHECKING:
    from gellight.lab.training.training import TrainingOptions

training_option = partial(typer.Option, rich_help_panel="Training")
Like = Annotated[
    str | None, training_option(help="bundle of a like unit: with few presses of this one, its presses help")
]

Labels = Annotated[
    Path, typer.Option(help="csv with the columns image, center_x_px, center_y_px, contact_radius_px; images beside it")
]


@dataclass(frozen=True)
class Recorded:
    """Labelled pictures of ball presses, and of the untouched gel."""

    presses: Labels
    reference: Annotated[str, typer.Option(help="image of the untouched gel, or a folder of them, which is averaged")]
    ball_radius_mm: Annotated[float, typer.Option(help="radius of the pressed ball, mm")]
    pixel_size_mm: Annotated[float, typer.Option(help="mm per pixel on the gel")]
    refine: Annotated[
        bool, training_option("--refine", help="move each circle to where its picture shows the edge")
    ] = False
    like: Like = None
    lights: Annotated[
        str | None, training_option(help="earlier bundle of this sensor that knows the light of its LEDs (lights.json)")
    ] = None


@dataclass(frozen=True)
class Training:
    """How a network is trained."""

    recipe: Annotated[str, training_option(help="fast; thorough (3 times as long); fine and paper: longer")] = (
        "thorough"
    )
    seed: Annotated[int, training_option(help="the same seed gives the same network")] = 0

    def __post_init__(self) -> None:
        """Refuse a recipe that there is not, before anything is computed."""
        if self.recipe not in RECIPES:
            raise InputError(f"recipe {self.recipe!r}: give one of {', '.join(RECIPES)}")

    def options(self) -> "TrainingOptions":
        """Return them as the training takes them."""
        from gellight.lab.training.training import TrainingOptions  # not for the help: a second

        return TrainingOptions(**vars(self))


@dataclass(frozen=True)
class SizedTraining(Training):
    """How a network of any size is trained."""

    width: Annotated[int, training_option(min=1, help="units in each hidden layer")] = 32
    epochs: Annotated[int | None, training_option(min=1, help="instead of the recipe's number")] = None
