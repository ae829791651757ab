"""Follow each contact: where it is, how fast it moves, how long it has lasted."""

import itertools
import sys

import gellight

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"
with gellight.subscribe(name, wait_s=60) as frames:
    for frame in itertools.islice(frames, 60):
        for contact in frame.contacts:
            x, y = contact.centroid_mm
            right, down = contact.velocity_mm_s or (0, 0)
            where = f"at ({x:.1f}, {y:.1f}) mm, moves ({right:+.1f}, {down:+.1f}) mm/s"
            print(f"contact {contact.number}: {where}, for {contact.age_s:.1f} s")
