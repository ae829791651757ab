"""A running sensor through any order of what changes it: it is always one whole, and what fails changes nothing."""

import errno
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from gellight.base.errors import GellightError, InputError
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.installing import install, restore
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.camera import ReconnectingError
from gellight.frames.frames import CameraFrame
from gellight.sensor.series_camera import SeriesCamera
from gellight.watch.monitor import SensorWatch
from tests.helpers.linear_sensor import verified_bundle, with_lights_of_its_own
from tests.helpers.scripted_camera import LitCamera
from tests.helpers.scripted_ring import BOARD
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually

WHITE = np.full((12, 3), 200, np.uint8)
STEPS = ("exposure_us 1", "light 1", "configuration 1", "configuration 2", "blank 1", "configure 1", "configured 1",
         "light 2")  # fmt: skip
"""what an installation asks of camera and board, in this order"""
DISK = ("gellight.bundle.bundle.write_folder", "gellight.bundle.store.write_file")


class Unplugged(LitCamera):
    """Can be away for some reads."""

    away = 0

    def read(self) -> CameraFrame:
        if self.away:
            self.away -= 1
            raise ReconnectingError("it was unplugged")
        return super().read()


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Bundle]:
    folder = tmp_path_factory.mktemp("bundles")
    old = verified_bundle(folder / "old", sensor=BOARD, rgb=(255, 200, 90), exposure_us=9000)
    new = verified_bundle(folder / "new", sensor=BOARD, rgb=(80, 81, 82), exposure_us=12000)
    broken = replace(new, files={**new.files, new.manifest.network: b"no network"})
    large = verified_bundle(folder / "large", sensor=BOARD, shape=(48, 64))
    return {"old": old, "new": new, "lights": with_lights_of_its_own(old), "broken": broken, "large": large}


class RunningSensor(RuleBasedStateMachine):
    """A session on a scripted camera with a board, and what must be true of it."""

    made: dict[str, Bundle]
    folder: Path

    def __init__(self) -> None:
        super().__init__()
        self.camera = Unplugged()
        self.store = BundleStore(self.folder / f"store{len(list(self.folder.iterdir()))}")
        self.runs = old = self.made["old"]
        self.camera.adopt(old.controls, old.colours)
        install(old, sensor=BOARD, store=self.store, camera=self.camera)
        self.history, self.memory = self.store.history(BOARD), self.camera.ring.memory.bundle
        self.setting, self.before = self.camera.setting(), None
        self.session = session_of(self.camera, Reconstructor(old), watch=SensorWatch(old)).__enter__()
        self.last, self.back = 0, None

    def teardown(self) -> None:
        self.session.__exit__()
        assert self.camera.closed
        assert not self.camera.ring.lit.any()

    # ---- what must be true ----

    @property
    def in_series(self) -> bool:
        return self.runs.source == "single lights"

    def set_as(self, bundle: Bundle, before: tuple[dict[str, float], Any] | None = None) -> None:
        """Expect the sensor to run a bundle, and to be set as it says; what it leaves open as `before`."""
        controls = {**(before or self.setting)[0], **bundle.controls}
        self.runs, self.setting = bundle, (controls, bundle.colours.tolist())

    def fails_whole_or_not_at_all(self, change: Callable[[], Any], step: str | None) -> Any:
        """Make a change of which one step fails; whether it was made, and what it returned."""
        self.camera.failures.reset(*([step] if step in STEPS else []))
        try:
            with patch(step, side_effect=OSError(errno.ENOSPC, "full")) if step in DISK else patch.dict(os.environ):
                return True, change()
        except GellightError:
            if step is None:
                raise
            return False, None
        finally:
            self.camera.failures.reset()

    @invariant()
    def it_is_one_whole(self) -> None:
        running = self.session.bundle
        assert (running.identity, running.source == "single lights") == (self.runs.identity, self.in_series)
        assert self.session.pixel_size_mm == self.runs.pixel_size_mm
        assert isinstance(self.session._camera._camera, SeriesCamera) == self.in_series
        controls, leds = self.camera.setting()
        assert controls == self.setting[0]
        assert self.in_series or leds == self.setting[1]
        assert self.camera.ring.memory.bundle == self.memory
        assert self.store.history(BOARD) == self.history
        if self.in_series:
            assert self.session.watch is None
        else:
            assert self.session.watch.paused == (self.before is not None)

    @invariant()
    def it_goes_on_with_frames_of_what_runs(self) -> None:
        frame = self.session.wait_frame(self.last, 60)
        self.last = frame.camera_frame.sequence
        assert (frame.exposures is not None) == self.in_series
        assert self.session.status()["error"] is None

    # ---- what changes it ----

    @rule(name=st.sampled_from(["old", "new", "lights"]), step=st.sampled_from([None, "exposure_us 1", "light 1"]))
    def another_bundle(self, name: str, step: str | None) -> None:
        bundle, before = self.made[name], (self.runs, self.setting)
        if self.in_series or bundle.source == "single lights":
            step = None  # the series light the ring all the time
        done, back = self.fails_whole_or_not_at_all(lambda: self.session.replace_bundle(bundle), step)
        if done:
            self.back = (back, before, self.before)
            self.set_as(bundle)

    @precondition(lambda self: self.back and self.back[2] is self.before)
    @rule()
    def taken_back(self) -> None:
        back, (self.runs, self.setting), _ = self.back
        self.back = None
        back()

    @rule(name=st.sampled_from(["old", "new"]), step=st.sampled_from([None, *STEPS, *DISK]))
    def installed(self, name: str, step: str | None) -> None:
        if self.in_series and step not in DISK:
            step = None
        bundle, parts = self.made[name], {"store": self.store, "running": self.session, "camera": self.camera}
        done, _ = self.fails_whole_or_not_at_all(lambda: install(bundle, sensor=BOARD, **parts), step)
        self.back = None
        if done:
            self.set_as(bundle)
            self.memory = bytes.fromhex(bundle.identity)
            self.history = self.store.history(BOARD)
            assert self.history[-1] == bundle.identity

    @precondition(lambda self: len(self.history) > 1)
    @rule(step=st.sampled_from([None, "configure 1"]))
    def restored(self, step: str | None) -> None:
        if self.in_series:
            step = None
        chosen, parts = self.store.previous(BOARD), {"running": self.session, "camera": self.camera}
        done, _ = self.fails_whole_or_not_at_all(lambda: restore("", sensor=BOARD, store=self.store, **parts), step)
        self.back = None
        if done:
            self.set_as(chosen.load())
            self.memory, self.history = bytes.fromhex(chosen.identity), self.store.history(BOARD)
            assert self.history[-1] == chosen.identity

    @rule(name=st.sampled_from(["broken", "large"]))
    def refused(self, name: str) -> None:
        with pytest.raises(GellightError):
            self.session.replace_bundle(self.made[name])

    @precondition(lambda self: not self.in_series)
    @rule(mode=st.sampled_from(["photometric", "magic"]))
    def another_mode(self, mode: str) -> None:
        """None of the bundles has a model of its light."""
        with pytest.raises(GellightError) as told:
            self.session.change_mode(mode)
        assert isinstance(told.value, InputError) == (mode == "magic" or self.before is not None)

    @precondition(lambda self: not self.in_series)
    @rule(grey=st.sampled_from([None, 0, 40]))
    def light(self, grey: int | None) -> None:
        colours = None if grey is None else np.full((12, 3), grey, np.uint8)
        if self.before is not None:
            with pytest.raises(InputError):
                self.session.light(colours)
            return
        self.session.light(colours)
        self.back = None
        self.set_as(self.runs)
        if colours is not None:
            self.setting = (self.setting[0], colours.tolist())

    @precondition(lambda self: self.before is None and not self.in_series)
    @rule()
    def calibration_begins(self) -> None:
        self.session.begin_calibration()
        self.before = self.setting
        self.session.camera.adopt({"exposure_us": 20000.0, "gain": 3.0}, WHITE)
        self.setting = ({**self.setting[0], "exposure_us": 20000.0, "gain": 3.0}, WHITE.tolist())

    @precondition(lambda self: self.before is not None)
    @rule(fails=st.booleans())
    def calibration_ends(self, fails: bool) -> None:
        if fails and not self.in_series:
            self.camera.failures.reset("light")
            assert not self.session.end_calibration()
            assert "light failed" in str(self.session.status()["error"])
            self.camera.failures.reset()
        assert self.session.end_calibration()
        self.set_as(self.runs, self.before)
        self.before = self.back = None

    @rule()
    def unplugged(self) -> None:
        self.camera.away = 3
        eventually(lambda: not self.camera.away)
        self.last = self.session.captured.take(0, 60)[1].sequence if not self.in_series else self.last


@pytest.mark.parametrize("examples", [12, pytest.param(200, marks=[pytest.mark.nightly, pytest.mark.timeout(900)])])
def test_whatever_changes_a_running_sensor(bundles: dict[str, Bundle], tmp_path: Path, examples: int) -> None:
    kept = {"made": bundles, "folder": tmp_path}
    machine: Any = type("RunningSensor", (RunningSensor,), kept)
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=examples, stateful_step_count=12, suppress_health_check=list(HealthCheck)),
    )
