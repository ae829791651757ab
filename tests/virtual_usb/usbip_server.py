"""Offers virtual sensors to Linux machines that import them: `usbip attach -r HOST -b 1-1`."""

import contextlib
import logging
import socket
import threading
from collections.abc import Mapping
from typing import Self

from gellight.base.errors import BoardError, GellightError, InputError, first_line
from tests.virtual_usb.device import VirtualSensor
from tests.virtual_usb.usbip import pack_import, read_import

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
        """Begin to listen."""
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
