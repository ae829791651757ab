"""The zero follows slow drift, never a touch, never far, never a jump; and what a change costs is known beforehand."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.simulator.objects import PROBES
from gellight.lab.simulator.scene import Press
from gellight.reconstruction.integration import angle_deg, normals
from gellight.watch.cells import spread
from gellight.watch.explanation import Explanation
from gellight.watch.monitor import SensorWatch
from gellight.watch.rezero import Situation, refusal
from sim_reference.camera import digitise
from sim_reference.deformation import NO_OBJECT
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.sessions import session_of
from tests.helpers.watched_sensor import NOISE_GREY, WatchedSensor

New = Callable[[int], WatchedSensor]


def fade(sensor: WatchedSensor, to: float, seconds: float) -> None:
    """Let the light fade slowly, in steps of a second."""
    for gain in np.linspace(float(sensor.gain[0]), to, round(seconds) + 1)[1:]:
        sensor.gain = np.full(3, gain)
        sensor.run(1.0)


def test_slow_drift_is_followed_and_the_depth_returns_to_zero(new_sensor: New, halved: Bundle) -> None:
    sensor = new_sensor(2000)
    sensor.run(3)
    fade(sensor, 0.96, 40)
    sensor.run(4)
    frame = sensor.frame().camera_frame
    before = Reconstructor(halved).reconstruct(frame)
    assert np.abs(before.depth_mm).mean() > 0.04, "four per cent less light is taken for a twentieth of a millimetre"
    zero = sensor.watch.propose_zero(asked=False)
    sensor.watch.accept_zero(zero)
    after = Reconstructor(halved.with_reference(zero.reference, frames=100)).reconstruct(frame)
    assert np.abs(after.depth_mm).mean() < 0.002
    assert np.abs(zero.reference - halved.reference * 0.96).mean() < 0.15
    assert sensor.watch.refusal(asked=False) == "the zero is right"


@pytest.mark.parametrize("press", [Press("BALL", 0.05, 4.0, 2.0), Press("BALL", 1.0, -9.0, 6.0), Press("TSTEP", 0.3)])
def test_the_zero_is_never_set_in_contact(new_sensor: New, whole_sensor: New, press: Press) -> None:
    sensor = (whole_sensor if press.depth_mm < 0.1 else new_sensor)(2100)
    sensor.run(3)
    fade(sensor, 0.97, 20)
    assert sensor.watch.refusal(asked=False) == ""
    sensor.run(1, press)
    for asked in (False, True):
        assert "lift everything off" in sensor.watch.refusal(asked=asked)
        with pytest.raises(InputError, match="the zero was not set: something touches"):
            sensor.watch.propose_zero(asked=asked)


@pytest.mark.parametrize("tilt", [0.0, 0.004])
def test_a_flat_plate_on_the_whole_gel_is_not_taken_for_light(
    new_sensor: New, monkeypatch: pytest.MonkeyPatch, tilt: float
) -> None:
    def plate(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        on_plate = (np.abs(x) < 23) & (np.abs(y) < 18)
        return np.where(on_plate, tilt * (x + 0.5 * y - 32), NO_OBJECT)  # its highest point, a corner, at 0

    monkeypatch.setitem(PROBES, "PLATE", plate)
    press = Press("PLATE", 0.1 + 25 * tilt)
    sensor = new_sensor(2120)
    sensor.run(4)
    sensor.run(4, press)
    assert sensor.watch.status()["state"] == "at rest", "no cell shows what light could not do"
    for asked in (False, True):
        assert "something flat pressed the whole gel" in sensor.watch.refusal(asked=asked)
    sensor.run(4)
    assert sensor.watch.refusal(asked=True) == ""


def test_a_touch_that_nobody_noticed_is_not_taken_into_the_zero(new_sensor: New, halved: Bundle) -> None:
    sensor = new_sensor(2150)
    fade(sensor, 0.97, 20)
    sensor.run(4, Press("BALL", 0.01, 4.0, 2.0))
    zero = sensor.watch.propose_zero(asked=True)
    at = (slice(120 + 17 - 6, 120 + 17 + 6), slice(160 + 34 - 6, 160 + 34 + 6))
    print_grey = sensor.scene.show(Press("BALL", 0.01, 4.0, 2.0))[0] - sensor.scene.show(None)[0]
    assert np.abs(print_grey[at]).max() > 1.0
    absorbed = zero.reference - 0.97 * halved.reference
    assert np.ptp(absorbed[at], axis=(0, 1)).max() < 0.02, "a smooth light cannot hold the print of a ball"


def test_a_jump_is_told_and_set_to_zero_only_when_asked(new_sensor: New) -> None:
    sensor = new_sensor(2200)
    sensor.run(4)
    sensor.gain = np.full(3, 0.95)
    sensor.run(5)
    assert set(sensor.told) == {"drift", "zero_off", "recalibrate"}
    off = sensor.figures("zero_off")
    assert f"depth is off by up to {off['zero_most_mm']:.2f} mm" in next(
        one.text for one in sensor.watch.findings() if one.kind == "zero_off"
    )
    assert "at once: that is no drift" in sensor.watch.refusal(asked=False)
    assert sensor.watch.refusal(asked=True) == ""
    sensor.watch.accept_zero(sensor.watch.propose_zero(asked=True))
    assert sensor.watch.status()["zeros"] == 1
    sensor.run(5)
    assert "zero_off" not in {found.kind for found in sensor.watch.findings()}, "a new zero mends it"


@pytest.mark.parametrize(("lost", "jump"), [(0.015, False), (0.06, True)])
def test_what_drifts_while_a_new_zero_is_made_slowly_is_no_jump(new_sensor: New, lost: float, jump: bool) -> None:
    sensor = new_sensor(2250)
    sensor.run(3)
    fade(sensor, 0.98, 20)
    zero = sensor.watch.propose_zero(asked=False)
    sensor.time_s += 8.0
    sensor.gain = np.full(3, 0.98 - lost)
    sensor.watch.accept_zero(zero)
    sensor.run(12)
    reason = sensor.watch.refusal(asked=False)
    assert ("at once: that is no drift" in reason) if jump else (reason == "")


def test_a_watch_may_be_told_to_set_no_zero_by_itself(new_sensor: New, halved: Bundle) -> None:
    sensor = new_sensor(2350)
    sensor.watch = SensorWatch(halved, rezero=False)
    sensor.run(3)
    fade(sensor, 0.97, 20)
    assert "only when asked" in sensor.watch.refusal(asked=False)
    assert sensor.watch.refusal(asked=True) == ""


@pytest.mark.parametrize(("leds", "gain"), [({}, 0.93), ({0: 0.5}, 1.0), ({5: 0.0}, 1.0)])
def test_the_expected_error_is_the_error_that_presses_then_show(
    new_sensor: New, halved: Bundle, leds: dict[int, float], gain: float
) -> None:
    sensor = new_sensor(2400)
    sensor.leds, sensor.gain = leds, np.full(3, gain)
    sensor.run(5)
    expected = sensor.watch.status()["expected"]
    change = sensor.watch._judgement.fitted  # type: ignore[union-attr]
    zeroed = halved.with_reference(np.clip(halved.reference + spread(change, halved.image_shape), 0, 255), frames=100)
    plain, again = Reconstructor(halved), Reconstructor(zeroed)
    untouched = plain.reconstruct(sensor.frame().camera_frame)
    flat = np.zeros_like(untouched.gradient_map)
    # The noise of the one frame adds .24 degrees to what is expected, at a right angle.
    assert expected["zero_deg"] == pytest.approx(angle_deg(untouched.normal_map, normals(flat)).mean(), rel=0.12)
    assert expected["zero_mm"] == pytest.approx(np.abs(untouched.depth_mm).mean(), rel=0.05)
    assert expected["zero_most_mm"] == pytest.approx(np.abs(untouched.depth_mm).max(), rel=0.1), "what the page shows"
    extra = sensor.contact_error_deg(again) - 0.5  # what the bundle itself is wrong by, in contact
    assert extra / 2 < expected["gain_deg"] < 2 * extra + 0.3


def fading_camera(sensor: WatchedSensor, to: float, frames: int) -> ScriptedCamera:
    """See the untouched gel while its light fades from frame to frame; four frames are a second of its clock."""
    gains, bare = np.linspace(1, to, frames), sensor.scene.show(None)[0]

    def picture(number: int) -> CameraFrame:
        lit = (bare * gains[min(number, frames - 1)]).astype(np.float32)
        return CameraFrame(image=digitise(lit, NOISE_GREY, sensor._random), time_s=number / 4, sequence=number)

    return ScriptedCamera(picture, shape=(240, 320), period_s=0.02)


def test_a_running_daemon_follows_drift_by_itself_and_goes_on_streaming(
    new_sensor: New, halved: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gellight.daemon.session.PERIOD_S", 0.01)
    camera = fading_camera(new_sensor(2500), 0.97, 160)
    with session_of(camera, Reconstructor(halved), watch=SensorWatch(halved)) as daemon:
        frame = daemon.wait_frame(0, 10)
        while frame.camera_frame.sequence < 200 or np.abs(frame.depth_mm).mean() > 0.01:
            frame = daemon.wait_frame(frame.camera_frame.sequence, 10)
            assert frame.camera_frame.sequence < 2000, "the zero was not found"
        status = daemon.status()["watch"]
        assert status["zeros"] >= 1
        assert np.abs(Reconstructor(halved).reconstruct(frame.camera_frame).depth_mm).mean() > 0.03
        assert daemon.bundle.identity == halved.identity, "a zero is no other calibration"


@pytest.mark.parametrize(
    ("situation", "by_itself", "asked"),
    [
        ({}, True, True),
        ({"explanation": None}, False, False),
        ({"touched": True}, False, False),
        ({"gains": (1.149, 0.851, 1.0)}, True, True),
        ({"gains": (1.151, 1.0, 1.0)}, False, False),
        ({"gains": (1.0, 0.849, 1.0)}, False, False),
        ({"left_grey": 0.49}, True, True),
        ({"left_grey": 0.51}, False, False),
        ({"left_grey": 3.04, "rest_grey": 2.0}, True, True),
        ({"left_grey": 3.05, "rest_grey": 2.0}, False, False),
        ({"pressed_mm": 0.01}, False, False),
        ({"since_zero_grey": 0.09}, False, True),
        ({"since_zero_grey": 0.11, "since_zero_s": 10.1, "sudden_grey": 0.99}, True, True),
        ({"since_zero_s": 9.9}, False, True),
        ({"sudden_grey": 1.01}, False, True),
    ],
)
def test_no_zero_is_set_beyond_a_bound_and_by_itself_only_what_is_worth_it_seldom_and_never_a_jump(
    situation: dict[str, Any], by_itself: bool, asked: bool
) -> None:
    assert [refusal(situated(**situation), asked=one) == "" for one in (False, True)] == [by_itself, asked]


def situated(**changes: Any) -> Situation:
    """A change of the light that a new zero may follow, but for these figures."""
    known = {"size_grey": 2.0, "left_grey": 0.0, "gains": (0.98, 0.98, 0.98), "pressed_mm": 0.0}
    explanation = Explanation(**{name: changes.pop(name, value) for name, value in known.items()})
    sound = {"touched": False, "since_zero_grey": 2.0, "sudden_grey": 0.2, "since_zero_s": 60.0}
    return Situation(**{**sound, "explanation": explanation, **changes})
