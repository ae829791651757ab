"""Measure a lens from pictures and add it to a bundle; draw what was found."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from gellight.base.errors import InputError, printable
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.frames.pixel_grid import over_gel
from gellight.lab.optics.lens.lens_fit import Floats, LensFit, fit_lens, read_pins, spacing_px
from gellight.lab.optics.lens.pins import dimples, marked, spots
from gellight.lab.report.pictures import Picture, write_png
from gellight.lab.report.record import Record
from gellight.lab.training.training import read_reference
from gellight.reconstruction.lens.undistortion import LensRecord, Undistortion


class LensFigures(Record):
    """How well a lens explains the pins; mm at the size of a pixel in the middle of the picture."""

    pins: int
    pictures: int
    rms_before_px: float
    rms_after_px: float
    rms_before_mm: float
    rms_after_mm: float
    corner_moves_px: float
    k1: float
    k2: float
    centre_px: tuple[float, float]
    middle_mm_per_px: tuple[float, float]
    bundle_mm_per_px: tuple[float, float]
    not_seen_share: float


def measure_lens(bundle: Bundle, images: Sequence[Path], pitch_mm: float, reference: str | None = None) -> LensFit:
    """Fit the lens of a sensor to pictures of a grid of pins `pitch_mm` apart.

    reference: the untouched gel, for pins that press into it; they are found in the depth that the bundle's network
    feels. Without it they are spots in the picture. Raises InputError, with the reason, where no lens can be fitted.
    """
    if not (np.isfinite(pitch_mm) and pitch_mm > 0):
        raise InputError(f"pitch {pitch_mm} mm: give the distance of two neighbouring pins, above 0")
    if not images:
        raise InputError("there is no picture: give at least one of the pin grid")
    contrasts = _spots if reference is None else _felt(bundle, reference)
    size, lattices = bundle.pixel_size_mm, []
    for path in images:
        picture: Picture = read_image(path)
        bundle.check_fits(str(path), (picture.shape[0], picture.shape[1]))
        seen = contrasts(picture, spacing_px(size, pitch_mm))
        lattices.append(read_pins(seen, pixel_size_mm=size, pitch_mm=pitch_mm, source=path))
    return fit_lens(lattices, bundle.image_shape, pitch_mm)


def _spots(picture: Picture, spacing: float) -> list[Floats]:
    return spots(picture.astype(np.float32), spacing)


def _felt(bundle: Bundle, reference: str) -> Callable[[Picture, float], list[Floats]]:
    """Return what shows the pins in the depth that the bundle's network feels of a picture."""
    untouched = read_reference(reference)
    bundle.check_fits(reference, untouched.image_shape)
    seen = bundle.with_reference(untouched.image, frames=untouched.frames)
    reconstructor = Reconstructor(seen, undistorted=False)

    def contrasts(picture: Picture, spacing: float) -> list[Floats]:
        frame = CameraFrame(image=picture, time_s=0.0, sequence=0, source="the pin grid")
        depth = reconstructor.reconstruct(frame).depth_mm
        return dimples(over_gel(depth, bundle.manifest.camera_height_mm), spacing)

    return contrasts


def add_lens(bundle: Bundle, fit: LensFit, images: Sequence[Path], out: Path, *, overwrite: bool = False) -> Bundle:
    """Write the bundle with the lens as a new one and return it; BundleError where that cannot be."""
    lens = asdict(fit.lens)
    height, width = lens.pop("image_shape")
    record = LensRecord(
        image_width_px=width,
        image_height_px=height,
        **lens,
        learnt_from_circles="presses.npz" in bundle.files,  # the labels of presses are circles
        pitch_mm=fit.pitch_mm,
        images=tuple(printable(path.name) for path in images),
        pins=fit.pins,
        rms_before_px=fit.rms_before_px,
        rms_after_px=fit.rms_after_px,
        created=datetime.now(UTC).replace(microsecond=0),
    )
    return extend_bundle(bundle, out, record.files(), overwrite=overwrite)


def figures(fit: LensFit, bundle: Bundle) -> LensFigures:
    """Return what was measured, rounded for people."""
    x_mm, y_mm = fit.lens.mm_per_px
    mm = float(np.sqrt(x_mm * y_mm))
    undistortion = Undistortion(fit.lens, bundle.pixel_size_mm, from_circles=False)
    return LensFigures(
        pins=fit.pins,
        pictures=len(fit.lattices),
        rms_before_px=round(fit.rms_before_px, 4),
        rms_after_px=round(fit.rms_after_px, 4),
        rms_before_mm=round(fit.rms_before_px * mm, 5),
        rms_after_mm=round(fit.rms_after_px * mm, 5),
        corner_moves_px=round(fit.lens.bend_px, 2),
        k1=round(fit.lens.k1, 5),
        k2=round(fit.lens.k2, 5),
        centre_px=(round(fit.lens.centre_px[0], 1), round(fit.lens.centre_px[1], 1)),
        middle_mm_per_px=(round(x_mm, 6), round(y_mm, 6)),
        bundle_mm_per_px=bundle.pixel_size_mm,
        not_seen_share=round(float(1 - undistortion.seen.mean()), 4),
    )


def write_overlay(path: Path, image: Path, fit: LensFit) -> None:
    """Draw the pins found in the first picture, and where the lens expects them, as a PNG file."""
    try:
        write_png(path, marked(read_image(image), fit.lattices[0].points, fit.expected_px[0]))
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}): choose another place") from error
