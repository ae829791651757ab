"""The workbench around the guest: virtual sensors that run on this machine, and the cables between."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Mapping
from typing import Any, Self

from tests.virtual_usb.device import UsbipServer, VirtualSensor
from tests.virtual_usb.faults import NO_FAULTS
from tests.vm.machine.qemu import Guest

ONE, TWO, LIT, FINE = "00000000000000A1", "00000000000000B2", "00000000000000C3", "00000000000000E5"
"""serial numbers: two sensors with steady light, two that the emulated firmware lights, the last with more pixels"""


def sized(width: int, height: int) -> dict[str, float | int | str]:
    """The geometry of the default sensor, seen with fewer pixels."""
    return {"image_width_px": width, "image_height_px": height, "pixel_size_mm": 0.0588 * 640 / width}


class Clock:
    """Tells this machine's monotonic time to whoever sends a byte."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                with connection, contextlib.suppress(OSError):
                    while connection.recv(1):
                        connection.sendall(struct.pack(">d", time.monotonic()))

    def close(self) -> None:
        self._listener.close()


class Bench:
    """Sensors by name, all of them offered to the guest."""

    def __init__(self, guest: Guest, sensors: Mapping[str, VirtualSensor]) -> None:
        self.guest, self.sensors = guest, dict(sensors)
        self._ids = {name: f"1-{number}" for number, name in enumerate(sensors, 1)}
        self._server = UsbipServer({self._ids[name]: sensor for name, sensor in sensors.items()})
        self.clock = Clock()
        self._in: dict[str, int] = {}

    def __enter__(self) -> Self:
        self._server.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.__exit__(None, None, None)
        self.clock.close()
        for sensor in self.sensors.values():
            sensor.close()

    def plug(self, name: str, port: int, *, aside: bool = False) -> dict[str, Any]:
        """Plug a sensor into a USB port of the guest; `aside` while another call runs there."""
        line = self.guest.aside if aside else self.guest.main
        found = line.run(
            "plugging:plug",
            server=self._server.port,
            bus_id=self._ids[name],
            serial=self.sensors[name].serial_number,
            port=port,
        )
        self._in[name] = port
        return found

    def unplug(self, name: str, *, aside: bool = False) -> None:
        """Pull the sensor's cable and wait until both sides know."""
        sensor = self.sensors[name]
        sensor.unplug()
        assert sensor.unplugged.wait(15), f"{name} still has a cable"
        line = self.guest.aside if aside else self.guest.main
        line.run("plugging:unplugged", port=self._in.pop(name))

    def clear(self) -> None:
        """Unplug everything and let all sensors be honest again."""
        for name in list(self._in):
            self.unplug(name)
        for sensor in self.sensors.values():
            sensor.inject(NO_FAULTS)
