"""`gellight surface`: the roughness of a map of heights or of one press, and both as files for other programs."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.export import felt_frames
from gellight.cli.options import AsJson, Overwrite, refuse_existing, with_options
from gellight.cli.showing import show
from gellight.frames.frames import TactileFrame
from gellight.lab.scanning.height_map import HeightMap, load_height_map, map_of_press
from gellight.lab.scanning.map_files import CONTENTS, write_maps
from gellight.lab.scanning.roughness import (
    COATING_BLUR_MM,
    AreaRoughness,
    Evaluation,
    ProfileRoughness,
    area_roughness,
    profile_roughness,
)
from gellight.recording.recording_file import Recording


class Form(StrEnum):
    """What is taken off before."""

    NONE = "none"
    PLANE = "plane"
    CURVED = "curved"


@dataclass(frozen=True)
class Measured:
    """How roughness is measured."""

    line: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="X1 Y1 X2 Y2", help="Measure along this line, mm from the middle, y down."),
    ] = None
    cutoff: Annotated[
        float | None,
        typer.Option("--cutoff-mm", help="Of the Gaussian filter.", show_default="by the waves, as ISO 4288"),
    ] = None
    form: Annotated[Form, typer.Option(help="What is taken off before; curved: also spheres and cylinders.")] = (
        Form.CURVED
    )
    blur: Annotated[
        float | None,
        typer.Option(
            "--blur-mm", help="Standard deviation of the coating's blur.", show_default="as in the settings, or 0.1"
        ),
    ] = None

    def evaluation(self) -> Evaluation:
        """Return what is measured how."""
        told = self.blur if self.blur is not None else load_settings({}).geometry.coating_smoothing_mm
        blur_mm = COATING_BLUR_MM if told is None else told
        return Evaluation(blur_mm=blur_mm, cutoff_mm=self.cutoff, form=self.form.value)


@dataclass(frozen=True)
class OfRecording:
    """What is taken from a recording."""

    frame: Annotated[
        int | None, typer.Option(help="Its sequence number, of a recording.", show_default="the deepest")
    ] = None
    error: Annotated[
        float | None,
        typer.Option(
            "--error-mm", min=0, help="Standard deviation of a height of a recording.", show_default="by the bundle"
        ),
    ] = None
    calibration: Annotated[
        str | None, typer.Option(help="Bundle for a recording.", show_default="the recording's own")
    ] = None

    def map_of(self, path: Path) -> HeightMap:
        """Return the heights of one press; raises InputError for a recording without that frame."""
        recording = Recording(path)
        bundle = load_bundle(self.calibration) if self.calibration else None
        felt = self._chosen(path, recording, bundle)
        return map_of_press(felt, (bundle or recording.bundle).pixel_size_mm, self.error)

    def _chosen(self, path: Path, recording: Recording, bundle: Bundle | None) -> TactileFrame:
        """Return the wanted frame, else the deepest."""
        frames = felt_frames(recording, bundle)
        wanted = (one for one in frames if self.frame in (None, one.camera_frame.sequence))
        deepest = max(wanted, key=lambda one: one.contact.indentation_mm, default=None)
        if deepest is None:
            raise InputError(f"{path} holds no frame {self.frame}: `gellight export` names them all")
        return deepest

    def refuse_useless(self) -> None:
        """Refuse options that change nothing for a map: its heights and errors are its own."""
        given = {"--frame": self.frame, "--error-mm": self.error, "--calibration": self.calibration}
        useless = [name for name, value in given.items() if value is not None]
        if useless:
            raise InputError(f"{' and '.join(useless)} is of a recording, and this is a map: leave it away")


@with_options
def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A map of heights (.npz), or a recording (.mcap).")],
    measured: Measured,
    recorded: OfRecording,
    out: Annotated[
        list[Path] | None,
        typer.Option(help=f"Write the map here, and measure nothing: {', '.join(CONTENTS)}; repeatable."),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Measure the roughness of a surface, or write it for other programs.

    Over the whole map: Sa, Sq, Sz, Ssk and Sku (ISO 25178-2); along a line: Ra, Rq and Rz (ISO 21920-2); all by the
    Gaussian filter of ISO 16610. Of a recording it is what one press felt. What is finer than the coating's blur and
    the pixels allow, lies within the errors, or was not reached by the gel is refused. Lengths are in mm.
    """
    for path in out or ():
        refuse_existing(path, overwrite)
    if file.suffix == ".mcap":
        surface = recorded.map_of(file)
    else:
        recorded.refuse_useless()
        surface = load_height_map(file)
    if out:
        write_maps(surface, out)
        show({"written": [str(path) for path in out]}, as_json, f"written: {', '.join(map(str, out))}")
        return
    found = _measure(surface, measured.line, measured.evaluation())
    show(found, as_json, _in_words(found))


def _measure(
    surface: HeightMap, line: tuple[float, float, float, float] | None, how: Evaluation
) -> AreaRoughness | ProfileRoughness:
    if line is None:
        return area_roughness(surface, how)
    x1, y1, x2, y2 = line
    return profile_roughness(surface, (x1, y1), (x2, y2), how)


def _in_words(found: AreaRoughness | ProfileRoughness) -> str:
    """Return the figures for people, in um; what the blur took is said, and not added."""
    if isinstance(found, AreaRoughness):
        means, extreme = {"Sa": found.sa_mm, "Sq": found.sq_mm}, ("Sz", found.sz_mm)
        rest = [f"Ssk {found.ssk:.2f}, Sku {found.sku:.2f}; evaluated {found.area_mm2:.0f} mm2"]
    else:
        means, extreme = {"Ra": found.ra_mm, "Rq": found.rq_mm}, ("Rz", found.rz_mm)
        rest = [f"evaluated {found.sections} of the standard's 5 sections of {found.cutoff_mm:g} mm"]
    unseen = 1 / (1 - found.blur_share)
    errors = {**dict.fromkeys(means, found.error_mm), extreme[0]: found.extremes_error_mm}
    lines = [
        f"{name}  {value * 1e3:8.2f} um ± {errors[name] * 1e3:.2f} um as felt; {value * unseen * 1e3:.2f} um with what "
        "the blur takes"
        for name, value in {**means, extreme[0]: extreme[1]}.items()
    ]
    return "\n".join(
        [
            *lines,
            *rest,
            f"waves of {found.wavelength_mm:.2f} mm on average, of which the coating's blur takes "
            f"{found.blur_share:.0%}; it is an S-filter of {found.finest_mm:.2f} mm",
            f"cutoff {found.cutoff_mm:g} mm; the gel reached {found.reached:.1%}",
        ]
    )
