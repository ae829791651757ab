"""What the mask of the frame path costs in contacts: `python -m tests.benchmarks.mask [noises]`.

Objects are pressed ever deeper into the simulated gel, off its middle, and photographed that many times with a noise of
1 grey level. For each press it prints how deep the gel went, and in which share of the pictures

    mask     marks a cell
    all      the depth map, made from every pixel through the network, shows the press: its mean over a square of some
             size is higher above the mean around it than in any of 100 untouched pictures. That is a frame of a full
             refresh, judged with more care than the product does
    contact  is found by the product, with the mask and without

Ideal is sqrt(sum(signal^2)) / noise, the signal-to-noise ratio for one who knows what to look for and where
At the end stand the smallest indentations of the gel from which each finds nine pictures of ten, and the time
of a frame without the mask as a multiple of one at rest with it.
"""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from tests.helpers.light_touches import NOISE_GREY, LightTouches, ball, flat_punch

Floats = NDArray[np.float32]
DEPTHS_UM = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 25, 30, 40)
PLACE_MM = (2.3, -1.4)
UNTOUCHED = 100
SQUARES_PX = (4, 8, 16, 32, 64)
AROUND = 4
"""times a square: what its mean is compared with"""
BORDER_PX = 8
FOUND = 0.9
OBJECTS = {
    "ball, radius 4 mm": ball(4),
    "ball, radius 12 mm": ball(12),
    "flat punch, radius 0.5 mm": flat_punch(0.5),
    "flat punch, radius 2 mm": flat_punch(2),
    "flat punch, radius 6 mm": flat_punch(6),
}
JUDGES = ("mask", "all", "contact with the mask", "contact without")


@dataclass(frozen=True)
class Seen:
    """One picture."""

    marked: bool
    contacts: tuple[bool, bool]
    heights_um: NDArray[np.float64]
    """of the highest square of each size above what is around it, without the mask"""


class Bench:
    """The simulated sensor, its frame path with the mask and without."""

    def __init__(self) -> None:
        """Make them, and see what untouched gel looks like."""
        self.touches, bundle = LightTouches(), load_bundle("synthetic")
        self.masked, self.everywhere = Reconstructor(bundle), Reconstructor(bundle, masked=False)
        rest = list(self.pictures(self.touches.untouched, UNTOUCHED))
        self.false_alarms = sum(one.marked for one in rest)
        self.alarm_um = np.max([one.heights_um for one in rest], axis=0)

    def pictures(self, grey: Floats, count: int) -> Iterator[Seen]:
        """Yield what is seen in that many pictures."""
        random = np.random.default_rng(1)
        for _ in range(count):
            frame = self.touches.picture(grey, random)
            marked = bool(self.masked.touched(frame.image - self.masked.bundle.reference).any())
            felt = [path.reconstruct(frame) for path in (self.masked, self.everywhere)]
            contacts = (bool(felt[0].contact.mask.any()), bool(felt[1].contact.mask.any()))
            yield Seen(marked, contacts, heights_um(felt[1].depth_mm))

    def shares(self, grey: Floats, noises: int) -> list[float]:
        """Return the share of pictures in which each judge sees the press."""
        seen = list(self.pictures(grey, noises))
        rows = [(one.marked, bool((one.heights_um > self.alarm_um).any()), *one.contacts) for one in seen]
        return [float(share) for share in np.mean(rows, axis=0)]

    def ratio(self) -> float:
        """Return the processor time of an untouched frame without the mask over that with it."""
        frame = self.touches.picture(self.touches.untouched, np.random.default_rng(2))
        masked, everywhere = (
            least_s(lambda path=path: path.reconstruct(frame)) for path in (self.masked, self.everywhere)
        )  # type: ignore[misc]
        return everywhere / masked


def heights_um(depth_mm: Floats) -> NDArray[np.float64]:
    """Return by how much the highest square of each size lies above its surroundings."""
    inner = (slice(BORDER_PX, -BORDER_PX),) * 2
    means = [
        (ndimage.uniform_filter(depth_mm, side), ndimage.uniform_filter(depth_mm, AROUND * side)) for side in SQUARES_PX
    ]
    return np.array([(square - around)[inner].max() * 1e3 for square, around in means])


def least_s(run: Callable[[], object]) -> float:
    """Return the least processor time of some runs."""
    times = []
    for _ in range(9):
        begun = time.process_time()
        run()
        times.append(time.process_time() - begun)
    return min(times)


def main() -> None:
    """Press everything."""
    noises, bench = int(sys.argv[1]) if len(sys.argv) > 1 else 10, Bench()
    print(f"untouched, {UNTOUCHED} pictures: the mask marks {bench.false_alarms}; means over {SQUARES_PX} px lie up to "
          f"{bench.alarm_um.round(1)} um above those around")  # fmt: skip
    smallest = []
    for name, height in OBJECTS.items():
        found = dict.fromkeys(JUDGES, "-")
        for depth_um in reversed(DEPTHS_UM):
            surface = bench.touches.press(height, depth_um, PLACE_MM)
            grey, gel_um = bench.touches.grey(surface), surface.depth_mm.max() * 1e3
            shares = bench.shares(grey, noises)
            ideal = np.sqrt(((grey - bench.touches.untouched) ** 2).sum() / (NOISE_GREY**2 + 1 / 12))
            line = ", ".join(f"{judge} {share:4.0%}" for judge, share in zip(JUDGES, shares, strict=True))
            print(f"{name} {depth_um:3} um, gel {gel_um:5.1f}: {line}; ideal {ideal:6.1f}", flush=True)
            found |= {judge: f"{gel_um:.1f}" for judge, share in zip(JUDGES, shares, strict=True) if share >= FOUND}
        smallest.append(f"| {name} | {' | '.join(found.values())} |")
    print(f"| indentation of the gel, um | {' | '.join(JUDGES)} |", *smallest, sep="\n")
    print(f"a frame at rest: without the mask {bench.ratio():.0f} times the time")


if __name__ == "__main__":
    main()
