"""The roughness of a map of heights or of one press, and both as files for other programs."""

from collections.abc import Sequence
from pathlib import Path

from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.cli.running.export import tactile_frames
from gellight.cli.showing import show
from gellight.frames.frames import TactileFrame
from gellight.recording.recording_file import Recording
from gellight_scan.cli.surface_verb import Measured, OfRecording
from gellight_scan.height_map import HeightMap, load_height_map, map_of_press
from gellight_scan.map_files import write_maps
from gellight_scan.roughness import (
    COATING_BLUR_MM,
    AreaRoughness,
    Evaluation,
    ProfileRoughness,
    area_roughness,
    profile_roughness,
)


def surface(file: Path, measured: Measured, recorded: OfRecording, out: Sequence[Path], as_json: bool) -> None:
    """Write a map, or that of a press of a recording, to the files `out`; where there are none, measure it."""
    if file.suffix == ".mcap":
        heights = _map_of(file, recorded)
    else:
        recorded.refuse_useless()
        heights = load_height_map(file)
    if out:
        write_maps(heights, out)
        show({"written": [str(path) for path in out]}, as_json, f"written: {', '.join(map(str, out))}")
        return
    found = _measure(heights, measured.line, _evaluation(measured))
    show(found, as_json, _in_words(found))


def _evaluation(measured: Measured) -> Evaluation:
    """Return what is measured how."""
    told = load_settings({}).geometry.coating_smoothing_mm
    blur_mm = COATING_BLUR_MM if told is None else told
    return Evaluation(blur_mm=blur_mm, cutoff_mm=measured.cutoff, form=measured.form.value)


def _map_of(path: Path, wanted: OfRecording) -> HeightMap:
    """Return the heights of one press; raises InputError for a recording without that frame."""
    recording = Recording(path)
    bundle = load_bundle(wanted.calibration) if wanted.calibration else None
    felt = _chosen(recording, bundle, wanted.frame)
    return map_of_press(felt, (bundle or recording.bundle).pixel_size_mm, wanted.error)


def _chosen(recording: Recording, bundle: Bundle | None, number: int | None) -> TactileFrame:
    """Return the wanted frame, else the deepest."""
    wanted = (one for one in tactile_frames(recording, bundle) if number in (None, one.camera_frame.sequence))
    deepest = max(wanted, key=lambda one: one.contact.indentation_mm, default=None)
    if deepest is None:
        raise InputError(f"{recording.path} holds no frame {number}: `gellight export` names them all")
    return deepest


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
