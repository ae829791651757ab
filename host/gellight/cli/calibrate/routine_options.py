"""The options of the guided routine: the sensor, the tools at hand, and what has to be reached."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.calibrate.training_options import Like
from gellight.cli.options import Sensor, rare_option
from gellight.lab.calibration.presets import PRESETS, preset_called

if TYPE_CHECKING:
    from gellight.bundle.bundle import Bundle
    from gellight.bundle.limits import Limits
    from gellight.frames.camera import Camera
    from gellight.lab.calibration.choices import RoutineOptions, ToolSizes
    from gellight.lab.calibration.state import Identity


@dataclass(frozen=True)
class Target:
    """The sensor that is calibrated, and where its bundle and its state are kept."""

    sensor: Sensor = None
    name: Annotated[str, rare_option(help="What people call the sensor; it is known by its serial number.")] = ""
    out: Annotated[Path, typer.Option(help="Folder of the bundle to write; the state is kept in OUT.state.")] = Path(
        "calibration"
    )
    resume: Annotated[bool, rare_option("--resume", help="Go on with an interrupted calibration.")] = False
    restart: Annotated[bool, rare_option("--restart", help="Throw an interrupted calibration away.")] = False
    overwrite: Annotated[bool, rare_option("--overwrite", help="Replace an existing bundle of this sensor.")] = False
    view: Annotated[
        Path | None, rare_option(help="Of the gel, as `calibrate view` wrote it: a view.json.", show_default="all")
    ] = None
    dots: Annotated[
        bool, rare_option("--dots", help="The gel has marker dots, which are filled; light it, and touch nothing.")
    ] = False
    install: Annotated[
        bool,
        rare_option("--install/--no-install", help="Put what passes into service: kept, and remembered by the board."),
    ] = True

    @property
    def state(self) -> Path:
        """Folder of the state."""
        return self.out.with_name(self.out.name + ".state")

    def camera(self, camera: "Camera", begun: "Identity | None" = None) -> "Camera":
        """Return the camera with the view taken and the dots filled, as asked for or as a calibration was begun with.

        InputError where there are none, or for another view or dots than it was begun with.
        """
        from gellight.frames.picture import PreparedCamera, chosen_steps  # these are not for the help: a second
        from gellight.frames.view import read_view

        view = None if self.view is None else read_view(self.view)
        steps = begun.picture if begun else None
        if steps is None:
            steps = chosen_steps(camera, view, dots=self.dots)
        elif view is not None and view != steps.view:
            raise InputError(f"the interrupted calibration takes another view than {self.view}: leave --view out")
        elif self.dots and steps.dots is None:
            raise InputError("the interrupted calibration fills no marker dots: leave --dots out, or give --restart")
        return PreparedCamera(camera, steps) if steps else camera

    def begun(self) -> "Identity | None":
        """Return what the interrupted calibration that is gone on with was begun with; None for a new one.

        Raises InputError unless it is clear what to do.
        """
        from gellight.lab.calibration.state import unfinished

        begun = unfinished(self.state)
        if self.resume and begun is None:
            raise InputError(
                f"there is no interrupted calibration in {self.state}: leave --resume out, or give its --out"
            )
        if begun is not None and not (self.resume or self.restart):
            raise InputError(f"an interrupted calibration lies in {self.state}: give --resume to go on, or --restart")
        return None if self.restart else begun

    def installing(self, camera: "Camera", options: "RoutineOptions") -> "Callable[[Bundle], None]":
        """Return what puts a bundle that passed into service, where that is asked for."""

        from gellight.bundle.store import BundleStore
        from gellight.daemon.installing import install

        def serve(bundle: "Bundle") -> None:
            if self.install:
                install(bundle, sensor=options.sensor, store=BundleStore(), camera=camera, limits=options.limits)

        return serve


@dataclass(frozen=True)
class Tools:
    """The tools at hand."""

    ball_radius_mm: Annotated[
        float | None,
        typer.Option(help="Radius of the ball, mm.", show_default="4, or as the interrupted calibration has it"),
    ] = None
    cylinder_diameter_mm: Annotated[
        float | None, rare_option(help="Diameter of the flat-ended cylinder, mm.", show_default="8, or likewise")
    ] = None
    pixel_size_mm: Annotated[
        float | None,
        rare_option(help="Size of a pixel on the gel, mm, where it is known.", show_default="the cylinder measures it"),
    ] = None
    preset: Annotated[
        str | None,
        rare_option(
            help=f"Kind of sensor, whose usual ball is taken: {', '.join(preset.name for preset in PRESETS)}.",
            show_default="none",
        ),
    ] = None

    def chosen(self, begun: "Identity | None") -> "ToolSizes":
        """Return the sizes given, else those the calibration was begun with, else the ball of the preset.

        Raises InputError for an unknown preset, and for a size that no tool can have.
        """
        from gellight.lab.calibration.choices import ToolSizes

        preset = preset_called(self.preset) if self.preset else None
        given = {name: size for name, size in vars(self).items() if name != "preset" and size is not None}
        if begun is not None:
            return ToolSizes.of({**begun.sizes(), **given})
        ball = {"ball_radius_mm": preset.ball_radius_mm} if preset and preset.ball_radius_mm else {}
        return ToolSizes.of({**ball, **given})


@dataclass(frozen=True)
class Presses:
    """How many presses there are, what they begin with, and how well they have to be felt."""

    presses: Annotated[int, typer.Option(help="Ball presses to learn from.")] = 40
    like: Like = None
    until_um: Annotated[
        float | None,
        rare_option(
            help="Press no more once presses held out are felt to this, µm: the depth beside its contact's mean.",
            show_default="all presses",
        ),
    ] = None
    verifications: Annotated[int, rare_option(help="Fresh ball presses that judge.")] = 6
    largest_depth_error_um: Annotated[
        float, rare_option(help="A calibration worse than this on fresh presses is not kept, µm.")
    ] = 80.0
    largest_normal_error_deg: Annotated[float, rare_option(help="The same for the normals, degrees.")] = 7.0

    def limits(self) -> "Limits":
        """Return what a calibration has to reach."""
        from gellight.bundle.limits import Limits

        return Limits(depth_mm=self.largest_depth_error_um / 1000, normal_deg=self.largest_normal_error_deg)
