"""`gellight calibrate`: train GelNet on ball presses, and measure what it is worth."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gellight.cli import calibrate_detect

if TYPE_CHECKING:
    from gellight.training.child import Progress
    from gellight.training.presses import Ball, Press
    from gellight.training.training import Reference, TrainingOptions

app = typer.Typer(
    name="calibrate",
    help="Calibrate a sensor: guided, step by step, or by itself; the verbs work on recorded images and on bundles.",
    no_args_is_help=True,
)

app.command("detect")(calibrate_detect.command)

Presses = Annotated[
    Path,
    typer.Option(help="csv with the columns image, center_x_px, center_y_px, contact_radius_px; images beside it"),
]
Untouched = Annotated[str, typer.Option(help="image of the untouched gel, or a folder of them, which is averaged")]
BallRadius = Annotated[float, typer.Option(help="radius of the pressed ball, mm")]
PixelSize = Annotated[float, typer.Option(help="mm per pixel on the gel")]
Recipe = Annotated[str, typer.Option(help="fast, thorough (three times as long), or paper (hours)")]
Width = Annotated[int, typer.Option(min=1, help="units in each hidden layer")]
Seed = Annotated[int, typer.Option(help="the same seed gives the same network")]
Epochs = Annotated[int | None, typer.Option(min=1, help="instead of the recipe's number")]
Threads = Annotated[int, typer.Option(min=1, help="of torch")]
Refine = Annotated[bool, typer.Option("--refine", help="refit the circles together with the light before training")]
Out = Annotated[Path, typer.Option(help="folder of the calibration bundle to write")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="replace an existing bundle")]
Previous = Annotated[
    str | None, typer.Option(help="earlier bundle of this sensor: refuses a ball of another size than it feels")
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object instead of text")]


@app.command()
def fit(
    presses: Presses,
    reference: Untouched,
    ball_radius_mm: BallRadius,
    pixel_size_mm: PixelSize,
    out: Out,
    sensor: Annotated[str, typer.Option(help="serial number or name of the sensor")] = "unnamed",
    recipe: Recipe = "thorough",
    width: Width = 32,
    seed: Seed = 0,
    epochs: Epochs = None,
    threads: Threads = 1,
    folds: Annotated[int, typer.Option(min=0, help="also measure the error by this many folds; 0: do not")] = 0,
    refine: Refine = False,
    overwrite: Overwrite = False,
    previous: Previous = None,
    as_json: Json = False,
) -> None:
    """Train on ball presses and write a calibration bundle."""
    from gellight.training import training

    options = _options(recipe, width, seed, epochs, threads)
    given = _read(presses, reference, ball_radius_mm, pixel_size_mm)
    _check_free(out, overwrite)
    extra = _which_ball(*given, previous)
    if folds:
        extra["cross_validation"] = _cross_validated(given, folds=folds, options=options, refine=refine)
    with _progress("training") as report:
        calibration = training.fit(
            *given,
            out,
            sensor=sensor,
            options=options,
            refine=refine,
            extra_metrics=extra,
            overwrite=overwrite,
            progress=report,
        )
    _print({"calibration": str(out), "metrics": calibration.metrics}, as_json, _fit_text)


@app.command()
def evaluate(
    presses: Presses,
    calibration: Annotated[str, typer.Option(help="bundle: folder, .gelcal file or 'synthetic'")],
    ball_radius_mm: Annotated[
        float | None, typer.Option(help="radius of the pressed ball, mm; as in the bundle where not given")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure the normal error of a bundle inside the contact circles of labelled presses, and the ball it feels."""
    from gellight.bundle.bundle import load_bundle
    from gellight.training import validation
    from gellight.training.labelling.ball_size import felt_radius_mm
    from gellight.training.presses import read_presses

    bundle = load_bundle(calibration)
    ball = _ball_of(bundle.metrics, bundle.pixel_size_mm, ball_radius_mm)
    labelled = read_presses(presses, ball=ball, image_shape=bundle.image_shape)
    result = {
        **validation.evaluate(bundle, labelled, ball).as_json(),
        "ball_radius_mm": ball.radius_mm,
        "felt_ball_radius_mm": felt_radius_mm(bundle, labelled),
    }
    _print(result, as_json, _error_text)


@app.command()
def crossvalidate(
    presses: Presses,
    reference: Untouched,
    ball_radius_mm: BallRadius,
    pixel_size_mm: PixelSize,
    folds: Annotated[int, typer.Option(min=2, help="parts the presses are divided into")] = 5,
    recipe: Recipe = "thorough",
    width: Width = 32,
    seed: Seed = 0,
    epochs: Epochs = None,
    threads: Threads = 1,
    refine: Refine = False,
    as_json: Json = False,
) -> None:
    """Measure the error on presses that were not trained on: each press once, in folds by image."""
    given = _read(presses, reference, ball_radius_mm, pixel_size_mm)
    options = _options(recipe, width, seed, epochs, threads)
    _print(_cross_validated(given, folds=folds, options=options, refine=refine), as_json, _error_text)


@app.command()
def synthetic(
    out: Out,
    width: Width = 32,
    seed: Seed = 0,
    threads: Threads = 1,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Make the bundle of the simulated sensor again, as it comes with GelLight."""
    from gellight.evaluation.synthetic import make_synthetic

    _check_free(out, overwrite)
    with _progress("training") as report:
        calibration = make_synthetic(out, width=width, seed=seed, threads=threads, overwrite=overwrite, progress=report)
    _print({"calibration": str(out), "metrics": calibration.metrics}, as_json, _synthetic_text)


def _options(recipe: str, width: int, seed: int, epochs: int | None, threads: int) -> "TrainingOptions":
    from gellight.training.training import RECIPES, TrainingOptions

    if recipe not in RECIPES:
        raise typer.BadParameter(f"{recipe!r}: give one of {', '.join(RECIPES)}", param_hint="--recipe")
    return TrainingOptions(recipe=recipe, width=width, seed=seed, epochs=epochs, threads=threads)


def _read(
    presses: Path, reference: str, ball_radius_mm: float, pixel_size_mm: float
) -> "tuple[list[Press], Reference, Ball]":
    from gellight.training.presses import Ball, read_presses
    from gellight.training.training import read_reference

    ball = Ball(radius_mm=ball_radius_mm, pixel_size_mm=pixel_size_mm)
    untouched = read_reference(reference)
    return read_presses(presses, ball=ball, image_shape=untouched.image_shape), untouched, ball


def _check_free(out: Path, overwrite: bool) -> None:
    """Say that a bundle exists before minutes of training, not after."""
    if out.exists() and not overwrite:
        raise typer.BadParameter(f"{out} exists: choose another name or give --overwrite", param_hint="--out")


def _which_ball(labelled: "list[Press]", untouched: "Reference", ball: "Ball", previous: str | None) -> dict[str, Any]:
    """What the light and an earlier bundle say of the radius; InputError where the bundle feels another ball."""
    from gellight.bundle.bundle import load_bundle
    from gellight.calibration.ball_radius import likely_radius_mm
    from gellight.frames.image_files import read_image
    from gellight.training.labelling.ball_size import check_ball

    images = [read_image(press.image) for press in labelled]
    found: dict[str, Any] = {"likely_ball_radius_mm": likely_radius_mm(images, labelled, untouched.image, ball)}
    if previous is not None:
        found["felt_ball_radius_mm"] = check_ball(load_bundle(previous), labelled, ball)
    return found


def _cross_validated(
    given: "tuple[list[Press], Reference, Ball]", *, folds: int, options: "TrainingOptions", refine: bool
) -> dict[str, Any]:
    from gellight.training.cross_validation import cross_validate

    with _progress("folds") as report:
        return cross_validate(*given, folds=folds, options=options, refine=refine, progress=report).as_json()


def _ball_of(metrics: dict[str, Any], pixel_size_mm: tuple[float, float], radius_mm: float | None) -> "Ball":
    from gellight.training.presses import Ball

    radius = radius_mm if radius_mm is not None else metrics.get("ball_radius_mm")
    if radius is None:
        raise typer.BadParameter("the bundle does not know its ball: give it", param_hint="--ball-radius-mm")
    if pixel_size_mm[0] != pixel_size_mm[1]:
        raise typer.BadParameter(
            f"the pixels of the bundle are {pixel_size_mm[0]} x {pixel_size_mm[1]} mm, a circle needs square ones",
            param_hint="--calibration",
        )
    return Ball(radius_mm=float(radius), pixel_size_mm=pixel_size_mm[0])


@contextmanager
def _progress(label: str) -> "Iterator[Progress]":
    """Show a bar where somebody looks, and nothing where the output goes to a file."""
    if not sys.stderr.isatty():
        yield lambda done, total, value: None
        return
    with typer.progressbar(length=1000, label=label, file=sys.stderr) as bar:
        shown = 0

        def report(done: int, total: int, value: float) -> None:
            nonlocal shown
            reached = round(1000 * done / total)
            bar.update(reached - shown)
            shown = reached

        yield report


def _print(result: dict[str, Any], as_json: bool, text: Any) -> None:
    typer.echo(json.dumps(result, indent=2) if as_json else text(result))


def _fit_text(result: dict[str, Any]) -> str:
    metrics = result["metrics"]
    training = metrics["training"]
    lines = [
        f"wrote {result['calibration']}",
        f"trained on {training['images']} images in {training['cpu_seconds']:.1f} CPU seconds; normal error on "
        f"{len(training['held_out_images'])} held-out images, each pixel alone: "
        f"{training['held_out_normal_error_deg']['mean']:.2f} deg",
    ]
    lines += _ball_text(metrics)
    if "cross_validation" in metrics:
        lines.append(_error_text(metrics["cross_validation"]))
    return "\n".join(lines)


def _ball_text(metrics: dict[str, Any]) -> list[str]:
    """Warn where the light in the imprints says another ball than the one that was named."""
    from gellight.calibration.ball_radius import is_another

    likely, named = metrics.get("likely_ball_radius_mm"), metrics["ball_radius_mm"]
    if likely is None or not is_another(likely, named):
        return []
    return [
        f"WARNING: the ball was named as {named:g} mm in radius, but the light in its imprints fits one of about "
        f"{likely:.1f} mm: measure the ball, and train again with its radius"
    ]


def _synthetic_text(result: dict[str, Any]) -> str:
    lines = [f"wrote {result['calibration']}, measured on simulated presses it was not trained on:"]
    lines += [f"{name:<28}{value:>10.4g}" for name, value in result["metrics"]["test"].items()]
    return "\n".join(lines)


def _error_text(result: dict[str, Any]) -> str:
    lines = [f"{'image':<24}{'pixels':>8}{'mean':>8}{'median':>8}{'p95':>8}  normal error, deg"]
    for image in [*result["images"], {"image": "all", "pixels": sum(i["pixels"] for i in result["images"]), **result}]:
        error = image["normal_error_deg"]
        lines.append(
            f"{image['image']:<24}{image['pixels']:>8}{error['mean']:>8.2f}{error['median']:>8.2f}{error['p95']:>8.2f}"
        )
    lines.append(
        f"depth error in contact {result['depth_mae_mm']:.4f} mm, contact patch IoU {result['contact_iou']:.2f}"
    )
    if "felt_ball_radius_mm" in result:
        lines.append(
            f"ball of {result['ball_radius_mm']:g} mm radius feels like {result['felt_ball_radius_mm']:.2f} mm"
        )
    for labels, figures in (("as labelled", result), ("labels refined", result.get("refined", {}))):
        ways = {"GelNet": figures, **figures.get("baselines", {})} if "baselines" in figures else {}
        lines += [_way_text(f"{name.replace('_', ' ')}, {labels}", way) for name, way in ways.items()]
    return "\n".join(lines)


def _way_text(name: str, figures: dict[str, Any]) -> str:
    error = figures["normal_error_deg"]
    return (
        f"{name:<36}{error['mean']:>8.2f}{error['median']:>8.2f}{error['p95']:>8.2f} deg"
        f"{figures['depth_mae_mm']:>10.4f} mm{figures['contact_iou']:>7.2f} IoU"
    )
