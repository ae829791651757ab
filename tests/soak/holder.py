"""A program that lights a board, to be killed; its argument is the port."""

import sys
import time

import numpy as np

from gellight.ring.light_ring import connect


def main(port: str) -> None:
    """Light the LEDs, and hold them lit until the process ends."""
    with connect(port) as ring:
        ring.light(np.full((ring.led_count, 3), 60, np.uint8))
        print("lit", flush=True)
        time.sleep(3600)


if __name__ == "__main__":
    main(sys.argv[1])
