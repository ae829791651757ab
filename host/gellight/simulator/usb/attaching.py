"""Plugs a virtual sensor into the machine that it runs on."""

import socket

from gellight.simulator.usb import vhci
from gellight.simulator.usb.device import VirtualSensor


def plug_in(sensor: VirtualSensor, port: int | None = None) -> int:
    """Plug into a virtual USB port (None: the first free one) and return its number.

    Raises BoardError with the remedy when this machine cannot.
    """
    chosen = vhci.choose_port(port)
    ours, kernels = socket.socketpair()
    with kernels:
        sensor.plug(ours)
        try:
            vhci.attach(kernels, chosen)
        except BaseException:
            sensor.unplug()
            raise
    return chosen
