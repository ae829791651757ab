"""Random Thumb blocks in the emulator and in Unicorn: `python -m tests.benchmarks.instructions [COUNT]`."""

import argparse
import time

from tests.firmware.helpers.thumb_blocks import differences

ROUND = 50_000


def main() -> None:
    """Print what differs, and the processor time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=1_000_000)
    count, found = parser.parse_args().count, 0
    for seed in range(count // ROUND):
        for difference in differences(ROUND, seed, 1 if seed % 4 == 0 else 10):
            print(difference)
            found += 1
    print(f"{count // ROUND * ROUND} blocks, {found} differences, {time.process_time():.0f} s of processor time")


if __name__ == "__main__":
    main()
