"""Figures of the firmware, from the committed image in the emulator: `python -m tests.benchmarks.firmware`.

All times are virtual: the board's own, exact to its clock, whatever the machine does.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from gellight.ring.enumerations import SyncMode
from gellight.ring.firmware.build import build_elf, committed_image
from gellight.ring.light_ring import LightRing, Step
from gellight.ring.protocol import DWELL_MIN_US
from tests.firmware.helpers.stack_bound import stack_bound
from tests.helpers.bench_board import BenchBoard, VirtualTransport


def round_trips_us(ring: LightRing, board: BenchBoard, count: int = 200) -> dict[str, float]:
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


def led_frames_per_second(ring: LightRing, board: BenchBoard, count: int = 300) -> float:
    """LED frames on the wire when every command is sent as soon as the last was answered."""
    start, before = board.now_us, len(board.timeline)
    for number in range(count):
        ring.set_leds(np.full((12, 3), number % 40, np.uint8))
    board.run(2000)
    return (len(board.timeline) - before) / (board.now_us - start) * 1e6


def deviations_us(ring: LightRing, board: BenchBoard, steps: int = 800) -> NDArray[np.float64]:
    """Deviation of each of the shortest steps from its grid, at the pin; a command comes every 100 ms."""
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


def ram_bytes() -> tuple[int, int]:
    """Bytes of RAM that the image fills with code and data, and those it clears: the segments of its ELF file."""
    elf = build_elf()
    offset, size, count = struct.unpack_from("<I", elf, 28)[0], *struct.unpack_from("<HH", elf, 42)
    segments = [struct.unpack_from("<8I", elf, offset + k * size) for k in range(count)]
    in_ram = [
        (filed, taken) for kind, _, address, _, filed, taken, _, _ in segments if kind == 1 and address >> 28 == 2
    ]
    return sum(filed for filed, _ in in_ram), sum(taken - filed for filed, taken in in_ram)


def print_sizes(ring: LightRing) -> None:
    """Print flash, RAM and stack."""
    loaded, cleared = ram_bytes()
    used = 4096 - ring.self_test().stack_free
    print(f"image                {len(committed_image()):8} bytes of flash")
    print(f"RAM                  {loaded:8} bytes of code and data, {cleared} cleared, beside 4096 of stack")
    print(f"stack                {stack_bound()['worst']:8} bytes at most by gcc's call graph, {used} seen in use")


def main() -> None:
    """Print the figures."""
    board = BenchBoard(committed_image())
    ring = LightRing(VirtualTransport(board), keep_alive_s=None)
    for name, microseconds in round_trips_us(ring, board).items():
        print(f"round trip {name:9} {microseconds:8.0f} us")
    print(f"LED frames           {led_frames_per_second(ring, board):8.0f} a second, wire limit {1e6 / 660:.0f}")
    deviation = deviations_us(ring, board)
    within = np.mean(np.abs(deviation) <= 1.0)
    print(f"500 Hz sequence      {within:8.2%} of the steps within 1 us, the worst {deviation.max():+.1f} us late")
    ring.blank()
    board.run(5_000)
    print_sizes(ring)
    ring.close()
    print(f"faults noticed       {board.faults or 'none'}")


if __name__ == "__main__":
    main()
