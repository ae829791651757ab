"""How many frames a light has to stay so that at least one of them is clean.

With the settle time s, the readout R, the exposure E and the frame period P, a frame that begins when the light has
settled needs R + E. Frames begin every P, so at an unknown phase the first one may begin as late as P after that:

    k = 1 + ceil((s + R + E) / P)      unknown phase
    k = ceil((s + R + E) / P)          the light changes just before a frame begins (phase lock)
"""

from math import ceil

from gellight.frames.timing import CameraTiming

WIRE_S = 0.36e-3
"""12 LEDs of 24 bits of 1.25 us"""
LATCH_S = 0.30e-3
"""low time after which the LEDs take their data, as the board waits for it"""
EXACT = 1e-9
"""so much of a frame is rounding: an exact multiple is not one frame more"""


def settle_s(timing: CameraTiming, clock_error_s: float = 0.0) -> float:
    """Return how long it is uncertain which light a row sees: wire, latch, one pulse, and the clocks on either side.

    `clock_error_s` is how far the host may be off about the board's clock, `timing.stamp_error_s` about the camera's.
    """
    return WIRE_S + LATCH_S + timing.pulse_period_s + 2 * (clock_error_s + timing.stamp_error_s)


def hold_frames(timing: CameraTiming, *, locked: bool, clock_error_s: float = 0.0) -> int:
    """Return how many frame periods each light has to stay, by the equations above; at least 1."""
    frames = (settle_s(timing, clock_error_s) + timing.readout_s + timing.exposure_s) / timing.period_s
    return max(1, ceil(frames - EXACT)) + (0 if locked else 1)
