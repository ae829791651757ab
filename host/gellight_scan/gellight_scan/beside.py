"""A scan beside the stream of a running sensor, for the page; its folder is that of `gellight scan`."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol, Self

import platformdirs

from gellight.base.errors import GellightError, InputError
from gellight.frames.camera import EndOfStream, PressStage
from gellight.frames.frames import TactileFrame
from gellight.lab.report.pictures import encode_png
from gellight_scan.contact_view import ContactView
from gellight_scan.fusion import corners_mm
from gellight_scan.map_files import content_of
from gellight_scan.pictures import coloured_heights
from gellight_scan.presses import Phase, ahead, presses_in
from gellight_scan.scan import Scan
from gellight_scan.scan_files import alone
from gellight_scan.tracking.rigid import carried

logger = logging.getLogger(__name__)

WAIT_S = 0.5
PICTURE_PX = 640
SHORT = "that press was lifted before it was still: press again, and hold it"
FIRST = "press the part into the gel, hold it still, then lift it"


class Session(Protocol):
    """A running sensor."""

    @property
    def stage(self) -> PressStage | None:
        """What presses objects into a simulated gel; None at a real sensor."""

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        """Wait for a frame with a greater sequence number; TimeoutError, or EndOfStream at the end."""


class ScanBeside:
    """One scan at a time, by hand; safe to use from any thread. A context manager, which ends the scan."""

    def __init__(self, session: Session, *, root: Path | None = None, busy: Callable[[], bool] = lambda: False) -> None:
        """Scan into folders under `root`, by default the user's, but not while the sensor is `busy`."""
        self._session, self._busy = session, busy
        self.root = root or platformdirs.user_data_path("gellight") / "scans"
        self._scan: Scan | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._since_s = 0.0
        """frames begun before show what pressed by itself until then"""
        self._lock = threading.RLock()
        """held while presses are joined or taken back"""
        self._phase: Phase = "press"
        self._joining = False
        self._said: dict[str, object] = {}
        self._found: dict[str, object] = {}
        """what is there, for `state`, which waits for nothing"""
        self._version = 0
        """of the map"""

    def __enter__(self) -> Self:
        """Return the scan."""
        return self

    def __exit__(self, *problem: object) -> None:
        """End what goes on."""
        self.end()

    @property
    def scanning(self) -> bool:
        """Whether a scan goes on."""
        return self._thread is not None and self._thread.is_alive()

    def state(self) -> dict[str, object] | None:
        """Return all that the page shows, None before the first scan.

        Places are in mm on the map, from its upper left corner.
        """
        if not self._found:
            return None
        phase = "join" if self._joining and self._phase == "press" else self._phase
        return {**self._found, **self._said, "scanning": self.scanning, "phase": phase}

    # ---- what a user asks for ----

    def begin(self, name: str) -> None:
        """Go on with the scan of this name, or begin one; InputError where it cannot be."""
        with self._lock, ExitStack() as stack:
            if self.scanning:
                raise InputError("a scan is going on: end it first")
            if self._busy():
                raise InputError("a calibration is going on, which needs the gel: finish it first")
            stack.enter_context(alone(self.root / name))
            self._scan = Scan(self.root / name)
            if self._session.stage is not None:
                self._session.stage.take_over()
                self._since_s = time.monotonic()
            self._phase, self._stop = "press", threading.Event()
            there = len(self._scan.views)
            self._say(f"{there} presses are there: press over half of one" if there else FIRST)
            self._describe()
            self._thread = threading.Thread(
                target=self._join_presses, args=(stack.pop_all(),), name="scan", daemon=True
            )
            self._thread.start()

    def take_back(self) -> None:
        """Take the last press back; InputError where there is none, or where no scan goes on."""
        with self._lock:
            if self._scan is None or not self.scanning:
                raise InputError("no scan is going on: begin it first")
            self._say(f"press {self._scan.take_back()} is taken back")
            self._describe()

    def end(self) -> None:
        """End the scan; what was pressed is kept."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def picture(self) -> bytes:
        """Return the map as a PNG without margins, at most 640 px; InputError where there is none."""
        with self._lock:
            fused = self._scan.fused if self._scan else None
            if fused is None or not fused.height_map.reached.any():
                raise InputError("there is no map yet")
            return encode_png(
                coloured_heights(fused.height_map.height_mm, unseen=~fused.seen, largest_px=PICTURE_PX)[0]
            )

    def file(self, name: str) -> bytes:
        """Return the map as a file of this name; InputError where there is no map, or no file of that kind."""
        with self._lock:
            if self._scan is None or self._scan.fused is None:
                raise InputError("there is no map yet")
            kept = self._scan.folder / name
            return kept.read_bytes() if kept.is_file() else content_of(self._scan.fused.height_map, Path(name))

    # ---- what goes on meanwhile ----

    def _join_presses(self, stack: ExitStack) -> None:
        """Join presses until the scan is ended; say why where it ends by itself."""
        stop = self._stop
        with stack:
            try:
                for view in ahead(presses_in(self._frames(stop), tell=self._note_phase)):
                    self._add(view)
            except GellightError as error:
                self._say(str(error), refused=True)
            except Exception:
                logger.exception("the scan ended")
                self._say("the scan ended; the log says why", refused=True)
            finally:
                stop.set()  # for the thread that looks for presses

    def _add(self, view: ContactView) -> None:
        self._joining = True
        try:
            with self._lock:
                assert self._scan is not None
                report = self._scan.add(view, "the sensor")
                self._describe()
                self._say(report.in_words(), refused=report.number > 0 and not report.joined_to)
        except InputError as error:
            self._say(str(error), refused=True)
        finally:
            self._joining = False

    def _frames(self, stop: threading.Event) -> Iterator[TactileFrame]:
        """Yield the frames of the sensor since the scan began, until it is ended, but for those of a calibration."""
        sequence = -1
        while not stop.is_set():
            try:
                frame = self._session.wait_frame(sequence, WAIT_S)
            except EndOfStream:
                return
            except TimeoutError:
                continue
            sequence = frame.camera_frame.sequence
            if frame.camera_frame.time_s >= self._since_s and not self._busy():
                yield frame

    def _note_phase(self, phase: Phase) -> None:
        if (self._phase, phase) == ("hold", "press"):
            self._say(SHORT, refused=True)
        self._phase = phase

    def _say(self, said: str, *, refused: bool = False) -> None:
        self._said = {"said": said, "refused": refused}

    def _describe(self) -> None:
        assert self._scan is not None
        self._version += 1
        self._found = {"version": self._version, **described(self._scan)}


def described(scan: Scan) -> dict[str, object]:
    """Return what a scan has found by now, for a page."""
    found = {
        "folder": str(scan.folder),
        "presses": len(scan.views),
        "last": max(scan.views, default=None),
        "lost": sorted(set(scan.views) - set(scan.placed)),
    }
    fused = scan.fused
    if fused is None:
        return {**found, "map": None, "outlines": {}, "sides": {}}
    outlines = {
        number: carried(scan.solved.poses[number], corners_mm(scan.views[number]))[:, :2] for number in scan.placed
    }
    last = scan.placed[-1]
    middle = outlines[last].mean(axis=0)
    return {
        **found,
        "map": {"size_mm": fused.size_mm, "reached": fused.reached, "seam_um": fused.seam_mm * 1e3},
        "outlines": {number: (outline - fused.origin_mm).tolist() for number, outline in outlines.items()},
        "sides": {
            side: {
                "shift_mm": (place - middle).tolist(),
                "outline": (outlines[last] + place - middle - fused.origin_mm).tolist(),
            }
            for side, place in scan.missing(last).items()
        },
    }
