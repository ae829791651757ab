"""What goes wrong, when, and for how long: drawn at random from a seed, so that a run can be repeated."""

import random
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

MEAN_GAP_S = 60.0
"""from one fault to the next, on average, of simulated time"""


class FaultKind(StrEnum):
    """What can go wrong."""

    UNPLUGGED = "unplugged"
    """the cable is pulled, and plugged in at another port"""
    BROWN_OUT = "brown-out"
    """the board loses its power for a moment; the camera goes on"""
    STALL = "stall"
    """the camera is there and sends nothing"""
    TORN = "torn"
    """of some pictures only the first half arrives"""
    DROPPED = "dropped"
    """some pictures never arrive"""
    DUPLICATED = "duplicated"
    """some pictures come a second time instead of the next"""
    DAMAGED = "damaged"
    """some pictures are marked as damaged"""
    CORRUPT_PACKETS = "corrupt-packets"
    """bits between host and board are wrong, in both directions"""
    SILENCE = "silence"
    """nothing gets through between host and board, as if the host hung: the board has to go dark"""
    CAMERA_CLOCK = "camera-clock"
    """the time stamps of the camera jump"""
    WALL_CLOCK = "wall-clock"
    """the time of day jumps, as when a computer finds its time server"""
    FULL_DISK = "full-disk"
    """the disk of a recording is full"""
    SUBSCRIBER_KILLED = "subscriber-killed"
    """a program that receives frames is killed"""
    SUBSCRIBER_FROZEN = "subscriber-frozen"
    """a program that receives frames stands still"""
    HOST_KILLED = "host-killed"
    """a program that lights a board is killed: the board has to go dark"""


LONGEST_S = {
    FaultKind.UNPLUGGED: 2.0, FaultKind.BROWN_OUT: 0.5, FaultKind.STALL: 4.0, FaultKind.SILENCE: 2.5,
    FaultKind.FULL_DISK: 0.5, FaultKind.SUBSCRIBER_KILLED: 0.0, FaultKind.HOST_KILLED: 0.0,
}  # fmt: skip
"""of faults that last other than `USUAL_S` at most"""
USUAL_S = 2.0


@dataclass(frozen=True)
class PlannedFault:
    """One fault of the plan."""

    at_s: float
    """of simulated time"""
    kind: FaultKind
    seconds: float
    """it lasts so long"""
    strength: float
    """from 0 to 1: share of the pictures or bytes, size of a jump"""


def plan(seed: int, hours: float) -> Iterator[PlannedFault]:
    """Yield the faults of that many hours. Every kind comes once before one comes again, in an order drawn anew."""
    draw, at_s = random.Random(seed), 0.0
    while True:
        kinds = list(FaultKind)
        draw.shuffle(kinds)
        for kind in kinds:
            at_s += draw.expovariate(1 / MEAN_GAP_S)
            if at_s > hours * 3600:
                return
            longest_s = LONGEST_S.get(kind, USUAL_S)
            yield PlannedFault(at_s, kind, longest_s * draw.uniform(0.2, 1.0), draw.random())
