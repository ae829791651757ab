"""Makes the faults of the sensor itself, on whatever clock it runs."""

from collections.abc import Callable

from tests.soak.faults import FaultKind, PlannedFault
from tests.soak.hardware import FragileSensor
from tests.virtual_usb.faults import NO_FAULTS, Faults

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
