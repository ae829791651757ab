"""The guided routine in the terminal, from its begin to the report."""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli.calibrate.routine_options import Presses, Target, Tools
from gellight.cli.calibrate.screen import follow
from gellight.cli.calibrate.training_options import Training
from gellight.cli.ending import Ending
from gellight.cli.showing import show
from gellight.daemon.bundle_choice import sensor_name
from gellight.lab.calibration.choices import RoutineOptions
from gellight.lab.calibration.records import MeasuredPixelSize
from gellight.lab.calibration.routine import Routine
from gellight.lab.calibration.state import Identity, Steps, kept_like
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.lab.training.skirts import skirt_words
from gellight.lab.training.training import learnt_words
from gellight.opening import open_camera
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.window import seen_height_mm

PRESS_S = 2.5
"""that a press of the virtual hand takes, with its share of the training"""


def calibrate(target: Target, tools: Tools, wanted: Presses, how: Training, *, auto: bool, as_json: bool) -> None:
    """Calibrate the sensor of `target` and show what came of it; auto: a virtual hand presses."""
    begun = target.begun()
    options = RoutineOptions(
        out=target.out,
        presses=wanted.presses,
        until_um=wanted.until_um,
        like=load_bundle(wanted.like) if wanted.like else kept_like(target.state) if begun else None,
        verifications=wanted.verifications,
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
        thickness_mm = settings.geometry.gel_thickness_mm or options.gel_thickness_mm
        options = replace(
            options,
            sensor=sensor_name(camera),
            name=target.name,
            ring=RingGeometry.from_overrides(settings.geometry.overrides()),
            gel_thickness_mm=thickness_mm,
            camera_height_mm=seen_height_mm(settings.geometry.overrides()),
        )
        hand = None if hand_seed is None else hand_of(camera, seed=hand_seed)
        install = target.installing(camera, options)
        routine = Routine(camera, options, target.state, hand=hand, install=install, anew=target.restart)
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
    if routine.shown.step == "aborted":
        raise InputError(f"stopped; what was measured is kept in {target.state}: go on with --resume")
    return routine


def _report(routine: Routine, target: Target, seconds: float, as_json: bool) -> None:
    verdict, snapshot = routine.shown.verdict, routine.snapshot()
    assert verdict is not None  # it has ended well
    kept = {name: snapshot[name] for name in ("figures", "verdict", "bundle")}
    figures = _figures_text(routine.shown.figures)
    wrote = _written(Path(out), target.install) if (out := routine.shown.bundle) else []
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
    yield from (*learnt_words(fit.model_dump()), *skirt_words(fit.model_dump()))
    if truth.true_depth_mm is not None:
        yield (
            f"against the simulator's truth: depth {1000 * truth.true_depth_mm:.1f} µm in contact, normals "
            f"{truth.true_normal_deg:.3f} degrees over the whole map"
        )
