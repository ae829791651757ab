"""What goes wrong, when, and for how long, drawn at random from a seed; and how the sensor is maltreated."""

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

from tests.soak.hardware import FragileSensor
from tests.virtual_usb.faults import NO_FAULTS, Faults

MEAN_GAP_S = 60.0
"""from one fault to the next, on average, of simulated time"""


class FaultKind(StrEnum):
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


PICTURES = {
    FaultKind.TORN: "torn", FaultKind.DROPPED: "drop", FaultKind.DUPLICATED: "duplicate", FaultKind.DAMAGED: "error",
}  # fmt: skip
"""what the simulated camera calls them"""
OF_SENSOR = {
    *PICTURES, FaultKind.UNPLUGGED, FaultKind.BROWN_OUT, FaultKind.STALL, FaultKind.CORRUPT_PACKETS, FaultKind.SILENCE,
    FaultKind.CAMERA_CLOCK,
}  # fmt: skip
"""faults that need nothing but the sensor"""
DISTURBED = 0.3
"""share of the pictures, at most, that a fault of pictures hits"""
FLIPPED = 0.01
"""share of the bytes, at most, that arrive wrong"""
BOOT_S = 0.3
"""a board needs to start and to be found by the kernel"""
JUMP_S = 7200.0
"""by which a clock jumps, at most"""


def maltreat(sensor: FragileSensor, fault: PlannedFault, wait: Callable[[float], None]) -> None:
    """Make a fault of `OF_SENSOR`; `wait` lets so many seconds pass while it lasts."""
    kind, share = fault.kind, 0.1 + 0.9 * fault.strength
    if kind is FaultKind.BROWN_OUT:
        sensor.brown_out(lambda: wait(BOOT_S + fault.seconds))
        return
    camera = sensor.camera
    assert camera is not None
    if kind is FaultKind.UNPLUGGED:
        sensor.unplug()
    elif kind in PICTURES:
        sensor.faults = Faults.model_validate({PICTURES[kind]: DISTURBED * share})
    elif kind is FaultKind.STALL:
        camera.stall(fault.seconds)
    else:
        sensor.wires.flipped = FLIPPED * share if kind is FaultKind.CORRUPT_PACKETS else 0.0
        sensor.wires.silent = kind is FaultKind.SILENCE
        sensor.clock_error_s = (2 * fault.strength - 1) * JUMP_S if kind is FaultKind.CAMERA_CLOCK else 0.0
    wait(fault.seconds)
    if kind is FaultKind.UNPLUGGED:
        sensor.plug()
    sensor.faults, sensor.clock_error_s = NO_FAULTS, 0.0
    sensor.wires.flipped, sensor.wires.silent = 0.0, False
