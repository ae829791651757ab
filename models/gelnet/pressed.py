"""Presses in batches for another program: `python -m gelnet.pressed --by cuda --batch 8`.

Reads JSON, one value a line: first an object with `geometry` (the fields of `SensorGeometry`) and `light` (K, N, 3), 0
to 1; then lists of [object, depth_mm, x_mm, y_mm], a batch each. Answers in NumPy's npy format: the name of the device;
then for each press, in order, (K, H, W, 3) irradiance, (H, W) depth_mm, (H, W, 2) gradient map, (H, W) contact, and on
the object's grid (n, n) depth_mm and pressure. What cannot be pressed ends it with one line on stderr and status 2.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from sim_reference.deformation import Deformation, NotConverged, grid
from sim_reference.gel import coating, compliance, deflection
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height
from sim_reference.surface import GRID_EXTENT_MM, GRID_SIZE, Surface, sample

Wanted = tuple[str, float, float, float]
"""object, depth, and where it is from the image centre, mm"""
SPACING_MM = GRID_EXTENT_MM / GRID_SIZE
MOST_KEPT = 512
"""deformations: a press has the same shape wherever it happens; 4 MB each"""


class Presses:
    """Computes presses of one sensor on one device; deformations are kept."""

    def __init__(self, geometry: SensorGeometry, by: str, batch: int) -> None:
        """Compute at most `batch` deformations at once, on what `batches.device_of` says; NoGpuError as there."""
        from gelnet.batches import Ring, device_of, name_of

        self._geometry, self._device, self._batch = geometry, device_of(by), batch
        self.device = name_of(self._device)
        self._ring = Ring(geometry, self._device)
        self._kept: dict[tuple[str, float], Deformation] = {}

    def seen(self, presses: Sequence[Wanted], light: NDArray[np.float64]) -> Iterator[tuple[NDArray[Any], ...]]:
        """Yield the arrays of each press."""
        if not presses:
            return
        self._deform([press[:2] for press in presses])
        pressed = [self._kept[press[:2]] for press in presses]
        surfaces = [
            sample(gel, self._geometry, x, y).single_precision()
            for gel, (_, _, x, y) in zip(pressed, presses, strict=True)
        ]
        lit = self._ring.irradiances(surfaces, light)
        for gel, surface, irradiance in zip(pressed, surfaces, lit, strict=True):
            yield irradiance, *_fields(surface), gel.depth_mm, gel.pressure

    def _deform(self, wanted: Sequence[tuple[str, float]]) -> None:
        missing = [each for each in dict.fromkeys(wanted) if each not in self._kept]
        if len(self._kept) + len(missing) > MOST_KEPT:
            self._kept = {each: self._kept[each] for each in wanted if each in self._kept}
        for first in range(0, len(missing), self._batch):
            part = missing[first : first + self._batch]
            self._kept |= dict(zip(part, self._deformed(part), strict=True))

    def _deformed(self, wanted: Sequence[tuple[str, float]]) -> Iterator[Deformation]:
        """Yield what `surface.press_object` returns for each object and depth."""
        from gelnet.batches import contact_pressures

        at = grid(GRID_SIZE, SPACING_MM)
        for _, depth in wanted:
            self._geometry.check_press(depth)
        gaps = [-(object_height(name, at[None, :], at[:, None]) + depth) for name, depth in wanted]
        found = contact_pressures(np.stack(gaps), SPACING_MM, self._geometry, self._device)
        gel = self._geometry
        response = compliance(GRID_SIZE, SPACING_MM, gel.gel_thickness_mm, gel.poisson_ratio)
        response *= coating(GRID_SIZE, SPACING_MM, gel.coating_smoothing_mm)
        for pressure in found:
            yield Deformation(deflection(pressure, response), pressure, SPACING_MM)


def _fields(surface: Surface) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    return surface.depth_mm, surface.gradient_map, surface.contact


def serve(asked: IO[bytes], answers: IO[bytes], by: str, batch: int) -> None:
    """Answer until `asked` ends. Raises NoGpuError, NotConverged, and ValueError for what cannot be pressed."""
    said = json.loads(asked.readline())
    presses, light = Presses(SensorGeometry(**said["geometry"]), by, batch), np.asarray(said["light"], np.float64)
    _answer(answers, np.array(presses.device))
    for line in asked:
        for arrays in presses.seen([(name, *numbers) for name, *numbers in json.loads(line)], light):
            _answer(answers, *arrays)


def _answer(answers: IO[bytes], *arrays: NDArray[Any]) -> None:
    for array in arrays:
        np.lib.format.write_array(answers, np.asarray(array, order="C"), allow_pickle=False)
    answers.flush()


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m gelnet.pressed", description="Compute presses in batches by torch."
    )
    parser.add_argument("--by", choices=("torch", "cuda"), required=True, help="the processor, or a GPU")
    parser.add_argument("--batch", type=int, default=8, help="deformations at once")
    options = parser.parse_args(arguments)
    from gelnet.batches import NoGpuError

    try:
        serve(sys.stdin.buffer, sys.stdout.buffer, options.by, options.batch)
    except (NoGpuError, NotConverged, ValueError) as error:
        print(f"gelnet.pressed: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
