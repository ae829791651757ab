"""A program that receives frames, to be killed and frozen; its argument is the name of a sensor.

It prints a line for every `EVERY` frames, and one for each frame that is not newer than the one before.
"""

import sys

from gellight.base.errors import GellightError
from gellight.stream.subscription import subscribe

EVERY = 5
"""few, for there are three a second while the sensor is calibrated"""


def main(name: str) -> None:
    last, last_s, count = -1, 0.0, 0
    try:
        with subscribe(name, patience_s=30.0) as frames:
            print("ready", flush=True)
            for felt in frames:
                frame = felt.camera_frame
                if frame.sequence <= last or frame.time_s < last_s:
                    print(f"bad frame {frame.sequence} at {frame.time_s:.6f} after {last} at {last_s:.6f}", flush=True)
                last, last_s, count = frame.sequence, frame.time_s, count + 1
                if count % EVERY == 0:
                    print(f"frames {count}", flush=True)
    except GellightError as error:
        print(f"ended {error}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
