"""What the guest does with light rings, by the product's own. Runs in the guest."""

import statistics
import time
from typing import Any

import numpy as np

from gellight.ring.light_ring import LightRing, connect
from tests.vm.inside.looking import opened


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
