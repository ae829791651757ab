"""The virtual sensor as a USB device: plugged into a kernel by a socket, unplugged, and plugged in elsewhere."""

import contextlib
import logging
import socket
import struct
import threading
from collections.abc import Callable, Mapping
from math import inf
from typing import Self

from gellight.base.allowed import query_of
from gellight.base.errors import BoardError, CameraError, GellightError, InputError, first_line
from gellight.frames.camera import Camera
from gellight.lab.simulator.simulated_camera import built, open_simulated
from gellight.lab.simulator.simulated_url import SimulatedUrl
from gellight.ring.heat import HeardHeat
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import LED_COUNT
from tests.helpers import usb_numbers as numbers
from tests.helpers.terminal_board import TerminalBoard
from tests.virtual_usb import descriptors
from tests.virtual_usb.cable import CablePulledError, Urb, UsbCable, pack_import, read_import
from tests.virtual_usb.faults import NO_FAULTS, Faults
from tests.virtual_usb.serial_port import SerialFunction
from tests.virtual_usb.video import VideoFunction, modes_of

logger = logging.getLogger(__name__)
ANSWERS = {numbers.GET_STATUS: b"\0\0", numbers.GET_CONFIGURATION: b"\1", numbers.GET_INTERFACE: b"\0"}
STANDARD, CLASS, INTERFACE_RECIPIENT = 0x00, 0x20, 1
STOP_S = 10.0


class UncommandedRing(LightRing):
    """The ring of a board that another program commands: the one at the other end of the virtual USB cable."""

    def __init__(self, board: TerminalBoard) -> None:
        """Hold the board without speaking to it."""
        self.transport, self.heat = board, HeardHeat()

    def lit_since_s(self) -> float:
        """Return -inf: whatever the other program lights is the light of every frame."""
        return -inf

    def close(self) -> None:
        self.transport.close()


class VirtualSensor:
    """Camera and board of the light ring in one USB device. Close it, or use it in a `with` statement."""

    def __init__(self, camera: Camera, *, serial_number: str, frame_rate: float = 30.0, has_board: bool = False,
                 leds: int = LED_COUNT) -> None:  # fmt: skip
        """Take over a camera without a ring, which runs at `frame_rate`; the plug is not in yet.

        `has_board`: while it has power, a simulated board has the same serial number and `leds`.
        """
        self.serial_number = f"{int(serial_number, 16):016X}"
        self.faults = NO_FAULTS
        self.modes = modes_of(camera, frame_rate)
        self.camera, self._has_board, self._leds = camera, has_board, leds
        self.board: TerminalBoard | None = None
        self._cable: UsbCable | None = None
        self._lock = threading.Lock()
        self.unplugged = threading.Event()
        """set while no cable is in"""
        self.unplugged.set()
        self._start_functions()

    def _start_functions(self) -> None:
        self.serial = SerialFunction(self.board.path if self.board else "")
        self.video = VideoFunction(self.camera, self.modes, faults=self.faults)

    def __enter__(self) -> "VirtualSensor":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def inject(self, faults: Faults) -> None:
        """Behave like this from the next picture on, after a replug too."""
        self.faults = faults
        self.video.inject(faults)

    def plug(self, connection: socket.socket, *, greeting: bytes = b"") -> None:
        """Power up and serve the kernel at the other end of a stream socket, in the background.

        `greeting` is sent first, when the device is ready.

        Raises InputError when the cable is in already, and BoardError when the board does not start.
        """
        with self._lock:
            if not self.unplugged.is_set():
                raise InputError(f"the virtual sensor {self.serial_number} is plugged in already: unplug it first")
            self.unplugged.clear()
        try:
            self._power_on()
            connection.sendall(greeting)
        except BaseException:
            self._power_off()
            self.unplugged.set()
            raise
        self._start_functions()
        cable = self._cable = UsbCable(connection)
        jobs: list[Callable[[], None]] = [
            lambda: cable.run(self._control, lambda urb: self.serial.write(urb.data)),
            lambda: self.serial.run(cable),
            lambda: self.video.run(cable),
        ]
        threads = [threading.Thread(target=self._work, args=(cable, job), daemon=True) for job in jobs]
        for thread in [*threads, threading.Thread(target=self._settle, args=(threads,), daemon=True)]:
            thread.start()

    def unplug(self) -> None:
        """Pull the plug, in mid-stream too; returns at once; `unplugged` is set when the power is gone."""
        if self._cable is not None:
            self._cable.pull()

    def close(self) -> None:
        self.unplug()
        self.unplugged.wait(STOP_S)
        self._power_off()
        self.camera.close()

    def _power_on(self) -> None:
        if self._has_board:
            self.board = TerminalBoard(leds=self._leds, unique_id=bytes.fromhex(self.serial_number))
            self.camera.ring = UncommandedRing(self.board)

    def _power_off(self) -> None:
        """End the board, with its LEDs dark: the camera keeps the dead board until a new one starts."""
        if self.board is not None:
            self.board.close()
        self.board = None

    def _work(self, cable: UsbCable, job: Callable[[], None]) -> None:
        try:
            job()
        except CablePulledError:
            pass
        except CameraError as error:
            logger.error("the camera of the virtual sensor %s has failed: %s", self.serial_number, error)
        finally:
            cable.pull()

    def _settle(self, threads: list[threading.Thread]) -> None:
        for thread in threads:
            thread.join()
        self.serial.close()
        self._power_off()
        self.unplugged.set()

    # ---- endpoint 0 ----

    def _control(self, urb: Urb) -> bytes | None:
        """Answer a control transfer; None: stall (USB 2.0, 9.4; UVC 1.1, 4; CDC PSTN 1.2, 6.3)."""
        kind, code, value, index, _length = struct.unpack("<BBHHH", urb.setup)
        if kind & 0x60 == STANDARD:
            return self._standard(code, value, index)
        if kind & 0x60 != CLASS or kind & 0x1F != INTERFACE_RECIPIENT:
            return None
        interface, unit = index & 0xFF, index >> 8
        if interface == 0:
            return self.serial.request(code, value, urb.data)
        return self.video.request(interface, unit, value >> 8, code, urb.data)

    def _standard(self, code: int, value: int, index: int) -> bytes | None:
        if code == numbers.GET_DESCRIPTOR:
            return self._descriptor(value >> 8, value & 0xFF)
        if code == numbers.CLEAR_FEATURE and index == descriptors.VIDEO_ENDPOINT | 0x80:
            self.video.negotiation.committed = None  # so a host ends the stream
        return ANSWERS.get(code, b"")

    def _descriptor(self, kind: int, index: int) -> bytes | None:
        if kind == numbers.DEVICE:
            return descriptors.device_descriptor()
        if kind == numbers.CONFIGURATION and index == 0:
            return descriptors.configuration_descriptor(self.modes)
        return descriptors.string_descriptor(index, self.serial_number) if kind == numbers.STRING else None


def open_virtual(url: str, *, serial_number: str, geometry: Mapping[str, float | int | str]) -> VirtualSensor:
    """Build a virtual sensor from the simulated one of a `sim://` URL, with its board.

    With `board=0` its light is steady and its serial port silent. Raises what opening that camera raises.
    """
    wanted, leds = query_of(url, SimulatedUrl), len(built(geometry).led_colours)
    camera = open_simulated(url + ("&" if "?" in url else "?") + "board=0", geometry)
    camera.url = url
    camera.waiting = 0  # a camera sends what it sees now; who reads late waits behind the bus
    return VirtualSensor(camera, serial_number=serial_number, frame_rate=wanted.fps, has_board=bool(wanted.board),
                         leds=leds)  # fmt: skip


logger = logging.getLogger(__name__)
GREETING_S = 10.0
"""in which an importer says what it wants: whoever says nothing would be held for ever"""


class UsbipServer:
    """Listens on a port while it is used in a `with` statement."""

    def __init__(self, sensors: Mapping[str, VirtualSensor], *, host: str = "127.0.0.1", port: int = 0) -> None:
        """Offer sensors by their bus id, such as 1-1; port 0: any free one. Raises InputError for a port in use."""
        self._sensors = dict(sensors)
        try:
            self._listener = socket.create_server((host, port))
        except (OSError, OverflowError) as error:  # OverflowError: a port above 65535
            raise InputError(
                f"cannot listen on {host}:{port} ({first_line(error)}): choose another host or port"
            ) from None
        self.port = int(self._listener.getsockname()[1])
        self._thread = threading.Thread(target=self._accept, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening; sensors that are plugged in stay so."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._greet, args=(connection,), daemon=True).start()

    def _greet(self, connection: socket.socket) -> None:
        try:
            connection.settimeout(GREETING_S)
            bus_id = read_import(connection)
            connection.settimeout(None)
            self._import(connection, bus_id)
        except (OSError, ValueError, GellightError) as error:
            logger.warning("an importer was turned away: %s", error)
            connection.close()

    def _import(self, connection: socket.socket, bus_id: str) -> None:
        sensor = self._sensors.get(bus_id)
        if sensor is None or not sensor.unplugged.is_set():
            connection.sendall(pack_import(None))
            raise BoardError(f"{bus_id!r} is not offered or already imported")
        sensor.plug(connection, greeting=pack_import(bus_id))
