"""Read two sensors, as of two fingers, by the names under which `gellight run` publishes them."""

import itertools
import sys

import gellight

sys.tracebacklimit = 0  # errors in one line
first, second = sys.argv[1:] or ("sim", "sim-2")
with gellight.subscribe(first, wait_s=60) as left, gellight.subscribe(second, wait_s=60) as right:
    for one, other in itertools.islice(zip(left, right, strict=True), 20):
        apart_ms = 1000 * abs(one.provenance.unix_s - other.provenance.unix_s)
        depths = f"{one.contact.indentation_mm:.2f} and {other.contact.indentation_mm:.2f} mm deep"
        print(f"{left.name} and {right.name}: {depths}, {apart_ms:.0f} ms apart")
