"""`gellight calibrate` itself: the guided routine in the terminal, and by itself on the simulated sensor."""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gellight.base.errors import BundleError, InputError
from gellight.cli import calibrate_objects

if TYPE_CHECKING:
    from gellight.bundle.bundle import Bundle
    from gellight.calibration.choices import RoutineOptions
    from gellight.calibration.routine import Routine
    from gellight.calibration.state import Identity
    from gellight.frames.camera import Camera

Sensor = Annotated[str | None, typer.Option(help="URL of the sensor.", show_default="as in the settings, or sim://")]
Name = Annotated[str | None, typer.Option(help="name of the sensor.", show_default="serial number of its board")]
Install = Annotated[
    bool, typer.Option("--install", help="put what passes into service: kept, and remembered by the board")
]
Out = Annotated[Path, typer.Option(help="folder of the bundle to write")]
State = Annotated[Path | None, typer.Option(help="where the state is kept.", show_default="OUT.state")]
BallRadius = Annotated[
    float | None,
    typer.Option(help="radius of the ball, mm.", show_default="4, or as the interrupted calibration has it"),
]
Cylinder = Annotated[
    float | None, typer.Option(help="diameter of the flat-ended cylinder, mm.", show_default="8, or likewise")
]
PinPitch = Annotated[
    float | None,
    typer.Option(
        help="distance of two pins of a grid, mm: measures the distortion of the lens.", show_default="no grid"
    ),
]
Presses = Annotated[int, typer.Option(help="ball presses to learn from")]
Verifications = Annotated[int, typer.Option(help="fresh ball presses that judge")]
DepthLimit = Annotated[float, typer.Option(help="a calibration worse than this on fresh presses is not kept, µm")]
NormalLimit = Annotated[float, typer.Option(help="the same for the normals, degrees")]
Seed = Annotated[int, typer.Option(help="of the virtual hand's places and of the training")]
Recipe = Annotated[str, typer.Option(help="of the training: thorough, fast or paper")]
Threads = Annotated[int, typer.Option(min=1, help="of the training")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object instead of text")]


def attach(app: typer.Typer) -> None:
    """Make the routine what `gellight calibrate` does without a verb, and add the verb `objects`."""
    app.callback(invoke_without_command=True, no_args_is_help=False)(command)
    app.command("objects")(calibrate_objects.command)


def command(
    context: typer.Context,
    auto: Annotated[bool, typer.Option("--auto", help="a virtual hand presses, on the simulated sensor")] = False,
    sensor: Sensor = None,
    name: Name = None,
    out: Out = Path("calibration"),
    folder: State = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with an interrupted calibration")] = False,
    restart: Annotated[bool, typer.Option("--restart", help="throw an interrupted calibration away")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an existing bundle of this sensor")] = False,
    install: Install = False,
    ball_radius_mm: BallRadius = None,
    cylinder_diameter_mm: Cylinder = None,
    pin_pitch_mm: PinPitch = None,
    presses: Presses = 40,
    verifications: Verifications = 6,
    largest_depth_error_um: DepthLimit = 80.0,
    largest_normal_error_deg: NormalLimit = 7.0,
    seed: Seed = 0,
    recipe: Recipe = "thorough",
    threads: Threads = 1,
    as_json: AsJson = False,
) -> None:
    """Calibrate a sensor: guided, step by step, or by itself; the verbs work on recorded images and on bundles."""
    if context.invoked_subcommand:
        return
    from gellight.calibration.choices import Limits, RoutineOptions
    from gellight.calibration.state import discard

    place = folder or out.with_name(out.name + ".state")
    begun = _begun(place, resume=resume, restart=restart)
    tools = _tools(begun, ball_radius_mm, cylinder_diameter_mm, pin_pitch_mm)
    limits = Limits(depth_mm=largest_depth_error_um / 1000, normal_deg=largest_normal_error_deg)
    options = RoutineOptions(
        out=out,
        presses=presses,
        verifications=verifications,
        limits=limits,
        training=_training(recipe, seed, threads),
        overwrite=overwrite,
        **tools,
    )
    if restart:
        discard(place)
    work = _Work(sensor, options, place, name=name, seed=seed if auto else None, install=install)
    _tell(_calibrate(work, quiet=as_json), as_json)


def _tools(begun: "Identity | None", ball: float | None, cylinder: float | None, pins: float | None) -> dict[str, Any]:
    """What was given, else what the interrupted calibration was begun with; the rest is left to the defaults."""
    given = {"ball_radius_mm": ball, "cylinder_diameter_mm": cylinder, "pin_pitch_mm": pins}
    chosen = {name: getattr(begun, name, None) if value is None else value for name, value in given.items()}
    return {name: value for name, value in chosen.items() if value is not None}


def _training(recipe: str, seed: int, threads: int) -> Any:
    from gellight.training.training import RECIPES, TrainingOptions

    if recipe not in RECIPES:
        raise InputError(f"recipe {recipe!r}: give one of {', '.join(RECIPES)}")
    return TrainingOptions(recipe=recipe, seed=seed, threads=threads)


def _begun(place: Path, *, resume: bool, restart: bool) -> "Identity | None":
    """Return what the interrupted calibration that is gone on with was begun with; None for a new one."""
    from gellight.calibration.state import unfinished

    begun = unfinished(place)
    if resume and begun is None:
        raise InputError(f"there is no interrupted calibration in {place}: leave --resume out, or give its --folder")
    if begun is not None and not (resume or restart):
        raise InputError(f"an interrupted calibration lies in {place}: give --resume to go on, or --restart")
    return None if restart else begun


@dataclass(frozen=True)
class _Work:
    """What one call is to do."""

    sensor: str | None
    options: "RoutineOptions"
    place: Path
    name: str | None
    seed: int | None
    """of the virtual hand; None where a user presses"""
    install: bool

    def routine(self, camera: "Camera", led_colours: str | None) -> "Routine":
        """Make the routine for the sensor behind a camera, and the colours of its ring where the settings tell them."""
        from gellight.bundle.store import BundleStore
        from gellight.calibration.routine import Routine
        from gellight.daemon.installing import install, sensor_name
        from gellight.simulator.virtual_hand import hand_of

        options = replace(self.options, sensor=self.name or sensor_name(camera))
        if led_colours:
            options = replace(options, led_colours=led_colours)

        def serve(bundle: "Bundle") -> None:
            if self.install:
                install(bundle, sensor=options.sensor, store=BundleStore(), camera=camera, limits=options.limits)

        hand = None if self.seed is None else hand_of(camera, seed=self.seed)
        return Routine(camera, options, self.place, hand=hand, install=serve)


def _calibrate(work: _Work, *, quiet: bool) -> dict[str, Any]:
    """Run the routine to its end."""
    from gellight.base.settings import load_settings
    from gellight.cli.calibrate_screen import follow
    from gellight.opening import open_camera

    settings = load_settings({"sensor.url": work.sensor})
    begun_s = time.monotonic()
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        routine = work.routine(camera, settings.geometry.led_colours)
        routine.act("start")
        try:
            follow(routine, work.place, interactive=work.seed is None, quiet=quiet)
        except KeyboardInterrupt:
            routine.stop()
        routine.join()
    if routine.error:
        raise routine.error
    snapshot = routine.snapshot()
    if snapshot["step"] == "aborted":
        raise InputError(f"stopped; what was measured is kept in {work.place}: go on with --resume")
    kept = ("figures", "verdict", "bundle")
    return {**{name: snapshot[name] for name in kept}, "seconds": round(time.monotonic() - begun_s, 1)}


def _tell(result: dict[str, Any], as_json: bool) -> None:
    typer.echo(json.dumps(result, indent=2) if as_json else _result_text(result))
    if not result["verdict"]["passed"]:
        raise BundleError("the calibration did not pass: go on with --resume to press more")


def _lens_text(lens: dict[str, Any]) -> str:
    if not lens.get("pictures"):
        return "the lens was taken to be straight; a pin grid measures it (--pin-pitch-mm)"
    return (
        f"the lens moves a corner of the picture by {lens['corner_moves_px']:.1f} px; {lens['pins']} pins are "
        f"{lens['rms_after_px']:.2f} px off it, {lens['rms_before_px']:.2f} px off a straight one"
    )


def _result_text(result: dict[str, Any]) -> str:
    figures = result["figures"]
    size = figures["pixel_size"]
    lines = [result["verdict"]["text"]]
    if result["bundle"]:
        lines.append(f"wrote {result['bundle']}; its report: {Path(result['bundle']) / 'report.html'}")
    lines.append(
        f"pixel {size['x_mm']:.5f} x {size['y_mm']:.5f} mm (cylinder {size['diameter_px']:.2f} px, spread "
        f"{size['spread_px']:.2f} px); noise {figures['reference']['noise_grey']:.2f} grey levels"
    )
    lines.append(_lens_text(figures.get("lens", {})))
    truth = figures["verify"]
    if "true_depth_mm" in truth:
        lines.append(
            f"against the simulator's truth: depth {1000 * truth['true_depth_mm']:.1f} µm in contact, normals "
            f"{truth['true_normal_deg']:.3f} degrees over the whole map"
        )
    return "\n".join([*lines, f"{result['seconds']:.0f} s from start to end"])
