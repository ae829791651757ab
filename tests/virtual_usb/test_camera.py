"""The camera of the virtual sensor: what is negotiated is what comes, and controls act on the picture."""

import itertools
import socket
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from gellight.base.errors import InputError
from tests.helpers.scripted_camera import ScriptedControls
from tests.helpers.usb_client import CAMERA, MJPG, PROCESSING, YUYV, CardCamera, Payload, UsbClient
from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.encoding import read_mark
from tests.virtual_usb.faults import Faults

EXPOSURE, AUTO_EXPOSURE, GAIN, BALANCE, AUTO_BALANCE = 4, 2, 4, 10, 11
"""selectors"""


@pytest.fixture
def camera() -> CardCamera:
    return CardCamera()


@pytest.fixture
def sensor(camera: CardCamera) -> Iterator[VirtualSensor]:
    with VirtualSensor(camera, frame_rate=200, serial_number="1") as sensor:
        yield sensor


@pytest.fixture
def client(sensor: VirtualSensor) -> Iterator[UsbClient]:
    ours, theirs = socket.socketpair()
    sensor.plug(theirs)
    with ours:
        client = UsbClient(ours)
        client.set_control(CAMERA, AUTO_EXPOSURE, 1, 1)
        client.set_control(PROCESSING, AUTO_BALANCE, 1, 0)
        yield client


def picture(payload: Payload) -> np.ndarray:
    """(H, W, 3) RGB of an MJPG payload."""
    return cv2.imdecode(np.frombuffer(payload.data, np.uint8), cv2.IMREAD_COLOR_RGB)


def settled(client: UsbClient) -> np.ndarray:
    """A picture that was begun after all controls act."""
    for _ in range(4):
        payload = client.payload()
    return picture(payload).astype(float)


def test_jpegs_show_what_the_camera_sees_and_say_when(client: UsbClient, camera: CardCamera) -> None:
    assert client.start(MJPG)[:2] == (MJPG, 1)
    payloads = [client.payload() for _ in range(5)]
    assert np.abs(picture(payloads[-1]).astype(int) - camera.card).mean() < 2
    marks = [read_mark(payload.data) for payload in payloads]
    assert [mark.number for mark in marks] == [1, 2, 3, 4, 5]
    assert all(later.time_s > mark.time_s for mark, later in itertools.pairwise(marks))
    assert marks[0].exposure_us == 8000


def test_yuyv_shows_what_the_camera_sees(client: UsbClient, camera: CardCamera) -> None:
    client.start(YUYV)
    data = client.payload().data
    assert len(data) == 64 * 48 * 2
    image = cv2.cvtColor(np.frombuffer(data, np.uint8).reshape(48, 64, 2), cv2.COLOR_YUV2RGB_YUYV)
    assert np.abs(image.astype(int) - camera.card).mean() < 2


def test_the_smaller_size_shows_all_of_the_picture(client: UsbClient, camera: CardCamera) -> None:
    client.start(MJPG, 2)
    image = picture(client.payload())
    assert image.shape == (24, 32, 3)
    assert image.mean() == pytest.approx(camera.card.mean(), abs=2)


def test_half_the_rate_leaves_out_every_other_picture(client: UsbClient) -> None:
    assert client.start(MJPG, 1, 100_000)[2] == 100_000
    numbers = [read_mark(client.payload().data).number for _ in range(4)]
    assert np.diff(numbers).tolist() == [2, 2, 2]


@pytest.mark.parametrize(("asked", "chosen"), [((9, 9, 1), (YUYV, 2, 50_000)), ((0, 0, 10**8), (MJPG, 1, 200_000))])
def test_what_is_not_offered_becomes_the_nearest(
    client: UsbClient, asked: tuple[int, int, int], chosen: tuple[int, int, int]
) -> None:
    assert client.start(*asked) == chosen


@pytest.mark.parametrize("urb_bytes", [64 * 48 * 2 + 2, 512, 1024, 65536])
def test_a_picture_ends_whatever_the_size_of_the_urbs(client: UsbClient, urb_bytes: int) -> None:
    client.start(YUYV)
    payloads = [client.payload(urb_bytes=urb_bytes) for _ in range(4)]
    assert [len(payload.data) for payload in payloads] == [64 * 48 * 2] * 4
    assert [payload.flags & 1 for payload in payloads] == [0, 1, 0, 1], "each picture toggles the frame bit"


def test_exposure_and_gain_scale_the_picture_and_white_balance_its_colours(client: UsbClient) -> None:
    client.start()
    before = settled(client)
    client.set_control(CAMERA, EXPOSURE, 4, 40)
    half = settled(client)
    assert half.mean() / before.mean() == pytest.approx(0.5, abs=0.02)
    client.set_control(PROCESSING, GAIN, 2, 16)
    assert settled(client).mean() / half.mean() == pytest.approx(2, abs=0.05)
    client.set_control(PROCESSING, GAIN, 2, 0)
    client.set_control(PROCESSING, BALANCE, 2, 2800)
    colours = settled(client).mean(axis=(0, 1)) / half.mean(axis=(0, 1))
    warmth = (2800 / 4600) ** 0.6
    assert colours == pytest.approx([warmth, 1, 1 / warmth], abs=0.03)


class OwnControls(ScriptedControls):
    """Controls of a camera itself: no white balance; its gain ends at 4."""

    def names(self) -> tuple[str, ...]:
        return ("exposure_us", "gain")

    def range(self, name: str) -> tuple[float, float, float]:
        return (1.0, 4.0, 0.1) if name == "gain" else super().range(name)


def test_the_controls_of_the_camera_are_set_as_near_as_its_ranges_allow(client: UsbClient, camera: CardCamera) -> None:
    camera.controls = OwnControls()
    client.set_control(CAMERA, EXPOSURE, 4, 40)
    client.set_control(PROCESSING, GAIN, 2, 112)
    client.start()
    assert settled(client).mean() == pytest.approx(camera.card.mean(), abs=2), "the picture is as the camera gives it"
    assert {name: camera.controls.read(name) for name in camera.controls.names()} == {
        "exposure_us": 4000.0,
        "gain": 4.0,
    }


def test_a_camera_without_controls_is_told_and_ends_the_stream(
    sensor: VirtualSensor, client: UsbClient, camera: CardCamera, caplog: pytest.LogCaptureFixture
) -> None:
    camera.controls = None
    client.start()
    with pytest.raises(ConnectionError):
        client.payload()
    assert sensor.unplugged.wait(5)
    assert "card has no controls" in caplog.text


def test_a_new_value_acts_on_the_second_picture_after_it(sensor: VirtualSensor, client: UsbClient) -> None:
    client.start()
    settled(client)
    marks = [read_mark(client.payload().data)]
    client.set_control(CAMERA, EXPOSURE, 4, 40)
    marks += [read_mark(client.payload().data) for _ in range(4)]
    exposures = [mark.exposure_us for mark in marks]
    assert (exposures[0], exposures[-1]) == (8000, 4000)
    assert exposures.count(8000) >= 2


def test_an_automatic_keeps_its_control_out_of_the_hosts_hand(sensor: VirtualSensor, client: UsbClient) -> None:
    client.set_control(CAMERA, AUTO_EXPOSURE, 1, 8)
    client.set_control(PROCESSING, AUTO_BALANCE, 1, 1)
    assert client.set_control(CAMERA, EXPOSURE, 4, 40) == -32
    assert client.set_control(PROCESSING, BALANCE, 2, 3000) == -32
    client.start()
    dark = sensor.video.controls.snapshot()["exposure_us"]
    for _ in range(12):
        client.payload()
    assert sensor.video.controls.snapshot()["exposure_us"] != dark, "it steers by itself"


@pytest.mark.parametrize(
    ("unit", "selector", "size", "value"), [(CAMERA, 4, 4, 0), (CAMERA, 2, 1, 3), (PROCESSING, 4, 2, 999)]
)
def test_values_out_of_range_are_refused(client: UsbClient, unit: int, selector: int, size: int, value: int) -> None:
    before = client.control(unit, selector, size)
    assert client.set_control(unit, selector, size, value) == -32
    assert client.control(unit, selector, size) == before


def test_controls_tell_range_step_and_default(client: UsbClient) -> None:
    asked = [client.get(0x21, code, EXPOSURE << 8, CAMERA, 4).data for code in (0x82, 0x83, 0x84, 0x87)]
    assert [int.from_bytes(data, "little") for data in asked] == [1, 5000, 1, 80]
    assert client.get(0x21, 0x85, EXPOSURE << 8, CAMERA, 2).data == b"\4\0"


# ---- faults ----


def test_a_control_that_does_not_hold_takes_the_value_and_keeps_the_old(
    sensor: VirtualSensor, client: UsbClient
) -> None:
    sensor.inject(Faults(stuck="gain"))
    assert client.set_control(PROCESSING, GAIN, 2, 32) == 0
    assert client.control(PROCESSING, GAIN, 2) == 0


def test_lost_pictures_are_missing_without_a_trace(sensor: VirtualSensor, client: UsbClient) -> None:
    sensor.inject(Faults(drop=0.5))
    client.start()
    payloads = [client.payload() for _ in range(20)]
    steps = np.diff([read_mark(payload.data).number for payload in payloads])
    assert steps.max() > 1
    assert [payload.flags & 1 for payload in payloads] == [0, 1] * 10


def test_a_torn_picture_is_cut_off(sensor: VirtualSensor, client: UsbClient) -> None:
    sensor.inject(Faults(torn=1))
    client.start()
    assert not client.payload().data.endswith(b"\xff\xd9")
    client.stop()
    client.start(YUYV)
    assert len(client.payload().data) < 64 * 48 * 2


def test_a_damaged_picture_is_marked_and_a_repeated_one_is_the_same(sensor: VirtualSensor, client: UsbClient) -> None:
    sensor.inject(Faults(error=1, duplicate=1))
    client.start()
    first, second = client.payload(), client.payload()
    assert first.flags & second.flags & 0x40
    assert first.data == second.data


def test_it_falls_silent_or_loses_its_cable_after_so_many_pictures(sensor: VirtualSensor, client: UsbClient) -> None:
    sensor.inject(Faults(stall_after=3))
    client.start()
    for _ in range(3):
        client.payload()
    client.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        client.payload()
    sensor.inject(Faults(unplug_after=1))
    client.socket.settimeout(5)
    with pytest.raises(ConnectionError):
        client.reply()


def test_a_control_that_is_not_there_cannot_be_stuck() -> None:
    with pytest.raises(InputError, match="exposure_us"):
        VirtualSensor(CardCamera(), serial_number="1", faults=Faults(stuck="zoom"))


def test_a_cable_whose_other_end_has_gone_leaves_no_controller_running(camera: CardCamera) -> None:
    class Counting(VirtualSensor):
        powered = 0

        def _power_on(self) -> None:
            self.powered += 1

        def _power_off(self) -> None:
            self.powered -= 1

    ours, theirs = socket.socketpair()
    theirs.close()
    with Counting(camera, serial_number="1") as sensor, ours:
        with pytest.raises(OSError, match="Broken pipe"):
            sensor.plug(ours, greeting=b"imported")
        assert sensor.powered == 0
        assert sensor.unplugged.is_set()
