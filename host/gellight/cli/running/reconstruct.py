"""Pictures of the gel to depth, normals and contact."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.logs import say
from gellight.base.one_ahead import one_ahead
from gellight.base.settings import load_settings
from gellight.base.writing import write_file
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.ending import Ending
from gellight.cli.showing import show
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.frames.image_files import ImageCamera, image_files
from gellight.frames.picture import prepared
from gellight.lab.report.pictures import encode_png, four_panels
from gellight.reconstruction.light_drift import light_drift
from gellight.recording.array_files import maps_file
from gellight.series.single_light_path import frame_of_lights, has_single_lights
from gellight.watch.findings import (
    WatchFinding,
    gel_thickness_mm,
    guessed_contact,
    impossible_depth,
    learnt_elsewhere,
    no_surface,
    other_light,
)


@dataclass(frozen=True)
class Row:
    """The contact in one image, and what was written of it."""

    image: str
    npz: str
    png: str
    indentation_mm: float
    area_mm2: float
    centroid_mm: tuple[float, float] | None
    force_n: float | None
    """None where the bundle has no constant for it"""
    force_error_n: float | None
    findings: tuple[str, ...]
    """what is known against it; empty where nothing is"""


def reconstruct(
    images: Sequence[str],
    out: Path,
    calibration: str,
    *,
    white: float | None,
    least_squares: bool,
    scale_um: float,
    as_json: bool,
) -> None:
    """Reconstruct the images that the texts name, write the files of each into `out`, and show the contacts."""
    paths = [path for text in images for path in image_files(text)]
    _refuse_clashes(paths, out)
    bundle = load_bundle(calibration)
    thickness_mm = gel_thickness_mm(bundle, load_settings({}).geometry.gel_thickness_mm)
    rows = [
        _written(frame, path, out, scale_um, tuple(_against(frame, thickness_mm, bundle)))
        for frame, path in one_ahead(_frames(bundle, paths, white, least_squares))
    ]
    show(rows, as_json, _table(rows))
    for finding in learnt_elsewhere(bundle):
        say(f"gellight: {finding.text}")
    if thickness_mm is None:
        say(
            "gellight: no depth was judged, since nobody told how thick the gel is: give gel_thickness_mm under "
            "[geometry] in gellight.toml"
        )
    if any(row.findings for row in rows):
        raise typer.Exit(Ending.JUDGED_BAD)


def _frames(
    bundle: Bundle, paths: Sequence[Path], white: float | None, least_squares: bool
) -> Iterator[tuple[TactileFrame, Path]]:
    """Reconstruct the images, each with the path that names its result."""
    if has_single_lights(bundle):
        mode = "photometric" if least_squares else "network"
        return iter([(frame_of_lights(bundle, mode, paths, white), paths[0])])
    useless = [name for name, given in (("--white", white), ("--least-squares", least_squares)) if given]
    if useless:  # the asker would believe that they did something
        raise InputError(f"{' and '.join(useless)} has no effect with a bundle of one light: remove it")
    return _of_colours(bundle, paths)


def _of_colours(bundle: Bundle, paths: Sequence[Path]) -> Iterator[tuple[TactileFrame, Path]]:
    """Reconstruct each picture by itself, one after the other."""
    manifest = bundle.manifest.model_copy(update={"follow_light": True})
    following = cache(lambda: Reconstructor(replace(bundle, manifest=manifest)))
    as_calibrated = Reconstructor(bundle)
    with prepared(ImageCamera(list(paths)), bundle) as camera:
        for path, frame in zip(paths, one_ahead(camera.read() for _ in paths), strict=True):
            other = frame.image.shape == bundle.reference.shape and _other_light(frame.image, bundle, path)
            yield (following() if other else as_calibrated).reconstruct(frame), path


def _other_light(image: NDArray[np.uint8], bundle: Bundle, path: Path) -> bool:
    """Tell whether the light of a picture differs from the calibration's by more than noise, and say by how much."""
    drift = light_drift(image, bundle.reference)
    other = drift.grey(bundle.reference) > bundle.manifest.noise_grey
    if other and not drift.refusal:
        say(f"gellight: {path.name}: the light differs from the reference's by up to {drift.most:.1%}: taken out")
    return other


def _against(frame: TactileFrame, thickness_mm: float | None, bundle: Bundle) -> Iterator[WatchFinding]:
    """Yield what is known against what was found in one image."""
    if not has_single_lights(bundle):
        drift = light_drift(frame.camera_frame.image, bundle.reference)
        if drift.refusal:
            yield other_light(drift.refusal, drift.most)
    yield from impossible_depth(frame, thickness_mm)
    yield from no_surface(frame, bundle.pixel_size_mm)
    yield from guessed_contact(frame)


def _refuse_clashes(paths: Sequence[Path], out: Path) -> None:
    """Before any work: two images must not write one file, and no result may replace an image."""
    by_stem: dict[str, Path] = {}
    sources = {path.resolve() for path in paths}
    for path in paths:
        # Folded, because some file systems take ball.png and Ball.png for one file.
        other = by_stem.setdefault(path.stem.casefold(), path)
        if other is not path:
            raise InputError(f"{other} and {path} would both be written to {path.stem}.npz: reconstruct them apart")
        if (out / f"{path.stem}.png").resolve() in sources:
            raise InputError(f"the picture of {path} would replace an image in {out}: give another folder to --out")


def _written(frame: TactileFrame, image: Path, out: Path, scale_um: float, findings: Sequence[WatchFinding]) -> Row:
    """Write what was found in an image, and return what is said about it."""
    npz, png = out / f"{image.stem}.npz", out / f"{image.stem}.png"
    contact, against = frame.contact, tuple(f"{finding.kind}: {finding.text}" for finding in findings)
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_file(npz, maps_file(frame, against))
        write_file(png, encode_png(four_panels(frame, scale_um=scale_um)))
    except OSError as error:
        raise InputError(
            f"{npz} or .png was not written ({error.strerror}): give --out a folder that can be written and has space"
        ) from error
    return Row(
        image=str(image),
        npz=str(npz),
        png=str(png),
        indentation_mm=contact.indentation_mm,
        area_mm2=contact.area_mm2,
        centroid_mm=contact.centroid_mm,
        force_n=frame.force.normal_n if frame.force else None,
        force_error_n=frame.force.error_n if frame.force else None,
        findings=against,
    )


def _table(rows: Sequence[Row]) -> str:
    width = max(5, *(len(Path(row.image).name) for row in rows))
    lines = [f"{'image':{width}}  indentation mm  area mm2  centroid mm (x, y)"]
    for row in rows:
        place = "{:8.3f}, {:.3f}".format(*row.centroid_mm) if row.centroid_mm else "      no contact"
        force = f"  {row.force_n:7.3f} ± {row.force_error_n:.3f} N" if row.force_n is not None else ""
        lines.append(f"{Path(row.image).name:{width}}  {row.indentation_mm:14.4f}  {row.area_mm2:8.3f}  {place}{force}")
        lines += [f"{'':{width}}  {finding}" for finding in row.findings]
    return "\n".join(lines)
