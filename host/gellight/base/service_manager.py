"""What systemd is told of a service: that it is ready, and that it lives. Elsewhere nobody is told anything."""

import os
import socket


class ServiceManager:
    """The manager that started this process, where there is one (`sd_notify` of systemd): it is told that we live."""

    def __init__(self) -> None:
        """Find the manager's socket, which the environment names."""
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._frames = -1

    def ready(self) -> None:
        """Say that the service works from now on."""
        self._tell("READY=1")

    def alive(self, frames: int, *, away: bool) -> None:
        """Say that the service lives, if it does: frames have come since, or the sensor is known to be away.

        frames: until now. A service that says nothing for as long as its unit file allows is started anew.
        """
        if away or frames != self._frames:
            self._frames = frames
            self._tell("WATCHDOG=1")

    def _tell(self, message: str) -> None:
        if self._address:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as wire:
                wire.sendto(message.encode(), self._address)
