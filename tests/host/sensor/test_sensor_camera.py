"""A real sensor on a kernel and a bus made of nothing: lit, set, unplugged in mid-stream, found again, never stale."""

from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BoardError, CameraError, GellightError
from gellight.bundle.bundle import Bundle, LedSetting, write_bundle
from gellight.bundle.manifest import CAPTURE_OPTIONS
from gellight.frames.camera import ReconnectingError
from gellight.ring.protocol import DimmedEvent
from gellight.sensor.sensor_camera import SensorCamera
from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2.errors import BusyError, DeniedError
from gellight.sensor.v4l2.options import CaptureOptions
from tests.helpers.linear_sensor import linear_network
from tests.helpers.sensor_bench import BOARD, Bench, lit_bundle

SIZE = "width=32&height=24&format=YUYV"


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return lit_bundle(tmp_path / "bundle")


def unplug(bench: Bench, port: str, camera: SensorCamera) -> None:
    bench.unplug(port)
    with pytest.raises(ReconnectingError):
        camera.read()


def test_the_sensor_is_lit_and_set_as_its_bundle_says_but_for_what_the_url_says(bench: Bench, bundle: Bundle) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        frame = camera.read()
        assert (bench.rings[0].lit == [led.rgb for led in bundle.manifest.led]).all()
        assert frame.time_s - camera.timing.stamp_error_s > bench.rings[0].lit_s, "nothing from before the light"
        assert frame.image.shape == (24, 32, 3)
        assert device.controls[c.EXPOSURE].value == 80
        assert device.controls[c.WHITE_BALANCE].value == 5000
        assert device.controls[c.DYNAMIC_RATE].value == 0
        assert camera.ring is bench.rings[0]
        assert camera.controls.read("exposure_us") == 8000
    assert bench.all_dark()
    assert not bench.kernel.opened
    with pytest.raises(CameraError, match="is closed"):
        camera.read()
    with bench.open("sensor://GL0001?exposure_us=4000", bundle):
        assert device.controls[c.EXPOSURE].value == 40
        assert device.controls[c.WHITE_BALANCE].value == 5000


def test_another_bundle_is_adopted_while_the_camera_runs_and_after_a_reconnection(
    bench: Bench, bundle: Bundle, tmp_path: Path
) -> None:
    device = bench.plug("1-2", "GL0001")
    darker = tuple(
        LedSetting(colour=led.colour, rgb=(led.rgb[0] // 2, led.rgb[1] // 2, 0)) for led in bundle.manifest.led
    )
    other = write_bundle(
        tmp_path / "other", sensor="GL0001", reference=np.full((24, 32, 3), 50.0), reference_frames=1, noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={}, led=darker,
        camera={"exposure_us": 16000, "format": "YUYV"},
    )  # fmt: skip
    with bench.open("auto", bundle) as camera:
        camera.read()
        camera.adopt(other.controls, other.colours)
        assert camera.read().time_s - camera.timing.stamp_error_s > bench.rings[0].lit_s
        assert device.controls[c.EXPOSURE].value == 160
        assert (bench.rings[0].lit == [led.rgb for led in darker]).all()
        bench.rings[0].refusal = BoardError("over the current limit")
        with pytest.raises(BoardError):
            camera.adopt(bundle.controls, bundle.colours)
        unplug(bench, "1-2", camera)
        device = bench.plug("1-2", "GL0001")
        camera.read()
        assert device.controls[c.EXPOSURE].value == 160
        assert (bench.rings[-1].lit == [led.rgb for led in darker]).all()


def test_a_sensor_that_was_opened_dark_is_dark_again_when_a_bundle_cannot_be_adopted(
    bench: Bench, bundle: Bundle
) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open(f"auto?{SIZE}&exposure_us=4000") as camera:

        def fail(colours: np.ndarray | None) -> None:
            bench.rings[0].lit = np.zeros((12, 3), np.uint8) if colours is None else colours
            if colours is not None:
                raise BoardError("the board did not say that it is lit")

        bench.rings[0].light = fail  # type: ignore[method-assign]
        with pytest.raises(BoardError, match="did not say that it is lit"):
            camera.adopt(bundle.controls, bundle.colours)
        assert not bench.rings[0].lit.any()
        assert device.controls[c.EXPOSURE].value == 40
        assert camera.read().sequence == 0


def test_what_the_url_says_holds_when_others_are_adopted_and_unknown_controls_are_refused(bench: Bench) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open(f"auto?{SIZE}&exposure_us=4000") as camera:
        camera.adopt({"exposure_us": 9000, "white_balance_k": 4000}, None)
        assert device.controls[c.EXPOSURE].value == 40
        assert device.controls[c.WHITE_BALANCE].value == 4000
        camera.controls.set("white_balance_k", 4500)
        camera.adopt({}, np.full((12, 3), 7, np.uint8))
        assert device.controls[c.WHITE_BALANCE].value == 4500, "what is not named stays"
        assert (bench.rings[0].lit == 7).all()
        with pytest.raises(CameraError, match="no control 'focus'"):
            camera.adopt({"focus": 3}, None)
        assert (bench.rings[0].lit == 7).all(), "what is refused changes nothing"


def test_a_bundle_tells_capture_options_and_controls_apart_as_the_cameras_do() -> None:
    assert set(CaptureOptions.model_fields) - set(c.KNOBS) == CAPTURE_OPTIONS


def test_a_bundle_is_adopted_by_a_sensor_that_is_just_being_opened_again(
    bench: Bench, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto?format=YUYV&width=32&height=24") as camera:
        camera.read()
        unplug(bench, "1-2", camera)
        bench.plug("1-2", "GL0001")
        opened = bench.kernel.open

        def open_slowly(path: str) -> int:
            monkeypatch.setattr(bench.kernel, "open", opened)
            camera.adopt({**bundle.controls, "exposure_us": 4000}, bundle.colours)  # by another thread
            return opened(path)

        monkeypatch.setattr(bench.kernel, "open", open_slowly)
        camera.read()
        assert (bench.rings[-1].lit == [led.rgb for led in bundle.manifest.led]).all()
        assert camera.controls.read("exposure_us") == 4000


def test_a_sensor_that_comes_back_just_when_it_is_closed_is_dark(bench: Bench, bundle: Bundle) -> None:
    bench.plug("1-2", "GL0001")
    camera = bench.open("auto", bundle)
    camera.read()
    unplug(bench, "1-2", camera)
    bench.plug("1-2", "GL0001")
    opened = bench.kernel.open

    def closing(path: str) -> int:
        camera.close()
        return opened(path)

    bench.kernel.open = closing  # type: ignore[method-assign]
    with pytest.raises(CameraError, match="is closed"):
        camera.read()
    assert bench.all_dark()
    assert not bench.kernel.opened


def test_a_camera_that_is_closed_while_another_thread_reads_is_closed_not_away(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    bench.plug("1-4", "GL0001", formats={"YUYV": {(32, 24): [30]}})
    camera = bench.open("auto")
    camera.read()
    bench.kernel.at(bench.kernel.now_s + 0.005, camera.close)
    for _ in range(2):
        with pytest.raises(CameraError, match="is closed: open it again"):
            camera.read()
    assert camera.status()["reconnecting_s"] is None
    assert not [record for record in caplog.records if "stream" in record.message]


def test_a_camera_alone_has_no_ring_unless_one_is_named(bench: Bench) -> None:
    bench.plug("1-2", "GL0001")
    node = next(iter(bench.kernel.cameras))
    with bench.open(f"v4l2://{node}?{SIZE}") as camera:
        assert camera.ring is None
        assert camera.read().sequence == 0
        assert not bench.rings
    with bench.open(f"v4l2://{node}?{SIZE}&ring=serial://GL0001") as camera:
        assert camera.ring is bench.rings[0]
    assert bench.all_dark()


def test_ring_and_camera_of_different_sensors_are_refused(bench: Bench) -> None:
    bench.plug("1-2", "GL0001")
    bench.plug("1-3", "GL0002")
    first = next(iter(bench.kernel.cameras))
    with pytest.raises(CameraError, match=r"of different sensors: serial://GL0002 belongs to .* use sensor://GL0002"):
        bench.open(f"v4l2://{first}?{SIZE}&ring=serial://GL0002")
    bench.usb.unplug("1-2")
    bench.plug("1-2", "0123456789ABCDEF")
    with pytest.raises(BoardError, match=f"is {BOARD}, the one beside the camera is 0123456789ABCDEF"):
        bench.open(f"sensor://0123456789ABCDEF?{SIZE}")
    assert bench.all_dark()


@pytest.mark.parametrize(
    ("fault", "kind"),
    [({"busy": True}, BusyError), ({"denied": True}, DeniedError), ({"formats": {"MJPG": {(8, 8): [5]}}}, CameraError)],
)
def test_the_leds_are_dark_when_the_camera_cannot_be_used(bench: Bench, fault: dict[str, Any], kind: type) -> None:
    bench.plug("1-2", "GL0001", **fault)
    with pytest.raises(kind):
        bench.open(f"auto?{SIZE}")
    assert len(bench.rings) == 1
    assert bench.all_dark()


def test_the_leds_are_dark_and_the_camera_is_free_when_light_or_controls_are_refused(
    bench: Bench, bundle: Bundle
) -> None:
    device = bench.plug("1-2", "GL0001")
    open_ring = bench.open_ring

    def refusing(url: str) -> Any:
        ring = open_ring(url)
        ring.refusal = BoardError("over the current limit")
        return ring

    bench.open_ring = refusing  # type: ignore[method-assign]
    with pytest.raises(BoardError, match="over the current limit"):
        bench.open("auto", bundle)
    assert bench.all_dark()
    del device.controls[c.WHITE_BALANCE]
    with pytest.raises(GellightError, match="no control white_balance_k"):
        bench.open("auto", bundle)
    assert bench.all_dark()
    assert not bench.kernel.opened


def test_an_unplugged_sensor_is_found_again_on_another_port_and_nothing_old_comes(bench: Bench, bundle: Bundle) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        frames = [camera.read() for _ in range(20)]
        bench.unplug("1-2")
        with pytest.raises(ReconnectingError, match=r"reconnecting to sensor GL0001 since 0.0 s: .*was unplugged"):
            camera.read()
        assert bench.all_dark()
        assert camera.ring is None
        for _ in range(4):
            with pytest.raises(ReconnectingError, match=r"since \d"):
                camera.read()
        status = camera.status()
        assert (status["connection"], status["reconnections"]) == ("reconnecting", 0)
        assert 1.5 < float(str(status["reconnecting_s"])) < 3
        bench.plug("1-4", "GL0002")
        with pytest.raises(ReconnectingError, match="GL0001 is not there"):
            camera.read()
        replugged_s = bench.kernel.now_s
        bench.plug("1-3.1", "GL0001")
        frames.append(camera.read())
        assert frames[-1].time_s > replugged_s
        assert [frame.sequence for frame in frames] == list(range(21))
        frames.append(camera.read())
        assert frames[-1].sequence == 21
        assert bench.rings[-1].lit.any()
        status = camera.status()
        assert (status["connection"], status["reconnections"], status["why"]) == ("connected", 1, None)
        assert status["delivered"] >= 22, "counted over all connections"
    assert bench.all_dark()


def test_a_sensor_without_a_bundle_comes_back_in_the_size_it_had(bench: Bench) -> None:
    """At another port of the computer a camera may offer more."""
    sizes = {(32, 24): [30], (64, 48): [30]}
    bench.plug("1-2", "GL0001", formats={"YUYV": {(32, 24): [30]}})
    with bench.open("auto") as camera:
        assert camera.read().image.shape == (24, 32, 3)
        unplug(bench, "1-2", camera)
        bench.plug("1-3", "GL0001", formats={"YUYV": sizes})
        assert camera.read().image.shape == (24, 32, 3)
        unplug(bench, "1-3", camera)
        bench.plug("1-4", "GL0001", formats={"YUYV": {(64, 48): [30]}})
        with pytest.raises(ReconnectingError, match=r"does not offer .* 32x24"):
            camera.read()


def test_a_sensor_whose_serial_number_is_shared_comes_back_only_at_its_port(bench: Bench) -> None:
    bench.plug("1-2", "SAME")
    bench.plug("1-3", "SAME")
    with bench.open(f"sensor://1-3?{SIZE}") as camera:
        camera.read()
        bench.unplug("1-3")
        for _ in range(3):
            with pytest.raises(ReconnectingError):
                camera.read()
        bench.plug("1-3", "SAME")
        assert camera.read().sequence == 1


def dark(bench: Bench, dimmed: int) -> None:
    bench.rings[0].heat.note(DimmedEvent(0, 350, 0, dimmed, 0, 610))
    bench.rings[0].lit_s = inf


def pull_the_ring(bench: Bench) -> None:
    Path(bench.rings[0].transport.url).unlink()
    bench.kernel.sleep(3)


def mute_the_board(bench: Bench) -> None:
    bench.rings[0].mute = True
    bench.kernel.sleep(3)


def change_the_exposure(bench: Bench) -> None:
    bench.cameras["1-2"].controls[c.EXPOSURE].value = 200
    bench.kernel.sleep(3)


@pytest.mark.parametrize(
    ("fault", "why", "comes_back"),
    [
        (lambda bench: setattr(bench.cameras["1-2"], "stalled", True), "is there but sent no picture", True),
        (pull_the_ring, r"light ring at .* was unplugged", False),
        (mute_the_board, "did not answer CLOCK", True),
        (lambda bench: dark(bench, 0), "keeps its LEDs dark: see `gellight ring info`", True),
        (lambda bench: dark(bench, 2), "the ring 61 °C .* LEDs to 1/4", True),
        (change_the_exposure, "somebody changed the camera: exposure_us was set to 8000 and is", True),
    ],
    ids=["camera stalls", "ring is pulled", "board has died", "board stays dark", "board is hot", "settings changed"],
)
def test_what_goes_wrong_is_told_and_the_sensor_is_opened_anew(
    bench: Bench, bundle: Bundle, fault: Callable[[Bench], object], why: str, comes_back: bool
) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        fault(bench)
        with pytest.raises(ReconnectingError, match=why):
            camera.read()
        device.stalled = False
        if comes_back:
            camera.read()
            assert (device.streams, len(bench.rings), camera.status()["reconnections"]) == (2, 2, 1)
            assert bench.rings[1].lit.any()
            assert device.controls[c.EXPOSURE].value == 80


def test_no_dark_frame_is_delivered_while_the_ring_lights_its_leds_again(bench: Bench, bundle: Bundle) -> None:
    device = bench.plug("1-2", "GL0001")
    device.payload = lambda number: bytes([200 if bench.rings[0].lit.any() else 10, 128] * 32 * 24)
    with bench.open("auto", bundle) as camera:
        camera.read()
        bench.kernel.at(bench.kernel.now_s + 1.0, bench.rings[0].go_dark)
        bench.kernel.sleep(1.5)
        dark_until_s = bench.kernel.now_s + 0.25
        frames = [camera.read() for _ in range(5)]
        assert min(frame.image.mean() for frame in frames) > 150
        assert frames[0].time_s > dark_until_s
        assert (bench.rings[0].lit == bundle.colours).all()
        assert camera.status()["reconnections"] == 0


def test_a_bundle_that_does_not_tell_its_light_is_told(
    bench: Bench, bundle: Bundle, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bench.plug("1-2", "GL0001")
    unlit = write_bundle(
        tmp_path / "unlit", sensor="GL0001", reference=np.full((24, 32, 3), 50.0), reference_frames=1, noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={}, camera={"format": "YUYV"},
    )  # fmt: skip
    with bench.open("auto", unlit) as camera:
        assert not bench.rings[0].lit.any()
        camera.adopt(bundle.controls, bundle.colours)
        assert bench.rings[0].lit.any()
        camera.adopt(unlit.controls, unlit.colours)
        assert not bench.rings[0].lit.any(), "the light of another bundle is not left on"
    assert "does not tell the colours of its LEDs: they stay dark" in caplog.text
