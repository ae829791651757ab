"""A scan beside a stream of frames: what a hand is told, what is refused, and what stays of it."""

import queue
import re
import threading
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import TactileFrame
from gellight.lab.simulator.stage import Stage
from gellight_scan.beside import SHORT, ScanBeside
from gellight_scan.scan import MAP, PICTURE, Scan
from sim_reference.geometry import AS_BUILT
from tests.helpers.tactile import hill_frame as frame
from tests.helpers.waiting import eventually

HELD = [0.0, 0.5, 0.5, 0.5, 0.5]


class Frames:
    """A sensor whose frames are put in by hand."""

    def __init__(self, stage: Stage | None = None) -> None:
        self.stage = stage
        self._queue: queue.Queue[TactileFrame] = queue.Queue()
        self._count = 0

    def put(self, *depths_mm: float, calibration: str = "a") -> None:
        for deep in depths_mm:
            self._count += 1
            one = frame(deep, seed=self._count)
            assert one.provenance is not None
            taken = replace(one.camera_frame, time_s=time.monotonic())
            self._queue.put(
                replace(one, camera_frame=taken, provenance=replace(one.provenance, calibration=calibration))
            )

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        try:
            return self._queue.get(timeout=0.01)
        except queue.Empty:
            raise TimeoutError from None


def said(scan: ScanBeside, words: str) -> None:
    eventually(lambda: re.search(words, str((scan.state() or {})["said"])) is not None, 20)


def phase(scan: ScanBeside, wanted: str) -> None:
    eventually(lambda: (scan.state() or {})["phase"] == wanted, 20)


def test_a_hand_is_led_and_the_folder_is_that_of_the_verb(tmp_path: Path) -> None:
    sensor = Frames()
    with ScanBeside(sensor, root=tmp_path) as scan:
        assert scan.state() is None
        scan.begin("part")
        sensor.put(*HELD[:3])
        phase(scan, "hold")
        sensor.put(*HELD[3:])
        phase(scan, "lift")
        sensor.put(0.0)
        said(scan, "press 0: the gel reached")
        state = scan.state() or {}
        assert (state["presses"], state["last"], state["lost"], state["scanning"]) == (1, 0, [], True)
        assert set(state["sides"]) == {"right", "left", "below", "above"}
        assert scan.picture().startswith(b"\x89PNG")
        assert scan.file("map.ply").startswith(b"ply")
    assert (scan.state() or {})["scanning"] is False
    assert Scan(tmp_path / "part").placed == [0]


def test_what_a_simulated_hand_pressed_before_the_scan_is_no_press_of_it(tmp_path: Path) -> None:
    sensor = Frames(Stage(AS_BUILT))
    sensor.put(0.9, 0.9, 0.9, 0.9)
    with ScanBeside(sensor, root=tmp_path) as scan:
        scan.begin("part")
        sensor.put(0.0, *HELD, 0.0)
        said(scan, "press 0: the gel reached")
    assert Scan(tmp_path / "part").views[0].depth_mm.max() == pytest.approx(0.5, abs=0.01)


def test_the_last_press_can_be_taken_back_until_none_is_left(tmp_path: Path) -> None:
    sensor = Frames()
    with ScanBeside(sensor, root=tmp_path) as scan:
        scan.begin("part")
        sensor.put(*HELD, 0.0)
        said(scan, "press 0: ")
        scan.take_back()
        said(scan, "press 0 is taken back")
        assert not {MAP, PICTURE, "press-000.npz"} & {path.name for path in (tmp_path / "part").iterdir()}
        with pytest.raises(InputError, match="no press to take back"):
            scan.take_back()
        with pytest.raises(InputError, match="no map yet"):
            scan.picture()
    assert not (tmp_path / "part").exists(), "nothing is left of a scan without a press"


def test_after_an_unexpected_error_nobody_looks_for_presses_any_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor = Frames()
    with monkeypatch.context() as patch, ScanBeside(sensor, root=tmp_path) as scan:
        patch.setattr(Scan, "add", Mock(side_effect=ZeroDivisionError))
        scan.begin("part")
        sensor.put(*HELD, 0.0)
        said(scan, "the log says why")
        eventually(lambda: "presses" not in {thread.name for thread in threading.enumerate()}, 20)


def test_what_cannot_be_scanned_is_refused_in_one_sentence(tmp_path: Path) -> None:
    sensor, busy = Frames(), [True]
    with ScanBeside(sensor, root=tmp_path, busy=lambda: busy[0]) as scan:
        with pytest.raises(InputError, match="a calibration is going on"):
            scan.begin("part")
        busy[0] = False
        with pytest.raises(InputError, match="no scan is going on"):
            scan.take_back()
        scan.begin("part")
        with pytest.raises(InputError, match="a scan is going on"):
            scan.begin("other")
        with pytest.raises(InputError, match="another program scans into"):
            ScanBeside(sensor, root=tmp_path).begin("part")
        sensor.put(0.5, 0.5, 0.0)
        said(scan, SHORT)
        sensor.put(*HELD, 0.0)
        said(scan, "press 0: ")
        sensor.put(*HELD, 0.0, calibration="another")
        said(scan, "of another sensor or calibration")
        assert (scan.state() or {})["refused"]
        blind = replace(frame(0.5), contact=replace(frame(0.5).contact, indentation_mm=np.nan))
        sensor._queue.put(blind)
        said(scan, "no calibration")
        eventually(lambda: not scan.scanning, 20)
