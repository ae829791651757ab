"""Figures of the firmware, from the committed image in the emulator: `python -m tests.benchmarks.firmware`.

All times are virtual: the board's own, exact to its clock, whatever the machine does.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.board.chip import EmulatedBoard
from gellight.enumerations import SyncMode
from gellight.firmware.build import committed_image
from gellight.protocol import DWELL_MIN_US
from gellight.ring import LightRing, Step
from gellight.transport import VirtualTransport


def round_trips_us(ring: LightRing, board: EmulatedBoard, count: int = 200) -> dict[str, float]:
    """Median virtual time of a command and its reply."""
    colours = np.full((12, 3), 20, np.uint8)
    figures = {}
    for name, command in (("CLOCK", ring.clock), ("SET_LEDS", lambda: ring.set_leds(colours))):
        times = []
        for _ in range(count):
            before = board.now_us
            command()
            times.append(board.now_us - before)
        figures[name] = float(np.median(times))
    return figures


def led_frames_per_second(ring: LightRing, board: EmulatedBoard, count: int = 300) -> float:
    """LED frames on the wire when every command is sent as soon as the last was answered."""
    start, before = board.now_us, len(board.timeline)
    for number in range(count):
        ring.set_leds(np.full((12, 3), number % 40, np.uint8))
    board.run(2000)
    return (len(board.timeline) - before) / (board.now_us - start) * 1e6


def deviations_us(ring: LightRing, board: EmulatedBoard, steps: int = 800) -> NDArray[np.float64]:
    """Deviation of each step of a sequence of the shortest steps from its grid, from the pin; a command comes every 100 ms."""
    groups = [np.full((12, 3), level, np.uint8) for level in (10, 30)]
    ring.load_sequence(groups, [Step(group=group, dwell_us=DWELL_MIN_US) for group in range(2)])
    ring.set_sync(SyncMode.FREE)
    starts = board.waveform.frame_starts_us
    first = len(starts)
    ring.start()
    while len(starts) < first + steps:
        ring.clock()
        board.run(100_000)
    times = np.array(starts[first : first + steps])
    deviation = times - float(DWELL_MIN_US) * np.arange(steps)
    return np.asarray(deviation - np.median(deviation))


def main() -> None:
    """Print the figures."""
    board = EmulatedBoard(committed_image())
    ring = LightRing(VirtualTransport(board), keep_alive_s=None)
    for name, microseconds in round_trips_us(ring, board).items():
        print(f"round trip {name:9} {microseconds:8.0f} us")
    print(f"LED frames           {led_frames_per_second(ring, board):8.0f} a second, wire limit {1e6 / 660:.0f}")
    deviation = deviations_us(ring, board)
    within = np.mean(np.abs(deviation) <= 1.0)
    print(f"500 Hz sequence      {within:8.2%} of the steps within 1 us, the worst {deviation.max():+.1f} us late")
    ring.close()
    print(f"faults noticed       {board.faults or 'none'}")


if __name__ == "__main__":
    main()
