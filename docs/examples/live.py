"""Read the newest tactile frame again and again, from the daemon that runs on this computer (`gellight run`)."""

import itertools
import sys

import gellight

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"
with gellight.subscribe(name, wait_s=60) as frames:
    print("frames of", frames.name)
    for frame in itertools.islice(frames, 20):
        contact, age_ms = frame.contact, frame.provenance.ages_s["received"] * 1e3
        print(f"{contact.indentation_mm:.2f} mm deep over {contact.area_mm2:.0f} mm2, {age_ms:.0f} ms ago")
