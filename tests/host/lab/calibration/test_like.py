"""The guided routine: begun with the presses of a like unit; and what it refuses, a hand in the way or a dead LED."""

import contextlib
import io
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import BundleError, CameraError, GellightError, InputError, TrainingError
from gellight.bundle.bundle import Bundle, extend_bundle, load_bundle
from gellight.bundle.limits import Limits
from gellight.frames.image_files import ImageCamera
from gellight.lab.calibration import fitting
from gellight.lab.calibration.folder import Folder
from gellight.lab.calibration.routine import Routine
from gellight.lab.calibration.state import LIKE_UNIT, discard, kept_like, unfinished
from gellight.lab.report.pictures import write_png
from gellight.lab.simulator.simulated_camera import SimulatedCamera
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.lab.training.child import RefusedTableError
from gellight.lab.training.training import LIKE
from gellight.opening import open_camera
from tests.helpers.begun_calibration import begun_in
from tests.helpers.calibration_routine import LIT, SOON, URL, camera, finished, options, wait_for

OTHER = f"{LIT}&seed=7"
ANY = Limits(depth_mm=10.0, normal_deg=90.0)
"""which every calibration keeps: what is judged here is what it was made of"""


_opened = contextlib.ExitStack()


@pytest.fixture(autouse=True)
def closing() -> Iterator[None]:
    """Close the cameras of a test's routines."""
    with _opened:
        yield


def routine_of(folder: Path, url: str = LIT, **changes: Any) -> Routine:
    """Return a routine whose hand presses, and whose camera is closed with the test."""
    sensor = _opened.enter_context(camera(url))
    wanted = options(folder, limits=ANY, **changes)
    return Routine(sensor, wanted, folder / "state", hand=VirtualHand(sensor.stage))


@pytest.fixture(scope="module")
def first(calibrated: tuple[Path, dict[str, Any]]) -> Bundle:
    """The calibration of the first unit, called "one"."""
    return load_bundle(calibrated[0] / "bundle")


@pytest.fixture(scope="module")
def unlike(first: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """A unit whose colours are others: red answers where green did."""
    arrays = first.presses()
    arrays["rows"] = arrays["rows"][:, [1, 2, 0, *range(3, arrays["rows"].shape[1])]]
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)
    return extend_bundle(first, tmp_path_factory.mktemp("unlike") / "bundle", {"presses.npz": packed.getvalue()})


def test_two_presses_are_enough_with_those_of_a_like_unit_also_where_it_was_interrupted(
    first: Bundle, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="presses = 2: at least 8 are needed"):
        options(tmp_path, presses=2)
    begun = routine_of(tmp_path, OTHER, presses=2, like=first)
    begun.act("start")
    wait_for(begun, lambda shown: shown["step"] == "reference")
    begun.act("abort")
    begun.join(200)
    kept = kept_like(tmp_path / "state")
    assert kept.identity == first.identity
    snapshot = finished(routine_of(tmp_path, OTHER, presses=2, like=kept, training=SOON))
    assert snapshot["step"] == "finished", snapshot["problem"]
    made = load_bundle(tmp_path / "bundle")
    assert made.metrics[LIKE] == "one"
    assert len(np.unique(made.presses()["image"])) == 2
    assert 0 < snapshot["figures"]["fit"]["training"]["unlikeness"] < 0.5
    assert "Begun with the presses of one, which alone are off by" in made.files["report.html"].decode()
    assert unfinished(tmp_path / "state") is None


@pytest.mark.parametrize(("presses", "enough"), [(7, False), (8, True)])
def test_a_like_unit_that_is_none_is_dropped_and_eight_own_presses_are_enough(
    presses: int, enough: bool, first: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = RefusedTableError("it is no like unit")
    learn = Mock(side_effect=[refused, first])
    monkeypatch.setattr(fitting, "fit_judged", learn)
    for name in ("rehearse", "measure_lights", "ball_of"):
        monkeypatch.setattr(fitting, name, Mock())
    monkeypatch.setattr(fitting, "sorted_out", lambda learnt_from, *_, **__: (learnt_from, {}))
    run = Mock(options=Mock(least_presses=2))
    run.folder.presses.return_value = [Mock()] * presses
    with nullcontext() if enough else pytest.raises(TrainingError, match=r"go on, and press at least 1 more times$"):
        fitting.fit(run)
    run.drop_like.assert_called_once_with()
    assert (learn.call_count, run.folder.finish.called) == ((2, True) if enough else (1, False))
    learn.side_effect, run.options.like = refused, None
    with pytest.raises(RefusedTableError):
        fitting.fit(run)


@pytest.mark.nightly
def test_a_unit_that_is_unlike_is_dropped_and_its_own_presses_are_learnt_from(unlike: Bundle, tmp_path: Path) -> None:
    routine = routine_of(tmp_path, presses=8, like=unlike)
    snapshot = finished(routine)
    assert snapshot["step"] == "finished", snapshot["problem"]
    assert LIKE not in load_bundle(tmp_path / "bundle").metrics
    assert not (tmp_path / "state" / LIKE_UNIT).exists()


@pytest.mark.nightly
def test_with_too_few_presses_an_unlike_unit_ends_it_and_going_on_presses_more(unlike: Bundle, tmp_path: Path) -> None:
    refused = finished(routine_of(tmp_path, presses=2, like=unlike))
    assert refused["step"] == "failed"
    assert "it is no like unit, so learn without it; go on, and press at least 6 more times" in refused["problem"]
    goes_on = routine_of(tmp_path, presses=8)
    assert finished(goes_on)["step"] == "finished", goes_on.error
    assert len(np.unique(load_bundle(tmp_path / "bundle").presses()["image"])) == 8


def test_pictures_of_another_size_are_no_like_unit_and_nothing_is_begun(first: Bundle, tmp_path: Path) -> None:
    with (
        open_camera("sim://?board=0") as sensor,
        pytest.raises(InputError, match="learnt from 3 channels of 320 x 240 px, this unit has 3 of 640 x 480 px"),
    ):
        Routine(sensor, options(tmp_path, like=first), tmp_path / "state")
    assert list(tmp_path.iterdir()) == []


def test_a_bundle_without_presses_is_no_like_unit(first: Bundle, tmp_path: Path) -> None:
    bare = replace(first, files={name: body for name, body in first.files.items() if name != "presses.npz"})
    with pytest.raises(BundleError, match=r"has no presses\.npz: calibrate the sensor again"):
        routine_of(tmp_path, like=bare)
    assert list(tmp_path.iterdir()) == []


def test_another_unit_is_refused_once_the_network_is_trained(first: Bundle, unlike: Bundle, tmp_path: Path) -> None:
    folder = begun_in(tmp_path / "state")
    assert folder.keep_like(first) is not None
    again = Folder.open(tmp_path / "state", folder.state.identity)
    assert (again.keep_like(None) or unlike).identity == first.identity
    assert (again.keep_like(unlike) or first).identity == unlike.identity, "nothing is trained yet"
    again.state.steps = again.state.steps.model_copy(update={"fit": object()})
    with pytest.raises(InputError, match="is trained already, with the presses of one: go on with that, or begin anew"):
        again.keep_like(first)
    discard(tmp_path / "state")
    assert not (tmp_path / "state").exists()


# ---- what it refuses ----


class Clumsy(VirtualHand):
    """A hand that may forget to lift."""

    at_rest = False

    def lift(self) -> None:
        """Lift, or forget to."""
        if not self.at_rest:
            super().lift()


class Interrupted(VirtualHand):
    """A hand that presses the cylinder, and then something ends the routine."""

    end: Callable[[], object]

    def cylinder(self, number: int) -> None:
        """Press, and end it."""
        super().cylinder(number)
        self.end()


def swap_colours(hand: Clumsy, sensor: SimulatedCamera) -> None:
    """Let what is red look green."""
    sensor._response = sensor._scene.response = type(sensor._response)(
        exposure=sensor._response.exposure, crosstalk=((0, 1, 0), (1, 0, 0), (0, 0, 1))
    )


@pytest.mark.parametrize(
    ("disturb", "url", "told"),
    [
        (lambda hand, sensor: sensor.stage.press("CYLINDER", 0.5, 2.0, 1.0), URL, "something lies on it"),
        (lambda hand, sensor: setattr(hand, "at_rest", True), URL, "lift the tool"),
        (lambda hand, sensor: sensor._scene.led_gain.put(5, 0.0), LIT, "LED 5 stays dark"),
        (swap_colours, LIT, "shines in another colour: check the colour order"),
    ],
    ids=["a hand on the gel", "a tool that is never lifted", "a dead LED", "LEDs in another order"],
)
def test_what_disturbs_a_routine_ends_it_with_its_reason(
    disturb: Callable[[Clumsy, SimulatedCamera], None], url: str, told: str, tmp_path: Path
) -> None:
    with camera(url) as sensor:
        hand = Clumsy(sensor.stage)
        routine = Routine(sensor, options(tmp_path), tmp_path / "state", hand=hand)
        disturb(hand, sensor)
        snapshot = finished(routine)
    assert snapshot["step"] == "failed"
    assert isinstance(routine.error, GellightError)
    assert not (tmp_path / "bundle").exists()
    assert told in snapshot["problem"]


@pytest.mark.parametrize(
    ("way", "step"), [("abort", "aborted"), ("stop", "aborted"), ("camera", "failed"), ("hand", "failed")]
)
def test_however_a_routine_ends_nothing_stays_pressed_into_the_gel(way: str, step: str, tmp_path: Path) -> None:
    small = {"image_width_px": 160, "image_height_px": 120, "pixel_size_mm": 0.2352}
    with open_camera(URL, geometry=small) as sensor:
        hand = Interrupted(sensor.stage)
        routine = Routine(sensor, options(tmp_path), tmp_path / "state", hand=hand)
        ways = {"abort": lambda: routine.act("abort"), "stop": routine.stop, "camera": sensor.close,
                "hand": Mock(side_effect=RuntimeError("the hand is stuck"))}  # fmt: skip
        hand.end = ways[way]
        assert finished(routine)["step"] == step
        assert sensor.stage.status()["object"] == ""


def test_recorded_pictures_cannot_be_calibrated_live(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.full((240, 320, 3), 120, np.uint8))
    routine = Routine(ImageCamera([tmp_path / "a.png"]), options(tmp_path), tmp_path / "state")
    routine.act("start")
    routine.join(200)
    assert isinstance(routine.error, CameraError)
    assert "a calibration needs a camera that goes on delivering" in str(routine.error)
