"""A real sensor on a kernel and a bus made of nothing: lit, set, unplugged in mid-stream, found again, never stale."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.calibration import Calibration, LedSetting, write_calibration
from gellight.camera import ReconnectingError
from gellight.daemon import Daemon
from gellight.enumerations import Dark
from gellight.errors import BoardError, CalibrationError, CameraError, GellightError
from gellight.protocol import DarkEvent
from gellight.sensor_camera import SensorCamera, open_sensor
from gellight.sensor_connection import Surroundings
from gellight.v4l2 import controls as c
from gellight.v4l2.errors import BusyError, DeniedError
from tests.host.fake_kernel import FakeCamera, FakeKernel
from tests.host.fake_usb import FakeUsb
from tests.host.linear_sensor import linear_network
from tests.host.test_daemon import CountingReconstructor

SIZE = "width=32&height=24&format=YUYV"
BOARD = "E660C06213842F2A"


class FakeRing:
    """Notes what is asked of it; the LEDs shine 20 ms after they are set."""

    def __init__(self, kernel: FakeKernel, url: str, unique_id: str = BOARD) -> None:
        self.kernel, self.lit, self.open = kernel, np.zeros((12, 3), np.uint8), True
        self.transport = SimpleNamespace(url=url)
        self.hello = SimpleNamespace(unique_id=bytes.fromhex(unique_id))
        self.lit_s = 0.0
        self.refusal: BoardError | None = None
        self.mute = False
        self.still: np.ndarray | None = None
        self.event_listeners: list[Any] = []
        self.ping_listeners: list[Any] = []
        self.untold: list[DarkEvent] = []

    def clock(self) -> None:
        if self.mute:
            raise BoardError("the board did not answer CLOCK")
        while self.untold:
            for listener in self.event_listeners:
                listener(self.untold[0])
            self.untold.pop(0)

    def go_dark(self) -> None:
        """What a board does that does not hear from its host for a second; it tells it when it is asked."""
        self.lit = np.zeros((12, 3), np.uint8)
        self.untold.append(DarkEvent(time_us=0, events_dropped=0, dark=Dark.HOST_SILENT))

    def set_leds(self, colours: np.ndarray) -> SimpleNamespace:
        if self.refusal:
            raise self.refusal
        self.lit = self.still = colours
        return SimpleNamespace(light_id=1)

    def blank(self) -> None:
        self.lit = np.zeros((12, 3), np.uint8)

    def wait_for_light(self, light_id: int) -> None:
        self.kernel.sleep(0.02)
        self.lit_s = self.kernel.now_s

    def close(self) -> None:
        self.open = False
        self.lit = np.zeros((12, 3), np.uint8)


class Bench:
    """A computer with a bus; sensors are plugged in and pulled out."""

    def __init__(self, root: Path) -> None:
        self.kernel, self.usb, self.rings = FakeKernel(), FakeUsb(root), []  # type: ignore[var-annotated]
        self.board = BOARD
        self.cameras: dict[str, FakeCamera] = {}

    def plug(self, port: str, serial: str, **changes: Any) -> FakeCamera:
        camera = FakeCamera(payload=lambda number: bytes([128, number % 256] * 32 * 24), **changes)
        node, _ = self.usb.plug(port, serial=serial, cameras=1, rings=1)
        self.kernel.cameras[node] = self.cameras[port] = camera
        camera.next_s = self.kernel.now_s
        return camera

    def unplug(self, port: str) -> None:
        self.cameras[port].plugged = False
        self.usb.unplug(port)

    def open_ring(self, url: str) -> Any:
        if not Path(url).exists() and "://" not in url:
            raise BoardError(f"cannot open {url}")
        self.rings.append(FakeRing(self.kernel, url, self.board))
        return self.rings[-1]

    @property
    def surroundings(self) -> Surroundings:
        return Surroundings(kernel=self.kernel, sysfs=self.usb.sysfs, dev=self.usb.dev, open_ring=self.open_ring,
                            wait=lambda event, seconds: self.kernel.sleep(seconds))  # fmt: skip

    def open(self, url: str, calibration: Calibration | None = None) -> SensorCamera:
        return open_sensor(url, calibration=calibration, surroundings=self.surroundings)

    def all_dark(self) -> bool:
        return not any(ring.open or ring.lit.any() for ring in self.rings)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "computer")


@pytest.fixture
def bundle(tmp_path: Path) -> Calibration:
    colours = [((255, 0, 0), "R"), ((0, 200, 0), "G"), ((0, 0, 90), "B")]
    return write_calibration(
        tmp_path / "bundle", sensor="GL0001", reference=np.full((24, 32, 3), 100.0), reference_frames=1,
        noise_grey=1.0, pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={},
        led=tuple(LedSetting(colour=name, rgb=rgb) for rgb, name in colours for _ in range(4)),  # type: ignore[arg-type]
        camera={"exposure_us": 8000, "white_balance_k": 5000, "format": "YUYV"},
    )  # fmt: skip


def test_the_sensor_is_lit_and_set_as_its_bundle_says(bench: Bench, bundle: Calibration) -> None:
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
        assert camera.controls is not None
        assert camera.controls.read("exposure_us") == 8000
    assert bench.all_dark()
    assert not bench.kernel.opened
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_another_bundle_is_adopted_while_the_camera_runs_and_after_a_reconnection(
    bench: Bench, bundle: Calibration, tmp_path: Path
) -> None:
    device = bench.plug("1-2", "GL0001")
    darker = tuple(
        LedSetting(colour=led.colour, rgb=(led.rgb[0] // 2, led.rgb[1] // 2, 0)) for led in bundle.manifest.led
    )
    other = write_calibration(
        tmp_path / "other", sensor="GL0001", reference=np.full((24, 32, 3), 50.0), reference_frames=1, noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={}, led=darker,
        camera={"exposure_us": 16000, "format": "YUYV"},
    )  # fmt: skip
    with bench.open("auto", bundle) as camera:
        camera.read()
        camera.adopt(other)
        assert camera.read().time_s - camera.timing.stamp_error_s > bench.rings[0].lit_s
        assert device.controls[c.EXPOSURE].value == 160
        assert (bench.rings[0].lit == [led.rgb for led in darker]).all()
        bench.rings[0].refusal = BoardError("over the current limit")
        with pytest.raises(BoardError):
            camera.adopt(bundle)
        bench.unplug("1-2")
        with pytest.raises(ReconnectingError):
            camera.read()
        device = bench.plug("1-2", "GL0001")
        camera.read()
        assert device.controls[c.EXPOSURE].value == 160
        assert (bench.rings[-1].lit == [led.rgb for led in darker]).all()


def test_a_sensor_that_was_opened_dark_is_dark_again_when_a_bundle_cannot_be_adopted(
    bench: Bench, bundle: Calibration
) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open(f"auto?{SIZE}&exposure_us=4000") as camera:

        def fail(light_id: int) -> None:
            raise BoardError("the board did not say that it is lit")

        bench.rings[0].wait_for_light = fail  # type: ignore[method-assign]
        with pytest.raises(BoardError, match="did not say that it is lit"):
            camera.adopt(bundle)
        assert not bench.rings[0].lit.any()
        assert device.controls[c.EXPOSURE].value == 40
        assert camera.read().sequence == 0


def test_a_bundle_is_adopted_by_a_sensor_that_is_away_as_soon_as_it_is_back(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto?format=YUYV&width=32&height=24") as camera:
        camera.read()
        bench.unplug("1-2")
        with pytest.raises(ReconnectingError):
            camera.read()
        camera.adopt(bundle)
        bench.plug("1-3", "GL0001")
        camera.read()
        assert (bench.rings[-1].lit == [led.rgb for led in bundle.manifest.led]).all()


def test_a_sensor_that_comes_back_just_when_it_is_closed_is_dark(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    camera = bench.open("auto", bundle)
    camera.read()
    bench.unplug("1-2")
    with pytest.raises(ReconnectingError):
        camera.read()
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


def test_parameters_of_the_url_are_stronger_than_the_bundle(bench: Bench, bundle: Calibration) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open("sensor://GL0001?exposure_us=4000", bundle):
        assert device.controls[c.EXPOSURE].value == 40
        assert device.controls[c.WHITE_BALANCE].value == 5000


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


def test_the_leds_are_dark_and_the_camera_is_free_when_the_light_is_refused(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    open_ring = bench.open_ring

    def refusing(url: str) -> Any:
        ring = open_ring(url)
        ring.refusal = BoardError("over the current limit")
        return ring

    bench.open_ring = refusing  # type: ignore[method-assign]
    with pytest.raises(BoardError, match="over the current limit"):
        bench.open("auto", bundle)
    assert bench.all_dark()
    assert not bench.kernel.opened


def test_an_unplugged_sensor_is_found_again_on_another_port_and_nothing_old_comes(
    bench: Bench, bundle: Calibration
) -> None:
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


def test_a_stalled_camera_is_started_anew(bench: Bench, bundle: Calibration) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        device.stalled = True
        with pytest.raises(ReconnectingError, match="is there but sent no picture"):
            camera.read()
        device.stalled = False
        camera.read()
        assert device.streams == 2
        assert camera.status()["reconnections"] == 1


def test_a_ring_that_is_pulled_out_alone_ends_the_frames_too(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        Path(bench.rings[0].transport.url).unlink()
        bench.kernel.sleep(3)
        with pytest.raises(ReconnectingError, match=r"light ring at .* was unplugged"):
            camera.read()


def test_a_board_that_has_died_ends_the_frames_until_it_answers_again(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        bench.rings[0].mute = True
        bench.kernel.sleep(3)
        with pytest.raises(ReconnectingError, match="did not answer CLOCK"):
            camera.read()
        camera.read()
        assert len(bench.rings) == 2
        assert bench.rings[1].lit.any()


def test_leds_that_the_board_made_dark_are_lit_again_and_no_dark_frame_is_delivered(
    bench: Bench, bundle: Calibration, caplog: pytest.LogCaptureFixture
) -> None:
    device = bench.plug("1-2", "GL0001")
    device.payload = lambda number: bytes([200 if bench.rings[0].lit.any() else 10, 128] * 32 * 24)
    with bench.open("auto", bundle) as camera:
        camera.read()
        bench.kernel.at(bench.kernel.now_s + 1.0, bench.rings[0].go_dark)
        bench.kernel.sleep(1.5)
        frames = [camera.read() for _ in range(5)]
        assert min(frame.image.mean() for frame in frames) > 150
        assert (bench.rings[0].lit == [led.rgb for led in bundle.manifest.led]).all()
        assert camera.status()["reconnections"] == 0
    assert "made its LEDs dark (host silent); they are lit again" in caplog.text


def test_a_light_of_somebody_else_that_went_dark_is_left_to_him(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        bench.rings[0].set_leds(np.full((12, 3), 9, np.uint8))
        bench.rings[0].go_dark()
        bench.kernel.sleep(1.0)
        camera.read()
        assert not bench.rings[0].lit.any()


def test_a_bundle_that_does_not_tell_its_light_is_told(
    bench: Bench, bundle: Calibration, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bench.plug("1-2", "GL0001")
    unlit = write_calibration(
        tmp_path / "unlit", sensor="GL0001", reference=np.full((24, 32, 3), 50.0), reference_frames=1, noise_grey=1.0,
        pixel_size_mm=(0.1, 0.1), network=linear_network(), metrics={}, camera={"format": "YUYV"},
    )  # fmt: skip
    with bench.open("auto", unlit) as camera:
        assert not bench.rings[0].lit.any()
        camera.adopt(bundle)
        assert bench.rings[0].lit.any()
        camera.adopt(unlit)
        assert not bench.rings[0].lit.any(), "the light of another bundle is not left on"
    assert "does not tell the colours of its LEDs: they stay dark" in caplog.text


def test_settings_changed_by_another_programme_are_noticed_and_set_again(bench: Bench, bundle: Calibration) -> None:
    device = bench.plug("1-2", "GL0001")
    with bench.open("auto", bundle) as camera:
        camera.read()
        device.controls[c.EXPOSURE].value = 200
        bench.kernel.sleep(3)
        with pytest.raises(ReconnectingError, match="somebody changed the camera: exposure_us was set to 8000 and is"):
            camera.read()
        camera.read()
        assert device.controls[c.EXPOSURE].value == 80


def test_time_stamps_that_stand_still_are_not_believed_for_long(bench: Bench, bundle: Calibration) -> None:
    bench.plug("1-2", "GL0001", stamp=lambda number, time_s: 99.5 + number * 1e-6)
    with bench.open("auto", bundle) as camera:
        frame = camera.read()
        assert frame.time_s > bench.rings[0].lit_s
        assert camera.status()["wrong_stamps"] == 1


def test_a_bundle_of_a_camera_with_other_controls_is_refused(bench: Bench, bundle: Calibration) -> None:
    device = bench.plug("1-2", "GL0001")
    del device.controls[c.WHITE_BALANCE]
    with pytest.raises(GellightError, match="no control white_balance_k"):
        bench.open("auto", bundle)
    assert bench.all_dark()


def test_the_daemon_serves_its_status_while_the_sensor_is_away_and_goes_on(bench: Bench, bundle: Calibration) -> None:
    import time

    bench.plug("1-2", "GL0001")
    sensor = bench.open("auto", bundle)

    class Paced(SensorCamera):
        """The same sensor, in real time: virtual time would race ahead."""

        def read(self) -> Any:
            time.sleep(0.002)
            return super().read()

    sensor.__class__ = Paced
    reconstructor: Any = CountingReconstructor()
    with Daemon(sensor, reconstructor) as daemon:
        before = daemon.wait_frame(10, 10).camera_frame
        told: list[Any] = []
        bench.rings[0].close = lambda: told.append(daemon.status()["error"])  # type: ignore[method-assign]
        bench.unplug("1-2")
        deadline = time.monotonic() + 10
        while "reconnecting" not in (daemon.status()["error"] or "") and time.monotonic() < deadline:
            time.sleep(0.005)
        assert "was unplugged" in told[0], "before the ring was given up, which may take seconds"
        bench.rings.pop(0)
        status: Any = daemon.status()
        assert "reconnecting to sensor GL0001" in status["error"]
        assert status["camera"]["connection"] == "reconnecting"
        with pytest.raises(TimeoutError):
            daemon.wait_frame(-1, 0.2)
        replugged_s = bench.kernel.now_s
        bench.plug("1-5", "GL0001")
        after = daemon.wait_frame(before.sequence, 10).camera_frame
        assert after.time_s > replugged_s, "the first frame that is delivered was taken after the sensor came back"
        status = daemon.status()
        assert status["error"] is None
        assert status["camera"]["reconnections"] == 1
    assert bench.all_dark()


def test_the_session_refuses_a_camera_of_another_size_and_leaves_the_leds_dark(
    bench: Bench, bundle: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gellight import session
    from gellight.config import load_settings

    bench.plug("1-2", "GL0001")
    monkeypatch.setattr(session, "load_calibration", lambda name: bundle)
    monkeypatch.setattr(session, "open_camera", lambda url, geometry, calibration: bench.open(url, calibration))
    settings = load_settings({"sensor.url": "auto?width=640&height=480"}, environment={}, folder=Path("/nowhere"),
                             user_folder=Path("/nowhere"))  # fmt: skip
    with pytest.raises(CalibrationError, match=r"delivers 640x480 pixels, the calibration .* is for 32x24"):
        session.open_session(settings)
    assert bench.all_dark()
