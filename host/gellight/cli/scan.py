"""`gellight scan`: presses side by side become one map of a surface larger than the view."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from gellight.base import logs
from gellight.base.errors import InputError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import load_bundle
from gellight.cli.ending import Ending, until_interrupted
from gellight.cli.export import felt_frames
from gellight.cli.one_sensor import WAIT_S, RunOptions, opened
from gellight.cli.options import AsJson, with_options
from gellight.cli.showing import show
from gellight.daemon.session import SensorSession
from gellight.frames.camera import EndOfStream
from gellight.frames.frames import TactileFrame
from gellight.lab.scanning.contact_view import ContactView
from gellight.lab.scanning.presses import Phase, ahead, presses_in
from gellight.lab.scanning.scan import MAP, PICTURE, Scan
from gellight.lab.scanning.scan_files import alone
from gellight.recording.recording_file import Recording


@with_options
def command(
    options: RunOptions,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Of the scan; one that is there goes on.")],
    recording: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Take the presses of a recording, not of a sensor.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(help="As `gellight run` has it.", show_default="auto, or the settings")
    ] = None,
    presses: Annotated[int, typer.Option(min=0, help="End after this number of presses; 0: at Ctrl-C.")] = 0,
    curved: Annotated[
        bool, typer.Option("--curved", help="The part is not flat as a whole: take only its plane off.")
    ] = False,
    dashboard: Annotated[bool, typer.Option(help="Serve the dashboard.")] = False,
    as_json: AsJson = False,
) -> None:
    """Scan a surface that is larger than the view: press, lift, press beside, over half of a press that was.

    After each press it is said to which ones it could be joined and where no press has been. FOLDER has map.npz, the
    heights with their errors where the gel reached the part, and map.png, a picture of it; both grow with every press.
    Ends with status 1 where presses could not be joined.
    """
    if recording is not None and sensor is not None:
        raise InputError("give --recording or --sensor, one of the two")
    found = Recording(recording) if recording is not None else None
    with alone(folder):
        scan = Scan(folder, curved=curved)
        if found is not None:
            _scan_recording(scan, found, options.calibration, presses)
        else:
            settings = load_settings({"sensor.url": sensor, **options.flags()})
            with opened(settings, dashboard=dashboard) as (daemon, _), until_interrupted():
                logs.say("press the part into the gel, hold it still, lift it; press again, over half of that place")
                for view in ahead(presses_in(_live(daemon, options.frames), presses, _tell)):
                    _add(scan, view, "the sensor")
            scan = Scan(folder, curved=curved)  # Ctrl-C may have come in the middle of a press
    _end(scan, as_json)


def _scan_recording(scan: Scan, found: Recording, calibration: str | None, most: int) -> None:
    frames = felt_frames(found, load_bundle(calibration) if calibration else None)
    view = None
    for view in presses_in(frames, most):
        if not scan.has(view):
            _add(scan, view, str(found.path))
    if view is None:
        raise InputError(f"{found.path} has no press that was held still: press 0.1 mm deep or more, for some frames")


def _live(daemon: SensorSession, frames: int) -> Iterator[TactileFrame]:
    """Yield the frames of a sensor, 0: for ever."""
    sequence, count = -1, 0
    while not frames or count < frames:
        try:
            frame = daemon.next_frame(sequence, WAIT_S)
        except EndOfStream:
            return
        except TimeoutError:
            continue
        sequence, count = frame.camera_frame.sequence, count + 1
        yield frame


def _tell(phase: Phase) -> None:
    if phase == "lift":
        logs.say("held: lift it")


def _add(scan: Scan, view: ContactView, source: str) -> None:
    logs.say(scan.add(view, source).in_words())


def _end(scan: Scan, as_json: bool) -> None:
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
        "seam_um": round(fused.seam_mm * 1e3, 2),
    }
    text = (
        f"{result['map']}: {len(scan.placed)} of {len(scan.views)} presses, {width:.1f} x {height:.1f} mm, of which "
        f"the gel reached {fused.reached:.0%}; presses differ by {fused.seam_mm * 1e3:.1f} um "
        "where two reached the part\n"
        f"{result['picture']}: a picture of it"
    )
    show(result, as_json, text)
    if lost:
        print(f"gellight: not joined: {', '.join(map(str, lost))}", file=sys.stderr)
        raise typer.Exit(Ending.JUDGED_BAD)
