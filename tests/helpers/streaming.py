"""A sequence on a real board for a while, and nothing lost meanwhile."""

import time

from gellight.ring.light_ring import LightRing


def stream(ring: LightRing, seconds: float) -> None:
    """Let a sequence run with events and commands, and demand that nothing was lost or late."""
    before = ring.counters()
    retries, damaged = ring.retries, ring.damaged
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        ring.clock()
        time.sleep(0.02)
    after = ring.counters()
    assert (ring.retries, ring.damaged) == (retries, damaged)
    for name in ("bad_crc", "bad_framing", "oversize", "replies_dropped", "late_steps", "dark_faults"):
        assert getattr(after, name) == getattr(before, name), name
