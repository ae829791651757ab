"""`gellight calibrate` itself: the guided routine in the terminal, and by itself on the simulated sensor."""

import json
import shutil
import sys
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gellight.errors import CalibrationError, InputError

if TYPE_CHECKING:
    from rich.console import RenderableType

    from gellight.calibrating.benchmark import ObjectError
    from gellight.calibrating.choices import RoutineOptions
    from gellight.calibrating.routine import Routine
    from gellight.calibration import Calibration
    from gellight.camera import Camera

Sensor = Annotated[str | None, typer.Option(help="URL of the sensor. [default: as in the settings, or sim://]")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object instead of text")]
POLL_S = 0.1
KEYS = "n: next or enough   d: drop the last press   c X Y R: correct its circle, px   a: accept   q: stop"
_ACTIONS = {"n": "next", "d": "drop", "c": "correct", "a": "accept", "q": "abort"}


def attach(app: typer.Typer) -> None:
    """Make the routine what `gellight calibrate` does without a verb, and add the verb `objects`."""
    app.callback(invoke_without_command=True, no_args_is_help=False)(command)
    app.command()(objects)


def command(
    context: typer.Context,
    auto: Annotated[bool, typer.Option("--auto", help="a virtual hand presses, on the simulated sensor")] = False,
    sensor: Sensor = None,
    name: Annotated[str | None, typer.Option(help="name of the sensor. [default: serial number of its board]")] = None,
    out: Annotated[Path, typer.Option(help="folder of the bundle to write")] = Path("calibration"),
    folder: Annotated[Path | None, typer.Option(help="where the state is kept. [default: OUT.state]")] = None,
    resume: Annotated[bool, typer.Option(help="go on with an interrupted calibration")] = False,
    restart: Annotated[bool, typer.Option(help="throw an interrupted calibration away")] = False,
    overwrite: Annotated[bool, typer.Option(help="replace an existing bundle of this sensor")] = False,
    install: Annotated[
        bool, typer.Option("--install", help="put what passes into service: kept, and remembered by the board")
    ] = False,
    ball_radius_mm: Annotated[float, typer.Option(help="radius of the ball, mm")] = 4.0,
    cylinder_diameter_mm: Annotated[float, typer.Option(help="diameter of the flat-ended cylinder, mm")] = 8.0,
    presses: Annotated[int, typer.Option(help="ball presses to learn from")] = 40,
    verifications: Annotated[int, typer.Option(help="fresh ball presses that judge")] = 6,
    largest_depth_error_um: Annotated[float, typer.Option(help="a calibration worse than this is not kept")] = 80.0,
    largest_normal_error_deg: Annotated[float, typer.Option(help="the same for the normals")] = 7.0,
    seed: Annotated[int, typer.Option(help="of the virtual hand's places and of the training")] = 0,
    recipe: Annotated[str, typer.Option(help="of the training: thorough, fast or paper")] = "thorough",
    threads: Annotated[int, typer.Option(min=1, help="of the training")] = 1,
    as_json: AsJson = False,
) -> None:
    """Calibrate a sensor: guided, step by step, or by itself; verbs work on recorded images."""
    if context.invoked_subcommand:
        return
    from gellight.calibrating.choices import Limits, RoutineOptions
    from gellight.training import RECIPES, TrainingOptions

    if recipe not in RECIPES:
        raise InputError(f"recipe {recipe!r}: give one of {', '.join(RECIPES)}")
    place = folder or out.with_name(out.name + ".state")
    _choose_state(place, resume=resume, restart=restart)
    options = RoutineOptions(
        out=out,
        ball_radius_mm=ball_radius_mm,
        cylinder_diameter_mm=cylinder_diameter_mm,
        presses=presses,
        verifications=verifications,
        limits=Limits(depth_mm=largest_depth_error_um / 1000, normal_deg=largest_normal_error_deg),
        training=TrainingOptions(recipe=recipe, seed=seed, threads=threads),
        overwrite=overwrite,
    )
    work = _Work(sensor, options, place, name=name, seed=seed if auto else None, install=install)
    result = _calibrate(work, quiet=as_json)
    typer.echo(json.dumps(result, indent=2) if as_json else _result_text(result))
    if not result["verdict"]["passed"]:
        raise CalibrationError("the calibration did not pass: go on with --resume to press more")


def objects(
    calibration: Annotated[str, typer.Option(help="bundle: folder, .gelcal file or 'synthetic'")],
    sensor: Sensor = None,
    press_depth_mm: Annotated[float, typer.Option(min=0.05, help="how deep the objects are pressed, mm")] = 0.3,
    rezero: Annotated[bool, typer.Option(help="record the untouched gel anew before, nothing else")] = False,
    as_json: AsJson = False,
) -> None:
    """Press the ten benchmark objects into the simulated sensor and measure the error of a bundle on each."""
    from gellight.calibrating.benchmark import object_errors, summary

    settings = _settings(sensor)
    geometry = settings.geometry.overrides()
    errors = object_errors(calibration, settings.sensor.url, geometry, press_depth_mm, rezero=rezero)
    result = {"calibration": calibration, "sensor": settings.sensor.url, "press_depth_mm": press_depth_mm}
    rows = [*errors, summary(errors)]
    typer.echo(json.dumps({**result, "objects": [vars(e) for e in rows]}, indent=2) if as_json else _object_text(rows))


def _settings(sensor: str | None) -> Any:
    from gellight.config import load_settings

    return load_settings({"sensor.url": sensor})


def _choose_state(place: Path, *, resume: bool, restart: bool) -> None:
    from gellight.calibrating.folder import has_state

    interrupted = has_state(place)
    if resume and not interrupted:
        raise InputError(f"there is no interrupted calibration in {place}: leave --resume out, or give its --folder")
    if interrupted and restart:
        shutil.rmtree(place)
    elif interrupted and not resume:
        raise InputError(f"an interrupted calibration lies in {place}: give --resume to go on, or --restart")


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

    def routine(self, camera: "Camera") -> "Routine":
        """Make the routine for the sensor behind a camera."""
        from gellight.bundle_store import BundleStore
        from gellight.calibrating.routine import Routine
        from gellight.calibrating.virtual_hand import hand_of
        from gellight.installing import install, sensor_name

        options = replace(self.options, sensor=self.name or sensor_name(camera))

        def serve(bundle: "Calibration") -> None:
            if self.install:
                install(bundle, sensor=options.sensor, store=BundleStore(), camera=camera, limits=options.limits)

        hand = None if self.seed is None else hand_of(camera, seed=self.seed)
        return Routine(camera, options, self.place, hand=hand, install=serve)


def _calibrate(work: _Work, *, quiet: bool) -> dict[str, Any]:
    """Run the routine to its end."""
    from gellight.camera import open_camera

    settings = _settings(work.sensor)
    begun_s = time.monotonic()
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        routine = work.routine(camera)
        routine.act("start")
        try:
            _follow(routine, work.place, interactive=work.seed is None, quiet=quiet)
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


def _follow(routine: "Routine", place: Path, *, interactive: bool, quiet: bool) -> None:
    """Show what the routine says until it ends, and hand it what the user types."""
    from rich.console import Console
    from rich.live import Live

    typed: SimpleQueue[str] = SimpleQueue()
    if interactive:
        threading.Thread(target=_read_lines, args=(typed,), daemon=True).start()
    console = Console(stderr=True, quiet=quiet)
    version, refusal = -1, ""
    with Live(console=console, auto_refresh=False, transient=False) as live:
        while not routine.ended:
            snapshot = routine.snapshot()
            if snapshot["version"] != version:
                version = snapshot["version"]
                live.update(_screen(snapshot, refusal, keys=interactive), refresh=console.is_terminal)
                if interactive and snapshot["press"]:
                    _show_press(routine, place)
            try:
                refusal = _obey(routine, typed.get(timeout=POLL_S))
            except Empty:
                continue
        live.update(_screen(routine.snapshot(), "", keys=False), refresh=True)


def _read_lines(typed: "SimpleQueue[str]") -> None:
    for line in sys.stdin:
        typed.put(line)


def _obey(routine: "Routine", line: str) -> str:
    """Do what a line asks for; returns why it cannot be done, empty otherwise."""
    words = line.split() or ["n"]
    action = _ACTIONS.get(words[0].lower(), words[0])
    try:
        numbers = [float(word) for word in words[1:]]
        names = ("center_x_px", "center_y_px", "contact_radius_px")
        routine.act(action, **dict(zip(names, numbers, strict=action == "correct")))
    except (InputError, ValueError) as error:
        return str(error)
    return ""


def _show_press(routine: "Routine", place: Path) -> None:
    """A terminal shows no pictures: the last press lies beside the state."""
    from gellight.pictures import write_png

    pictures = routine.pictures()
    for name in ("press", "cylinder"):
        if name in pictures:
            write_png(place / f"{name}.png", pictures[name])


def _screen(snapshot: dict[str, Any], refusal: str, *, keys: bool) -> "RenderableType":
    from rich.console import Group
    from rich.text import Text

    marks = {"done": "●", "now": "◐", "to do": "○"}
    head = "  ".join(f"{marks[step['state']]} {step['name'].replace('_', ' ')}" for step in snapshot["steps"])
    lines: list[RenderableType] = [Text(head, style="bold"), Text(snapshot["instruction"])]
    progress = snapshot["progress"]
    if progress.get("done") is not None:
        lines.append(Text(f"{progress['done']} of {progress['wanted']} {progress['unit']}", style="cyan"))
    if snapshot["awaiting"]:
        lines.append(Text({"press": "▼ press", "lift": "▲ lift"}[snapshot["awaiting"]], style="bold green"))
    press = snapshot["press"]
    if press:
        circle = ", ".join(f"{press[k]:.1f}" for k in ("center_x_px", "center_y_px", "contact_radius_px"))
        lines.append(Text(f"last press: centre and radius {circle} px ({press['state']})"))
    if snapshot["coverage"] and snapshot["step"] == "presses":
        lines.append(Text(_map(snapshot["coverage"]["places"]), style="green"))
    if snapshot["advice"]:
        lines.append(Text(snapshot["advice"], style="yellow"))
    lines += [Text(words, style="bold red") for words in (snapshot["problem"], refusal) if words]
    return Group(*lines, *([Text(KEYS, style="dim")] if keys else []))


def _map(places: list[list[int]]) -> str:
    return "\n".join(" ".join("·" if count == 0 else str(min(count, 9)) for count in row) for row in places)


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
    truth = figures["verify"]
    if "true_depth_mm" in truth:
        lines.append(
            f"against the simulator's truth: depth {1000 * truth['true_depth_mm']:.1f} µm in contact, normals "
            f"{truth['true_normal_deg']:.3f} degrees over the whole map"
        )
    return "\n".join([*lines, f"{result['seconds']:.0f} s from start to end"])


def _object_text(rows: "list[ObjectError]") -> str:
    lines = [
        f"{'':10}{'normals °':>20}{'depth mm':>22}",
        f"{'object':10}{'whole':>10}{'contact':>10}{'whole':>11}{'contact':>11}",
    ]
    for row in rows:
        lines.append(
            f"{row.object_name:10}{row.normal_deg:10.3f}{row.contact_normal_deg:10.3f}{row.depth_mm:11.4f}"
            f"{row.contact_depth_mm:11.4f}"
        )
    return "\n".join(lines)
