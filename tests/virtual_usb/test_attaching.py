"""Plugging a virtual sensor into a Linux, and its ring at the other end of the cable."""

import socket
import time
from pathlib import Path

import numpy as np
import pytest

from gellight.ring.light_ring import LightRing
from tests.helpers.usb_client import UsbClient
from tests.virtual_usb import vhci
from tests.virtual_usb.device import VirtualSensor, open_virtual
from tests.virtual_usb.usbip import HIGH_SPEED

SMALL = {"image_width_px": 64, "image_height_px": 48, "pixel_size_mm": 0.588}


def test_the_kernel_gets_port_socket_device_and_speed(tmp_path: Path) -> None:
    (tmp_path / "attach").touch()
    ours, kernels = socket.socketpair()
    with ours, kernels:
        vhci.attach(kernels, 2, device_id=0x10001, speed=HIGH_SPEED, controller=tmp_path)
        assert (tmp_path / "attach").read_text() == f"2 {kernels.fileno()} {0x10001} 3"


def test_the_free_ports_of_the_kernels_table_are_found() -> None:
    table = """hub port sta spd dev      sockfd local_busid
hs  0000 006 003 00010001 000003 1-1
hs  0001 004 000 00000000 000000 0-0
ss  0008 004 000 00000000 000000 0-0
"""
    assert vhci.high_speed_ports(table) == {0: False, 1: True}


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
    with open_virtual(url, serial_number="C3", geometry=SMALL) as sensor:
        ours, theirs = socket.socketpair()
        with ours:
            sensor.plug(theirs)
            assert sensor.board is None
            assert sensor.camera.ring is None


def test_the_emulated_firmware_answers_at_the_serial_endpoints_and_lights_the_picture() -> None:
    with open_virtual("sim://?programme=0", serial_number="C3", geometry=SMALL) as sensor:
        ours, theirs = socket.socketpair()
        with ours:
            sensor.plug(theirs)
            client = UsbClient(ours)
            with LightRing(PluggedRing(client), timeout_s=2.0, keep_alive_s=None) as ring:
                assert ring.hello.unique_id.hex().upper() == sensor.serial_number
                ring.wait_for_light(ring.set_leds(np.full((12, 3), 60, np.uint8)).light_id, 5.0)
                assert latched(sensor) == {60}
            assert latched(sensor, last=True) == {0}, "dark when it is let go"
