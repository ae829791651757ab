"""Log 100 frames in a row as a table, and say how many were lost on the way."""

import csv
import itertools
import sys
from pathlib import Path

import gellight

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"
lost = 0
with gellight.subscribe(name, wait_s=60, every=True) as frames, Path("touch.csv").open("w", newline="") as file:
    table = csv.writer(file)
    table.writerow(["unix_s", "indentation_mm", "area_mm2", "force_n"])
    for frame in itertools.islice(frames, 100):
        force_n = frame.force.normal_n if frame.force else None
        table.writerow([frame.provenance.unix_s, frame.contact.indentation_mm, frame.contact.area_mm2, force_n])
        lost += frame.provenance.dropped
print(f"100 frames are in touch.csv, {lost} lost in between")
