"""What the guest does with USB devices and light rings: pyserial, the product's own ring. Runs in the guest."""

import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import serial
from serial.tools import list_ports

from gellight.ring.light_ring import LightRing, connect
from tests.vm.inside.agent import report
from tests.vm.inside.looking import opened
from tests.vm.inside.plugging import serial_link, video_link


def usb_parent(device: str, subsystem: str) -> str:
    """Return the name of the USB device that a node belongs to."""
    place = Path("/sys/class", subsystem, Path(device).resolve().name, "device").resolve()
    return next(folder.name for folder in (place, *place.parents) if (folder / "idVendor").exists())


def identity(number: str) -> dict[str, Any]:
    """Return what sysfs and pyserial say of a sensor."""
    ports = [port for port in list_ports.comports() if port.serial_number == number]
    return {
        "camera parent": usb_parent(str(video_link(number)), "video4linux"),
        "ring parent": usb_parent(str(serial_link(number)), "tty"),
        "ports": [[port.vid, port.pid, port.manufacturer, port.product] for port in ports],
    }


def converse(number: str) -> dict[str, Any]:
    """Command the ring over the real serial driver; return what the firmware said and how long it took."""
    with connect(f"serial://{number}") as ring:
        trips = [_round_trip(ring) for _ in range(10)]
        reply = ring.set_leds(np.full((12, 3), 40, np.uint8))
        ring.wait_for_light(reply.light_id, 5.0)
        status = ring.status()
        return {
            "unique id": ring.hello.unique_id.hex().upper(),
            "current_ma": status.current_ma,
            "trip_ms": statistics.median(trips) * 1e3,
            "retries": ring.retries,
            "damaged": ring.damaged,
        }


def _round_trip(ring: LightRing) -> float:
    begun_s = time.monotonic()
    ring.clock()
    return time.monotonic() - begun_s


def light_and_look(number: str) -> dict[str, list[float]]:
    """Light one colour after the other; return the mean of each channel of the picture under it."""
    red, green, blue = (np.array(rgb, np.uint8) for rgb in ((255, 0, 0), (0, 255, 0), (0, 0, 255)))
    places = {"red": (red, slice(0, 4)), "green": (green, slice(4, 8)), "blue": (blue, slice(8, 12))}
    found = {}
    with connect(f"serial://{number}") as ring, opened(number, "format=MJPG") as camera:
        found["dark"] = _means(camera)
        for name, (colour, leds) in places.items():
            light = np.zeros((12, 3), np.uint8)
            light[leds] = colour
            ring.wait_for_light(ring.set_leds(light).light_id, 5.0)
            found[name] = _means(camera)
        ring._stop.set()  # the program hangs: nobody says a word any more, and the port is closed without a word
        ring.transport.close()
        time.sleep(0.5)
        found["closed"] = _means(camera)
    return found


def _means(camera: Any) -> list[float]:
    image = [camera.read() for _ in range(5)][-1].image
    return [float(mean) for mean in image.reshape(-1, 3).mean(axis=0)]


def hold_ring(number: str) -> dict[str, str]:
    """Hold the ring and a plain serial port's bytes until the board is gone; tell what was said."""
    with serial.Serial(str(serial_link(number)), timeout=1) as port:
        report("open")
        try:
            for _ in range(200):
                port.write(b"\0")
                port.read(1)
        except serial.SerialException as error:
            return {"error": type(error).__name__, "text": str(error)}
    return {"error": "", "text": "nothing was noticed"}
