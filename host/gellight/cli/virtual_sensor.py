"""`gellight virtual-sensor`: a simulated sensor that Linux takes for a real one."""

import time
from typing import Annotated

import typer

from gellight.base.errors import InputError
from gellight.cli.ending import until_interrupted
from gellight.cli.options import LONGEST_S, Seconds
from gellight.lab.simulator.usb import vhci
from gellight.lab.simulator.usb.device import VirtualSensor, open_virtual, sized_geometry
from gellight.lab.simulator.usb.faults import parse_faults
from gellight.lab.simulator.usb.usbip_server import PORT, UsbipServer
from gellight.lab.simulator.usb.vhci import plug_in

REPLUG_S = 2.0


def command(
    sensor: Annotated[str, typer.Option(help="The simulated sensor inside: sim:// with its parameters.")] = "sim://",
    serial: Annotated[str, typer.Option(help="Serial number, up to 16 hexadecimal digits.")] = "E6605838833A5D2F",
    port: Annotated[
        int | None, typer.Option(help="Virtual USB port to plug it in.", show_default="the first free")
    ] = None,
    size: Annotated[str | None, typer.Option(help="Pixels of the picture, as 640x480.", show_default="as set")] = None,
    fault: Annotated[list[str] | None, typer.Option(help="What is wrong with it, as drop=0.1; repeatable.")] = None,
    listen: Annotated[str | None, typer.Option(help="Offer it to `usbip attach` at HOST:PORT instead.")] = None,
    seconds: Seconds = 0,
) -> None:
    """Plug a simulated sensor into this Linux by USB.

    Camera and light ring are in one device. This needs root and the kernel module vhci-hcd.
    """
    if listen is None:
        vhci.choose_port(port)
    faults = parse_faults(fault or [])
    opened = open_virtual(sensor, serial_number=serial, geometry=sized_geometry(size), faults=faults)
    with until_interrupted(), opened as device:
        serve(device, listen, seconds) if listen else hold(device, port, seconds)


def hold(device: VirtualSensor, port: int | None, seconds: float) -> None:
    """Keep the sensor plugged in; when the cable is pulled (a fault) plug it into the next port a while later."""
    end = time.monotonic() + (seconds or LONGEST_S)
    while time.monotonic() < end:
        chosen = plug_in(device, port)
        print(f"virtual sensor {device.serial_number} at virtual USB port {chosen}   (Ctrl-C unplugs)", flush=True)
        device.unplugged.wait(max(end - time.monotonic(), 0))
        if time.monotonic() < end:
            print(f"the cable is out; it is plugged in again in {REPLUG_S:g} s", flush=True)
            time.sleep(REPLUG_S)
            port = None


def serve(device: VirtualSensor, address: str, seconds: float) -> None:
    """Offer the sensor over the network until the time is over."""
    host, _, number = address.rpartition(":") if ":" in address else (address, "", str(PORT))
    if not number.isdecimal():
        raise InputError(f"--listen {address!r}: give HOST:PORT, for example 127.0.0.1:{PORT}")
    with UsbipServer({"1-1": device}, host=host, port=int(number)) as server:
        print(f"virtual sensor {device.serial_number} offered: sudo usbip --tcp-port {server.port} attach -r "
              f"{host} -b 1-1   (Ctrl-C ends)", flush=True)  # fmt: skip
        time.sleep(seconds or LONGEST_S)
