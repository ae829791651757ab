"""Presses side by side become one map of a surface larger than the view, touches of a body a mesh."""

import sys
from collections.abc import Iterator
from itertools import islice
from math import isnan
from pathlib import Path
from typing import Any

import typer

from gellight.base import logs
from gellight.base.errors import InputError
from gellight.base.settings import Settings
from gellight.bundle.bundle import load_bundle
from gellight.cli.ending import Ending, until_interrupted
from gellight.cli.one_sensor import frames_of, opened
from gellight.cli.running.export import tactile_frames
from gellight.cli.showing import show
from gellight.frames.frames import TactileFrame
from gellight.recording.recording_file import Recording
from gellight_scan.body_scan import MESH, BodyScan
from gellight_scan.body_scan import PICTURE as BODY_PICTURE
from gellight_scan.contact_view import ContactView
from gellight_scan.presses import Phase, ahead, presses_in
from gellight_scan.scan import MAP, PICTURE, Scan
from gellight_scan.scan_files import alone
from gellight_scan.touches import Touch, touches_in

PRESS = "press the part into the gel, hold it still, lift it; press again, over half of that place"
ROLL = "press the body into the gel and roll it slowly, without lifting it"


def scan_recording(
    recording: Path, folder: Path, calibration: str | None, most: int, *, curved: bool, body: bool, as_json: bool
) -> None:
    """Scan the presses, or touches, of a recording, up to `most`, 0: all; write and show what came of it."""
    found = Recording(recording)
    with alone(folder):
        scan = _begin(folder, curved, body)
        _add_recorded(scan, found, calibration, most)
    _end(scan, as_json)


def scan_live(
    settings: Settings,
    folder: Path,
    frames: int,
    most: int,
    *,
    curved: bool,
    body: bool,
    dashboard: bool,
    as_json: bool,
) -> None:
    """Scan with a sensor until Ctrl-C, or until `frames` or the presses are there, where they are not 0."""
    with alone(folder):
        scan = _begin(folder, curved, body)
        with opened(settings, dashboard=dashboard) as (daemon, _), until_interrupted():
            logs.say(ROLL if body else PRESS)
            for view in ahead(_taken(scan, islice(filter(None, frames_of(daemon)), frames or None), most)):
                if _full(scan):
                    break
                _add(scan, view, "the sensor")
        scan = _begin(folder, curved, body)  # Ctrl-C may have come in the middle of a press
    _end(scan, as_json)


def _begin(folder: Path, curved: bool, body: bool) -> Scan | BodyScan:
    return BodyScan(folder) if body else Scan(folder, curved=curved)


def _end(scan: Scan | BodyScan, as_json: bool) -> None:
    if isinstance(scan, BodyScan):
        _end_body(scan, as_json)
    else:
        _end_map(scan, as_json)


def _add_recorded(scan: Scan | BodyScan, found: Recording, calibration: str | None, most: int) -> None:
    frames = tactile_frames(found, load_bundle(calibration) if calibration else None)
    view = None
    for view in _taken(scan, frames, most):
        if scan.has(view.contact if isinstance(view, Touch) else view):
            continue
        if _full(scan):
            break
        _add(scan, view, str(found.path))
    if view is None:
        raise InputError(f"{found.path} has no press that was held still: press 0.1 mm deep or more, for some frames")


def _taken(scan: Scan | BodyScan, frames: Iterator[TactileFrame], most: int) -> Iterator[ContactView | Touch]:
    """Yield the presses in frames, or the touches of a body, up to `most`, 0: all."""
    if isinstance(scan, BodyScan):
        return islice(touches_in(frames), most or None)
    return presses_in(frames, most, _tell)


def _tell(phase: Phase) -> None:
    if phase == "lift":
        logs.say("held: lift it")


def _full(scan: Scan | BodyScan) -> bool:
    """Say where a body has as many touches as a scan holds."""
    full = isinstance(scan, BodyScan) and not scan.room
    if full:
        logs.say(f"{len(scan.views)} touches are all that a scan holds: the surface is made of these")
    return full


def _add(scan: Any, view: ContactView | Touch, source: str) -> None:
    report = scan.add(view, source)
    if report.worth_saying:
        logs.say(report.in_words())


def _end_body(scan: BodyScan, as_json: bool) -> None:
    """Write the surface, and say what it is; refuse one of which no two touches hang together."""
    if not scan.views:
        raise InputError(
            f"no body was followed in the gel, so {scan.folder} has no surface: press it 0.3 mm deep or more"
        )
    lost = sorted(set(scan.views) - set(scan.placed))
    if len(scan.placed) == 1:
        raise InputError(
            f"none of the {len(scan.views)} touches in {scan.folder} could be joined to the first one: roll the body "
            "more slowly, pressed deeper; what is smooth cannot be scanned"
        )
    mesh = scan.mesh()
    scan.write_mesh(mesh)
    size = [round(float(side), 2) for side in mesh.size_mm]
    result = {
        "mesh": str(scan.folder / MESH),
        "picture": str(scan.folder / BODY_PICTURE),
        "touches": len(scan.views),
        "not_joined": lost,
        "overlaps_left_out": scan.contradicted,
        "size_mm": size,
        "area_mm2": round(mesh.area_mm2, 2),
        "error_um": round(float(mesh.error_mm.mean()) * 1e3, 2),
        "seam_um": None if isnan(mesh.seam_mm) else round(mesh.seam_mm * 1e3, 2),
    }
    seam = "" if isnan(mesh.seam_mm) else f"; touches lie {mesh.seam_mm * 1e3:.1f} um off it where several touched"
    text = (
        f"{result['mesh']}: {len(scan.placed)} of {len(scan.views)} touches, {mesh.area_mm2:.1f} mm2 of a surface of "
        f"{' x '.join(map(str, size))} mm{seam}\n"
        f"{result['picture']}: a picture of it"
    )
    _show(result, as_json, text, lost)


def _end_map(scan: Scan, as_json: bool) -> None:
    """Say what the scan is; refuse one of which no two presses hang together."""
    if not scan.views or scan.fused is None:
        raise InputError(f"no press was held still, so {scan.folder} has no map: press 0.1 mm deep or more, then lift")
    fused, lost = scan.fused, sorted(set(scan.views) - set(scan.placed))
    if len(scan.views) > 1 and len(scan.placed) == 1:
        raise InputError(
            f"none of the {len(scan.views)} presses in {scan.folder} could be joined to press {scan.first}: press so "
            "that each lies over half of another one, 0.1 mm deep or more"
        )
    scan.write_map()
    width, height = fused.size_mm
    result = {
        "map": str(scan.folder / MAP),
        "picture": str(scan.folder / PICTURE),
        "presses": len(scan.views),
        "not_joined": lost,
        "size_mm": [round(width, 2), round(height, 2)],
        "reached": round(fused.reached, 4),
        "seam_um": None if isnan(fused.seam_mm) else round(fused.seam_mm * 1e3, 2),
    }
    differ = f"; presses differ by {fused.seam_mm * 1e3:.1f} um where two reached the part"
    text = (
        f"{result['map']}: {len(scan.placed)} of {len(scan.views)} presses, {width:.1f} x {height:.1f} mm, of which "
        f"the gel reached {fused.reached:.0%}{differ if result['seam_um'] is not None else ''}\n"
        f"{result['picture']}: a picture of it"
    )
    _show(result, as_json, text, lost)


def _show(result: dict[str, object], as_json: bool, text: str, lost: list[int]) -> None:
    show(result, as_json, text)
    if lost:
        print(f"gellight: not joined: {', '.join(map(str, lost))}", file=sys.stderr)
        raise typer.Exit(Ending.JUDGED_BAD)
