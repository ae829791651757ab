"""`gellight calibrate` itself: the guided routine in the terminal, and by itself on the simulated sensor."""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.bundle.store import BundleStore
from gellight.cli.calibrate.screen import follow
from gellight.cli.calibrate.training import Like, Training
from gellight.cli.ending import Ending
from gellight.cli.options import AsJson, Sensor, with_options
from gellight.cli.showing import show
from gellight.daemon.bundle_choice import sensor_name
from gellight.daemon.installing import install
from gellight.frames.camera import Camera
from gellight.frames.picture import PreparedCamera, chosen_steps
from gellight.frames.view import read_view
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.presets import PRESETS, preset_called
from gellight.lab.calibration.readiness import check_target
from gellight.lab.calibration.records import MeasuredLens, MeasuredPixelSize, PinGrid
from gellight.lab.calibration.routine import Routine
from gellight.lab.calibration.state import Identity, Steps, discard, kept_like, unfinished
from gellight.lab.calibration.tools import ToolSizes
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.lab.training.training import like_words
from gellight.opening import open_camera

PRESS_S = 2.5
"""that a press of the virtual hand takes, with its share of the training"""


@dataclass(frozen=True)
class Target:
    """The sensor that is calibrated, and where its bundle and its state are kept."""

    sensor: Sensor = None
    name: Annotated[str, typer.Option(help="What people call the sensor; it is known by its serial number.")] = ""
    out: Annotated[Path, typer.Option(help="Folder of the bundle to write.")] = Path("calibration")
    folder: Annotated[Path | None, typer.Option(help="Where the state is kept.", show_default="OUT.state")] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with an interrupted calibration.")] = False
    restart: Annotated[bool, typer.Option("--restart", help="Throw an interrupted calibration away.")] = False
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing bundle of this sensor.")] = False
    view: Annotated[
        Path | None, typer.Option(help="Of the gel, as `calibrate view` wrote it: a view.json.", show_default="all")
    ] = None
    dots: Annotated[
        bool, typer.Option("--dots", help="The gel has marker dots, which are filled; light it, and touch nothing.")
    ] = False
    install: Annotated[
        bool,
        typer.Option("--install/--no-install", help="Put what passes into service: kept, and remembered by the board."),
    ] = True

    @property
    def state(self) -> Path:
        """Folder of the state."""
        return self.folder or self.out.with_name(self.out.name + ".state")

    def camera(self, camera: Camera, begun: Identity | None = None) -> Camera:
        """Return the camera with the view taken and the dots filled, as asked for or as a calibration was begun with.

        InputError where there are none, or for another view or dots than it was begun with.
        """
        view = None if self.view is None else read_view(self.view)
        steps = begun.picture if begun else None
        if steps is None:
            steps = chosen_steps(camera, view, dots=self.dots)
        elif view is not None and view != steps.view:
            raise InputError(f"the interrupted calibration takes another view than {self.view}: leave --view out")
        elif self.dots and steps.dots is None:
            raise InputError("the interrupted calibration fills no marker dots: leave --dots out, or give --restart")
        return PreparedCamera(camera, steps) if steps else camera

    def begun(self) -> Identity | None:
        """Return what the interrupted calibration that is gone on with was begun with; None for a new one.

        Raises InputError unless it is clear what to do.
        """
        begun = unfinished(self.state)
        if self.resume and begun is None:
            raise InputError(
                f"there is no interrupted calibration in {self.state}: leave --resume out, or give its --folder"
            )
        if begun is not None and not (self.resume or self.restart):
            raise InputError(f"an interrupted calibration lies in {self.state}: give --resume to go on, or --restart")
        return None if self.restart else begun

    def installing(self, camera: Camera, options: RoutineOptions) -> Callable[[Bundle], None]:
        """Return what puts a bundle that passed into service, where that is asked for."""

        def serve(bundle: Bundle) -> None:
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
        float | None, typer.Option(help="Diameter of the flat-ended cylinder, mm.", show_default="8, or likewise")
    ] = None
    pin_pitch_mm: Annotated[
        float | None,
        typer.Option(
            help="Distance of two pins of a grid, mm: measures the distortion of the lens.", show_default="no grid"
        ),
    ] = None
    pixel_size_mm: Annotated[
        float | None,
        typer.Option(
            help="Size of a pixel on the gel, mm, where it is known.", show_default="the cylinder measures it"
        ),
    ] = None
    prism_angle_deg: Annotated[
        float | None,
        typer.Option(
            help="A prism, pressed edge first, verifies beside the ball: angle between each face and the gel at rest; "
            "45 for a cube.",
            show_default="no prism",
        ),
    ] = None
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"Kind of sensor, whose usual ball is taken: {', '.join(preset.name for preset in PRESETS)}.",
            show_default="none",
        ),
    ] = None

    def chosen(self, begun: Identity | None) -> ToolSizes:
        """Return the sizes given, else those the calibration was begun with, else the ball of the preset.

        Raises InputError for an unknown preset, and for a size that no tool can have.
        """
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
        typer.Option(
            help="Press no more once presses held out are felt to this, µm: the depth beside its contact's mean.",
            show_default="all presses",
        ),
    ] = None
    verifications: Annotated[int, typer.Option(help="Fresh ball presses that judge.")] = 6
    prism_presses: Annotated[int, typer.Option(help="Fresh presses of the prism that judge, where there is one.")] = 3
    largest_depth_error_um: Annotated[
        float, typer.Option(help="A calibration worse than this on fresh presses is not kept, µm.")
    ] = 80.0
    largest_normal_error_deg: Annotated[float, typer.Option(help="The same for the normals, degrees.")] = 7.0

    def limits(self) -> Limits:
        """Return what a calibration has to reach."""
        return Limits(depth_mm=self.largest_depth_error_um / 1000, normal_deg=self.largest_normal_error_deg)


@with_options
def command(
    context: typer.Context,
    target: Target,
    tools: Tools,
    wanted: Presses,
    how: Training,
    auto: Annotated[bool, typer.Option("--auto", help="A virtual hand presses: with --sensor sim://.")] = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate a sensor, and keep its bundles.

    Without a verb you are guided step by step, or with --auto a virtual hand presses. The verbs work on recorded
    images and on bundles.
    """
    if context.invoked_subcommand:
        return
    begun = target.begun()
    options = RoutineOptions(
        out=target.out,
        presses=wanted.presses,
        until_um=wanted.until_um,
        like=load_bundle(wanted.like) if wanted.like else kept_like(target.state) if begun else None,
        verifications=wanted.verifications,
        prism_presses=wanted.prism_presses,
        limits=wanted.limits(),
        training=how.options(),
        overwrite=target.overwrite,
        tools=tools.chosen(begun),
    )
    if auto:
        minutes = max(1, round((wanted.presses + wanted.verifications) * PRESS_S / 60))
        print(f"a virtual hand presses, and a network is trained: about {minutes} min", file=sys.stderr)
    begun_s = time.monotonic()
    ended = _calibrate(target, options, begun, hand_seed=how.seed if auto else None, quiet=as_json)
    _report(ended, target, time.monotonic() - begun_s, as_json)


def _calibrate(
    target: Target, options: RoutineOptions, begun: Identity | None, *, hand_seed: int | None, quiet: bool
) -> Routine:
    """Run the routine to its end and return it; hand_seed: of the virtual hand, None where a user presses."""
    settings = load_settings({"sensor.url": target.sensor})
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as opened:
        camera = target.camera(opened, begun)
        colours = settings.geometry.led_colours or options.led_colours
        thickness_mm = settings.geometry.gel_thickness_mm or options.gel_thickness_mm
        options = replace(
            options, sensor=sensor_name(camera), name=target.name, led_colours=colours, gel_thickness_mm=thickness_mm
        )
        if target.restart:
            check_target(options, target.state, camera.image_shape)
            discard(target.state)
        hand = None if hand_seed is None else hand_of(camera, seed=hand_seed)
        routine = Routine(camera, options, target.state, hand=hand, install=target.installing(camera, options))
        routine.act("start")
        try:
            follow(routine, target.state, interactive=hand is None, quiet=quiet)
        except KeyboardInterrupt:
            pass  # what was measured is kept
        finally:
            routine.stop()
            routine.join()
    if routine.error:
        raise routine.error
    if routine.display.step == "aborted":
        raise InputError(f"stopped; what was measured is kept in {target.state}: go on with --resume")
    return routine


def _report(routine: Routine, target: Target, seconds: float, as_json: bool) -> None:
    verdict, snapshot = routine.display.verdict, routine.snapshot()
    assert verdict is not None  # it has ended well
    kept = {name: snapshot[name] for name in ("figures", "verdict", "bundle")}
    figures = _figures_text(routine.display.figures)
    wrote = _written(Path(out), target.install) if (out := routine.display.bundle) else []
    text = "\n".join([verdict.text, *wrote, *figures, f"{seconds:.0f} s from start to end"])
    show({**kept, "seconds": round(seconds, 1)}, as_json, text)
    if not verdict.passed:
        print("gellight: the calibration did not pass: go on with --resume to press more", file=sys.stderr)
        raise typer.Exit(Ending.JUDGED_BAD)


def _written(out: Path, installed: bool) -> list[str]:
    service = "it is in service" if installed else f"`gellight calibrate install {out}` puts it into service"
    return [f"wrote {out}; its report: {out / 'report.html'}", service]


def _figures_text(steps: Steps) -> Iterator[str]:
    size, gel, fit, truth = steps.pixel_size, steps.reference, steps.fit, steps.verify
    assert size is not None
    assert gel is not None
    assert fit is not None
    assert truth is not None
    origin = "given, not measured"
    if isinstance(size, MeasuredPixelSize):
        origin = f"cylinder {size.diameter_px:.2f} px, spread {size.spread_px:.2f} px"
    yield f"pixel {size.x_mm:.5f} x {size.y_mm:.5f} mm ({origin}); noise {gel.noise_grey:.2f} grey levels"
    yield _lens_text(steps.lens)
    yield from like_words(fit.model_dump())
    if truth.true_depth_mm is not None:
        yield (
            f"against the simulator's truth: depth {1000 * truth.true_depth_mm:.1f} µm in contact, normals "
            f"{truth.true_normal_deg:.3f} degrees over the whole map"
        )


def _lens_text(lens: PinGrid | None) -> str:
    if not isinstance(lens, MeasuredLens):
        return "the lens was taken to be straight; a pin grid measures it (--pin-pitch-mm)"
    return (
        f"the lens moves a corner of the picture by {lens.corner_moves_px:.1f} px; {lens.pins} pins are "
        f"{lens.rms_after_px:.2f} px off it, {lens.rms_before_px:.2f} px off a straight one"
    )
