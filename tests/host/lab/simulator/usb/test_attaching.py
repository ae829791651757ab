"""Plugging a virtual sensor into a Linux: what is missing is named, and what the verb offers can be imported."""

import os
import re
import socket
import time
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest

from gellight.base.errors import BoardError, ConfigError, InputError
from gellight.cli import virtual_sensor
from gellight.lab.simulator.usb import vhci
from gellight.lab.simulator.usb.device import VirtualSensor, open_virtual, sized_geometry
from gellight.lab.simulator.usb.usbip_server import UsbipServer
from gellight.ring.light_ring import LightRing
from tests.helpers.children import GELLIGHT, gellight, started
from tests.helpers.usb_client import UsbClient, import_device

TABLE = """hub port sta spd dev      sockfd local_busid
hs  0000 006 003 00010001 000003 1-1
hs  0001 004 000 00000000 000000 0-0
hs  0002 004 000 00000000 000000 0-0
ss  0008 004 000 00000000 000000 0-0
"""
"""one high-speed port taken, two free"""


@pytest.fixture
def controller(tmp_path: Path) -> Path:
    (tmp_path / "status").write_text(TABLE)
    (tmp_path / "attach").write_text("")
    return tmp_path


def test_the_first_free_high_speed_port_is_chosen(controller: Path) -> None:
    assert vhci.choose_port(None, controller) == 1
    assert vhci.choose_port(2, controller) == 2


@pytest.mark.parametrize("port", [0, 8, 99])
def test_a_port_that_is_taken_or_of_another_speed_is_refused(controller: Path, port: int) -> None:
    with pytest.raises(BoardError, match="choose one of 1, 2"):
        vhci.choose_port(port, controller)


def test_without_a_free_port_it_says_so(controller: Path) -> None:
    (controller / "status").write_text(TABLE.replace(" 004 ", " 006 "))
    with pytest.raises(BoardError, match="all 3 virtual USB ports are taken"):
        vhci.choose_port(None, controller)


def test_a_linux_without_the_controller_is_told_how_to_get_it(tmp_path: Path) -> None:
    with pytest.raises(BoardError, match="sudo modprobe vhci-hcd"):
        vhci.choose_port(None, tmp_path / "nothing")


def test_who_is_not_root_is_told(controller: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(BoardError, match="sudo"):
        vhci.choose_port(None, controller)


def test_the_kernel_gets_port_socket_device_and_speed(controller: Path) -> None:
    ours, kernels = socket.socketpair()
    with ours, kernels:
        vhci.attach(kernels, 2, controller=controller)
        assert (controller / "attach").read_text() == f"2 {kernels.fileno()} {0x10001} 3"


def test_a_kernel_that_refuses_is_told(tmp_path: Path) -> None:
    ours, kernels = socket.socketpair()
    with ours, kernels, pytest.raises(BoardError, match="does not take"):
        vhci.attach(kernels, 2, controller=tmp_path)


@pytest.mark.parametrize("size", ["640", "8x8", "33x24", "9999x9999", "axb"])
def test_a_size_that_no_camera_has_is_refused(size: str) -> None:
    with pytest.raises(InputError, match="WIDTHxHEIGHT"):
        sized_geometry(size)


def test_a_smaller_picture_shows_the_same_gel() -> None:
    geometry = sized_geometry("160x120")
    assert float(geometry["pixel_size_mm"]) * 160 == pytest.approx(640 * 0.0588)


def test_only_a_simulated_sensor_can_be_virtual() -> None:
    with pytest.raises(InputError, match="give sim://"):
        open_virtual("v4l2:///dev/video0", serial_number="1", geometry={})
    with pytest.raises(ConfigError, match="27 LEDs"):
        open_virtual("sim://", serial_number="1", geometry={"led_colours": "RGB" * 9})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--listen", "127.0.0.1:none"], "HOST:PORT"),
        (["--listen", "127.0.0.1:0", "--fault", "melt=1"], "choose one of drop"),
        (["--listen", "127.0.0.1:0", "--serial", "GL1"], "16 hexadecimal digits"),
        *([] if vhci.CONTROLLER.is_dir() else [([], "sudo modprobe vhci-hcd")]),
    ],
)
def test_the_verb_names_what_is_wrong_in_one_line(options: list[str], message: str) -> None:
    done = gellight("virtual-sensor", *options, "--size", "32x24")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert message in done.stderr


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70_000), ("no.such.host.invalid", 0)])
def test_an_address_that_cannot_be_listened_on_is_told(host: str, port: int) -> None:
    with pytest.raises(InputError, match=f"cannot listen on {host}:{port} .*: choose another host or port"):
        UsbipServer({}, host=host, port=port)


class PluggedRing:
    """A transport to the ring at the other end of a USB cable without a kernel."""

    url = "usb client"

    def __init__(self, client: UsbClient) -> None:
        self._client = client
        self._waiting: int | None = None
        assert client.set(0x21, 0x22, 3, 0).status == 0, "DTR up"

    def write(self, data: bytes) -> None:
        number = self._client.submit(2, incoming=False, length=len(data), data=data)
        self._client.reply(number)

    def read(self, timeout_s: float) -> bytes:
        self._client.socket.settimeout(timeout_s)
        self._waiting = self._waiting or self._client.submit(2, incoming=True, length=512)
        try:
            data = self._client.reply(self._waiting).data
        except TimeoutError:
            return b""
        finally:
            self._client.socket.settimeout(5.0)
        self._waiting = None
        return data

    def close(self) -> None:
        self._client.set(0x21, 0x22, 0, 0)


def latched(sensor: VirtualSensor, *, last: bool = False) -> set[int]:
    """The values that the LEDs show now, as soon as the emulator has told so (`last`: in the end)."""
    board = sensor.board
    end = time.monotonic() + 5
    while board.light_at(np.inf).any() == last and time.monotonic() < end:
        time.sleep(0.01)
    return set(board.light_at(np.inf).ravel().tolist())


@pytest.mark.parametrize("url", ["sim://?board=0", "sim://?board=false&fps=20"])
def test_without_a_board_the_serial_port_is_silent(url: str) -> None:
    with open_virtual(url, serial_number="C3", geometry=sized_geometry("64x48")) as sensor:
        ours, theirs = socket.socketpair()
        with ours:
            sensor.plug(theirs)
            assert sensor.board is None
            assert sensor.camera.ring is None


def test_the_emulated_firmware_answers_at_the_serial_endpoints_and_lights_the_picture() -> None:
    with open_virtual("sim://?programme=0", serial_number="C3", geometry=sized_geometry("64x48")) as sensor:
        ours, theirs = socket.socketpair()
        with ours:
            sensor.plug(theirs)
            client = UsbClient(ours)
            with LightRing(PluggedRing(client), timeout_s=2.0, keep_alive_s=None) as ring:
                assert ring.hello.unique_id.hex().upper() == sensor.serial_number
                ring.wait_for_light(ring.set_leds(np.full((12, 3), 60, np.uint8)).light_id, 5.0)
                assert latched(sensor) == {60}
            assert latched(sensor, last=True) == {0}, "dark when it is let go"


def test_what_the_verb_offers_can_be_imported() -> None:
    options = ["--sensor", "sim://?board=0", "--size", "32x24", "--listen", "127.0.0.1:0", "--seconds", "20"]
    with started([*GELLIGHT, "virtual-sensor", *options], stdout=PIPE, text=True) as verb:
        line = verb.stdout.readline()
        found = re.search(r"--tcp-port (\d+) ", line)
        assert found, line
        with socket.create_connection(("127.0.0.1", int(found[1]))) as connection:
            assert import_device(connection, "1-1") == (0x10001, 3)
            client = UsbClient(connection)
            client.start()
            assert client.payload().data.startswith(b"\xff\xd8")


def test_the_cable_that_a_fault_pulls_goes_into_the_next_port(monkeypatch: pytest.MonkeyPatch) -> None:
    ports: list[int | None] = []
    monkeypatch.setattr(virtual_sensor, "REPLUG_S", 0.01)
    monkeypatch.setattr(virtual_sensor, "plug_in", lambda device, port: ports.append(port) or 3)

    class Unplugging:
        serial_number = "1"

        class unplugged:  # noqa: N801
            @staticmethod
            def wait(timeout: float) -> None:
                """The cable is out at once."""

    virtual_sensor.hold(Unplugging(), 5, 0.03)
    assert ports[0] == 5
    assert ports[1:] == [None] * (len(ports) - 1)
    assert len(ports) >= 2
