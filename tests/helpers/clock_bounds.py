"""The board's time by a clock map, for comparison with the true one."""

from gellight.sensor.lighting.clock import ClockMap, Interval


def board_us(known: ClockMap, host_s: float) -> Interval:
    """Return the bounds of the board's time, us, at a time of the host, s."""
    low, high = known._offset(host_s * 1e6)
    return Interval(host_s * 1e6 + low, host_s * 1e6 + high)
