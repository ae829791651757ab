"""Training GelNet on labelled presses, and measuring what it is worth."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import typer

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.calibrate.told_ball import told_ball, told_layer
from gellight.cli.calibrate.training_options import Recorded, SizedTraining
from gellight.cli.ending import Ending
from gellight.cli.options import NewBundle
from gellight.cli.showing import progress, show
from gellight.frames.picture import PictureSteps
from gellight.frames.view import View, read_view
from gellight.lab.training import validation
from gellight.lab.training.judged_fit import fit_judged
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.pixel_ratio import PixelRatio, pixel_ratio
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.level_light import lights_of_unit
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.skirts import skirt_words
from gellight.lab.training.training import Learning, Reference, learnt_words, read_reference
from gellight.lab.training.validation import AngleFigures, ImageFigures, IndentationFigures, PressFigures, felt_ball
from gellight.lab.training.wrong_labels import contradicted_lines, sorted_out
from gellight.photometric.lights_file import has_lights

SMALLER = "smaller_view"
"""in the metrics: of the labelled pictures, where they were too large"""
Given = tuple[list[Press], Reference, Ball]
"""what a network is trained on"""


def fit(
    recorded: Recorded,
    bundle: NewBundle,
    how: SizedTraining,
    *,
    sensor: str,
    view: Path | None,
    largest_deg: float,
    keep: bool,
    as_json: bool,
) -> None:
    """Train on what was recorded, write the bundle, and show the verdict of presses that were kept apart."""
    labelled, untouched, ball = read(recorded)
    presses, contradicted = sorted_out(labelled, untouched, ball, keep=keep)
    extra = {**contradicted, **_pixels(presses, untouched, ball)}
    if untouched.view:
        extra[SMALLER] = untouched.view.model_dump()
    if recorded.refine:
        refined = refine(presses, untouched.image, ball)
        presses, extra["refinement"] = refined.presses, refined.record()
    with progress("training") as report:
        written = fit_judged(
            presses,
            untouched,
            ball,
            bundle.out,
            sensor=sensor,
            how=_learning(recorded, untouched, how),
            view=_whole_view(untouched.view, None if view is None else read_view(view)),
            extra_metrics=extra,
            layer=told_layer(),
            overwrite=bundle.overwrite,
            progress=report,
        )
    bad = _bad_verdict(written, largest_deg)
    lines = [f"wrote {bundle.out}", *_fit_lines(written), *bad]
    show({"calibration": str(bundle.out), "metrics": written.metrics}, as_json, "\n".join(lines))
    if bad:
        raise typer.Exit(Ending.JUDGED_BAD)


def read(recorded: Recorded) -> Given:
    """Return what a network is trained on; raises InputError for what cannot be used."""
    ball = told_ball(recorded.ball_radius_mm, recorded.pixel_size_mm)
    untouched = read_reference(recorded.reference, bounded=True)
    shape, dots, view = untouched.image_shape, untouched.dots, untouched.view
    if view:
        ball = replace(ball, pixel_size_mm=ball.pixel_size_mm / view.scale)
    return read_presses(recorded.presses, ball=ball, image_shape=shape, dots=dots, view=view), untouched, ball


def _learning(recorded: Recorded, untouched: Reference, how: SizedTraining) -> Learning:
    """Return how is learnt from them; InputError or BundleError for a bundle that cannot be used."""
    like = load_bundle(recorded.like) if recorded.like else None
    lights = lights_of_unit(load_bundle(recorded.lights), untouched.image) if recorded.lights else None
    return Learning(options=how.options(), like=like, lights=lights)


def _whole_view(smaller: View | None, view: View | None) -> View | None:
    """Return how pictures as taken become those that were learnt from."""
    return smaller.after(view) if smaller and view else smaller or view


def evaluate(presses: Path, calibration: str, ball_radius_mm: float | None, as_json: bool) -> None:
    """Measure the error of a bundle on labelled presses, and show it."""
    bundle = load_bundle(calibration)
    ball = _ball_of(bundle, ball_radius_mm)
    steps = PictureSteps.in_bundle(bundle)
    smaller = View(**bundle.metrics[SMALLER]) if SMALLER in bundle.metrics else None
    dots = steps.dots if steps else None
    labelled = read_presses(presses, ball=ball, image_shape=bundle.image_shape, dots=dots, view=smaller)
    errors = validation.evaluate(bundle, labelled, ball, told_layer(bundle))
    felt = felt_ball(bundle, labelled)
    balls = {"ball_radius_mm": ball.radius_mm, "felt_ball_radius_mm": felt.radius_mm, "no_ball_felt": felt.without}
    lines = [
        *_error_lines(errors),
        *indentation_lines(errors.indentation),
        *_bounds_lines(errors),
        f"ball of {ball.radius_mm:g} mm radius feels like {felt.radius_mm:.3g} mm, {ball.seen_from()}",
        *(f"WRONG LABEL: {name}: no ball is felt in its circle: correct it" for name in felt.without),
    ]
    show({**errors.as_json(), **balls}, as_json, "\n".join(lines))


def _pixels(labelled: list[Press], untouched: Reference, ball: Ball) -> dict[str, object]:
    """Return, for the metrics, by how much pixels are higher than wide, where presses tell."""
    shape = pixel_ratio(labelled, untouched.image, ball)
    return {"pixel_ratio": asdict(shape)} if shape else {}


def _ball_of(bundle: Bundle, radius_mm: float | None) -> Ball:
    radius = radius_mm if radius_mm is not None else bundle.metrics.get("ball_radius_mm")
    if radius is None:
        raise typer.BadParameter("the bundle does not know its ball: give it", param_hint="--ball-radius-mm")
    x_mm, y_mm = bundle.pixel_size_mm
    if x_mm != y_mm:
        wrong = f"the pixels of the bundle are {x_mm} x {y_mm} mm, a circle needs square ones"
        raise typer.BadParameter(wrong, param_hint="--calibration")
    return Ball.seen_by(bundle, float(radius))


def _fit_lines(written: Bundle) -> list[str]:
    metrics = written.metrics
    trained, judged = metrics["training"], metrics.get("held_out")
    return [
        *contradicted_lines(metrics),
        f"trained on {trained['images']} images by {trained['trainer']} in {trained['cpu_seconds']:.1f} CPU seconds",
        f"normal error of networks that did not see the press that judges: {judged['normal_error_deg']['mean']:.2f} deg"
        if judged
        else "one press is all learnt from: how large the errors are, nobody knows",
        *(indentation_lines(_indentation(judged)) if judged else []),
        *skirt_words(metrics),
        *light_line(written),
        *learnt_words(metrics),
        f"balls {Ball.seen_by(written, metrics['ball_radius_mm']).seen_from()}",
        *depth_line(written),
        *_pixel_warning(metrics.get("pixel_ratio"), written.image_shape),
        *refinement_line(metrics.get("refinement")),
    ]


def _indentation(judged: Mapping[str, Any]) -> IndentationFigures | None:
    return IndentationFigures(**judged["indentation"]) if "indentation" in judged else None


def indentation_lines(found: IndentationFigures | None) -> list[str]:
    """Return how deep presses are felt over how deep they are by contact mechanics, or what is missing to know that."""
    if found is None:
        return ["how deep presses are felt was not judged: tell how thick the gel is, geometry.gel_thickness_mm"]
    return found.lines()


def _bad_verdict(written: Bundle, largest_deg: float) -> list[str]:
    """Return why a bundle is no good, by the presses that were kept apart; nothing where it is, or nobody knows."""
    judged = written.metrics.get("held_out")
    error_deg = judged["normal_error_deg"]["mean"] if judged else 0.0
    if error_deg <= largest_deg:
        return []
    return [
        f"NOT GOOD: normals are {error_deg:.1f} deg off, at most {largest_deg:g} may be: look at the circles (`detect "
        "--overlay`), at the order of x and y, the ball and the size of a pixel, and at the light of the reference"
    ]


def light_line(written: Bundle) -> list[str]:
    """Return by how much the light of presses and reference differs; nothing where it is alike."""
    if not written.manifest.follow_light:
        return []
    share = written.metrics["light_drift_grey"] / float(written.reference.mean())
    return [
        f"the light of the presses differs from the reference's by {share:.1%}: it is taken out of every picture; a "
        "reference taken just before the presses is better"
    ]


def depth_line(written: Bundle) -> list[str]:
    """Return whether the light of depth was taken off; nothing where the LEDs are not known."""
    if written.manifest.light_by_depth:
        return ["slopes are learnt in the light that the gel has at rest, at any depth"]
    if has_lights(written):
        return ["slopes are learnt in the light of their depth"]
    return []


def refinement_line(refinement: Mapping[str, Any] | None) -> list[str]:
    """Return how far circles were moved, and which were not; nothing where labels were not refined."""
    if not refinement:
        return []
    wider, kept = refinement["radius_of_light_over_label"] - 1, refinement["kept_images"]
    stayed = f"; no clear ball shows, so the label stays, in {', '.join(kept)}" if kept else ""
    return [f"circles were moved by {refinement['rms_shift_px']:.1f} px, contact radii by {wider:+.1%}{stayed}"]


def _pixel_warning(found: Mapping[str, float] | None, image_shape: tuple[int, int]) -> list[str]:
    """Return a warning where the presses show that pixels are not square."""
    wrong = PixelRatio(**found).remedy(image_shape) if found else ""
    return [f"WARNING: {wrong}"] if wrong else []


def _error_lines(errors: PressFigures) -> list[str]:
    pixels = sum(image.pixels for image in errors.images)
    deep = f"{'felt':>8}{'expected':>10}  mm deep" if errors.indentation else ""
    return [
        f"{'image':<24}{'pixels':>8}{'mean':>8}{'median':>8}{'p95':>8}  normal error, deg{deep}",
        *(_image_line(image) for image in errors.images),
        f"{'all':<24}{pixels:>8}{_angles(errors.normal_error_deg)}",
        f"depth error in contact {errors.depth_mae_mm:.4f} mm, contact patch IoU {errors.contact_iou:.2f}",
        *_never_seen_lines(errors),
    ]


def _image_line(image: ImageFigures) -> str:
    found = f"{image.image:<24}{image.pixels:>8}{_angles(image.normal_error_deg)}"
    deep = image.indentation
    return f"{found}{'':19}{deep.felt_mm:>8.3f}{deep.expected_mm:>10.3f}" if deep else found


def _bounds_lines(errors: PressFigures) -> list[str]:
    if errors.within_bounds is None:
        return ["the bundle does not tell how far a frame is off: `fit` finds that from two presses on"]
    return [
        f"frames tell of {errors.bounded:.0%} of these pixels how far normals are off at most; "
        f"{errors.within_bounds:.0%} of those are (90 % wanted)"
    ]


def _never_seen_lines(errors: PressFigures) -> list[str]:
    if errors.not_learnt_deg is None:
        return []
    return [
        f"the calibration never saw the place or colour of {errors.not_learnt:.1%} of these pixels: there normals are "
        f"off by {errors.not_learnt_deg:.2f} deg; presses there would mend it"
    ]


def _angles(angles: AngleFigures) -> str:
    return f"{angles.mean:>8.2f}{angles.median:>8.2f}{angles.p95:>8.2f}"
