"""Roughness that the simulated sensor feels, against that of what is pressed: `python -m tests.benchmarks.roughness`.

Plates with waves along x, then plates with a random relief, are pressed into the elastic layer, seen by the camera with
noise, and felt by the shipped GelNet. The roughness of the plate, of the gel's true surface, and of what was felt are
found by the same filters: Ra along a line for waves, Sa for a random relief. What was felt is told also where the
product refuses it. The errors of the heights are those found on a flat plate. Numbers after the command are waves in mm
to judge instead of all.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.simulator.objects import FLAT_MM, rough_plate, sine_plate
from gellight.lab.simulator.scene import Scene
from gellight_scan.height_map import HeightMap, map_of_press
from gellight_scan.roughness import (
    AreaRoughness,
    Evaluation,
    ProfileRoughness,
    area_roughness,
    profile_roughness,
)
from sim_reference import gel
from sim_reference.camera import CameraResponse, digitise, linear_grey
from sim_reference.deformation import grid
from sim_reference.geometry import AS_BUILT, pixel_grid
from sim_reference.imaging import ring_irradiance
from sim_reference.surface import Surface, sample

WAVES_MM = (0.2, 0.3, 0.5, 0.7, 0.75, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0)
STEEPNESS = 0.02
"""amplitude of a wave over its length"""
DEPTH_MM = 0.5
STEEPER = ((1.0, 0.05, 0.3), (1.0, 0.1, 0.3), (2.0, 0.05, 0.3), (2.0, 0.1, 0.3), (2.0, 0.05, 0.8))
"""wave in mm, steepness, depth in mm: the gel does not reach all of these valleys"""
RANDOM = ((0.01, 0.5, 2.0), (0.01, 0.8, 3.0), (0.01, 1.0, 4.0), (0.02, 1.5, 6.0))
"""rms, shortest and longest wave of a random relief, mm"""
EXTENT_MM = 50.0
POINTS_A_WAVE = 6
NOISE_GREY = 1.0
START_MM, END_MM = (-FLAT_MM + 0.5, 0.0), (FLAT_MM - 0.5, 0.0)
Plate = Callable[[np.ndarray, np.ndarray], np.ndarray]
Measure = Callable[[HeightMap, Evaluation], AreaRoughness | ProfileRoughness]


@dataclass(frozen=True)
class Judged:
    """One plate."""

    object_um: float
    gel_um: float
    felt_um: float
    told: AreaRoughness | ProfileRoughness | str
    """or why it was refused"""
    touched: float
    """share of the plate that the gel truly touches"""
    reached: float
    """and that was believed to be"""


class Bench:
    """The simulated sensor."""

    def __init__(self, seed: int = 0) -> None:
        """Feel a flat plate first: what is found on it is the error of the heights."""
        self.geometry = AS_BUILT
        self._scene = Scene(self.geometry, CameraResponse(noise_grey=NOISE_GREY))
        self._reconstructor = Reconstructor(load_bundle("synthetic"))
        self._random = np.random.default_rng(seed)
        flat = self._map(self._felt(self._pressed(lambda x, y: sine_plate(x, y, 1.0, 0.0), 1.0, DEPTH_MM)), 0.0)
        self.error_mm = area_roughness(flat, Evaluation(blur_mm=0.0, cutoff_mm=8.0)).sq_mm

    def judge(self, plate: Plate, shortest_mm: float, cutoff_mm: float, depth_mm: float, measure: Measure) -> Judged:
        """Press one plate and measure its roughness."""
        surface = self._pressed(plate, shortest_mm, depth_mm)
        frame = self._felt(surface)
        found = self._map(frame, self.error_mm)
        found.height_mm[np.hypot(*pixel_grid(self.geometry)) >= FLAT_MM] = np.nan
        x, y = pixel_grid(self.geometry)
        near = np.hypot(x, y) < FLAT_MM - 1

        def exact_um(height: np.ndarray, pixel_mm: float = self.geometry.pixel_size_mm) -> float:
            across, down = (grid(size, pixel_mm) for size in height.shape[::-1])
            known = np.where(np.hypot(across, down[:, None]) < FLAT_MM, height, np.nan).astype(np.float32)
            exact = HeightMap(known, np.where(np.isfinite(known), np.float32(0), known), pixel_mm)
            try:
                return mean_um(measure(exact, Evaluation(blur_mm=0.0, cutoff_mm=cutoff_mm)))
            except InputError:  # waves of fewer than five pixels
                return float("nan")

        fine_mm = min(self.geometry.pixel_size_mm, shortest_mm / 8)
        fine = grid(2 * round(FLAT_MM / fine_mm), fine_mm)
        return Judged(
            exact_um(plate(fine[None, :], fine[:, None]), fine_mm),
            exact_um(surface.depth_mm),
            exact_um(frame.depth_mm),
            self._told(found, Evaluation(blur_mm=self.geometry.coating_smoothing_mm, cutoff_mm=cutoff_mm), measure),
            float(surface.contact[near].mean()),
            float(found.reached[near].mean()),
        )

    def _told(self, found: HeightMap, how: Evaluation, measure: Measure) -> AreaRoughness | ProfileRoughness | str:
        try:
            return measure(found, how)
        except InputError as error:
            return str(error)

    def _map(self, frame: TactileFrame, error_mm: float) -> HeightMap:
        return map_of_press(frame, (self.geometry.pixel_size_mm,) * 2, error_mm)

    def _pressed(self, plate: Plate, shortest_mm: float, depth_mm: float) -> Surface:
        spacing = min(0.125, shortest_mm / POINTS_A_WAVE)
        at = grid(2 * round(EXTENT_MM / spacing / 2), spacing)
        height = plate(at[None, :], at[:, None])
        deformation = gel.press(height, spacing, depth_mm, self.geometry)
        return sample(deformation, self.geometry, 0.0, 0.0)

    def _felt(self, surface: Surface) -> TactileFrame:
        light = ring_irradiance(surface, self.geometry, self._scene.light)
        grey = linear_grey(light, self._scene.response)
        image = digitise(grey, NOISE_GREY, self._random)
        return self._reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0, source="sim://"))


def mean_um(found: AreaRoughness | ProfileRoughness) -> float:
    """Return Sa or Ra, um."""
    return 1e3 * (found.sa_mm if isinstance(found, AreaRoughness) else found.ra_mm)


def line(one: Judged) -> str:
    """Return the figures of a plate in one line: um, shares in per cent, and what the product tells."""
    off = 100 * (one.felt_um / one.object_um - 1), 100 * (one.felt_um / one.gel_um - 1)
    head = (
        f"{one.touched:8.3f} {one.reached:8.3f} {one.object_um:8.2f} {one.gel_um:8.2f} {one.felt_um:8.2f} "
        f"{off[0]:8.1f} {off[1]:8.1f}"
    )
    if isinstance(one.told, str):
        return f"{head}  refused: {one.told.split(':')[0]}"
    told, left = mean_um(one.told), 1 - one.told.blur_share
    low, high, unblurred = told - one.told.error_mm * 1e3, (told + one.told.error_mm * 1e3) / left, told / left
    return (
        f"{head} {100 * (unblurred / one.object_um - 1):8.1f}  {told:.2f}, of the plate {low:.2f} to {high:.2f}; "
        f"waves {one.told.wavelength_mm:.2f} mm, blur {one.told.blur_share:.0%}"
    )


def main(waves_mm: Sequence[float] = ()) -> None:
    """Print the tables."""
    bench = Bench()
    print(f"a flat plate: {bench.error_mm * 1e3:.2f} um rms, taken for the error of the heights")
    columns = " touched  reached   object      gel     felt   off, %   of gel  no blur  told"
    print(f"wave mm steepness depth mm{columns}")

    def along(surface: HeightMap, how: Evaluation) -> ProfileRoughness:
        return profile_roughness(surface, START_MM, END_MM, how)

    steeper = () if waves_mm else STEEPER
    for wave, steepness, depth in (*((wave, STEEPNESS, DEPTH_MM) for wave in waves_mm or WAVES_MM), *steeper):
        plate = partial(sine_plate, wavelength_mm=wave, amplitude_mm=wave * steepness)
        judged = bench.judge(plate, wave, 2.5 if wave <= 1.3 else 8.0, depth, along)
        print(f"{wave:7.2f} {steepness:9.2f} {depth:8.1f}{line(judged)}", flush=True)
    print(f"rms mm  waves mm  depth mm{columns}")
    for rms, shortest, longest in () if waves_mm else RANDOM:
        plate = partial(rough_plate, rms_mm=rms, waves_mm=(shortest, longest))
        judged = bench.judge(plate, shortest, 2.5 if longest < 4 else 8.0, DEPTH_MM, area_roughness)
        print(f"{rms:6.2f} {shortest:5.1f}-{longest:3.1f} {DEPTH_MM:8.1f}{line(judged)}", flush=True)


if __name__ == "__main__":
    main([float(wave) for wave in sys.argv[1:]])
