"""Photometric stereo against one-shot GelNet on the same simulated presses: `python -m tests.benchmarks.photometric`.

Balls at random places, then the ten benchmark objects; an argument names another bundle than the shipped one. Every
press is measured in three ways: from one picture under the whole ring (GelNet), from 4 exposures of a red, a green and
a blue LED, and from 12 of one LED. Each picture has its own noise of the same standard deviation. The light model is
that of the bundle, measured on noisy pictures of the untouched gel like on a real sensor.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.daemon.switched_camera import bright_exposure_of
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.light_model import LightGroups
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.errors import SurfaceErrors, surface_errors
from gellight.series.reconstructor import PhotometricReconstructor
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import AS_BUILT
from sim_reference.objects import OBJECT_NAMES
from sim_reference.surface import Surface
from tests.benchmarks.objects import mean_errors
from tests.helpers.simulated_bundle import NOISE_GREY, ball_presses

SEED = 2024
BALLS = 20
FILLING_MM = 3.0
"""how far from the middle objects are pressed that fill the view"""


@dataclass(frozen=True)
class Way:
    """A light and an exposure to measure a press with."""

    name: str
    kind: LightGroups | None
    """None: GelNet under the whole ring"""
    exposure_us: float
    """of one picture"""


def object_presses(random: np.random.Generator) -> list[Press]:
    """Return a press of each object but the ball, about the middle."""
    names = [name for name in OBJECT_NAMES if name != "BALL"]
    places = random.uniform(-FILLING_MM, FILLING_MM, (len(names), 2)).tolist()
    depths = random.uniform(0.6, 0.9, len(names)).round(2).tolist()
    return [Press(name, depth, x, y) for name, depth, (x, y) in zip(names, depths, places, strict=True)]


class Bench:
    """One simulated sensor, and the ways to measure what is pressed into it."""

    def __init__(self, bundle: Bundle) -> None:
        """Prepare all ways. Raises BundleError for a bundle that does not know its lights."""
        self._model = read_lights(bundle)
        self._scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
        self._base = self._scene.response
        self._random = np.random.default_rng(SEED)
        self._network = Reconstructor(bundle)
        self._stereo = {kind: PhotometricReconstructor(bundle, self._model, kind) for kind in LightGroups}
        self._exposure_us = self._model.exposure_us or 8000.0

    def ways(self) -> list[Way]:
        counts = {kind: len(self._model.groups(kind)) for kind in (LightGroups.TRIPLES, LightGroups.SINGLES)}
        lengths = (("as long", self._exposure_us), ("longer", bright_exposure_of(self._model)))
        return [Way("GelNet, one picture", None, self._exposure_us)] + [
            Way(f"{count} exposures, {length}", kind, exposure_us)
            for length, exposure_us in lengths
            for kind, count in counts.items()
        ]

    def errors(self, press: Press, way: Way) -> SurfaceErrors:
        if way.kind is None:
            frame, surface = self._picture(press, self._model.colours, way.exposure_us)
            return surface_errors(self._network.reconstruct(frame), surface)
        groups = self._model.groups(way.kind)
        taken = [self._picture(press, group, way.exposure_us) for group in (*groups, groups[0])]
        frames = [frame for frame, _ in taken]
        series = ExposureSeries(
            image=frames[0].image, time_s=0.0, sequence=0, groups=groups,
            frames=tuple((frame,) for frame in frames[:-1]), opening=frames[0], closing=frames[-1],
            exposure_us=way.exposure_us,
        )  # fmt: skip
        return surface_errors(self._stereo[way.kind].reconstruct(series), taken[0][1])

    def _picture(self, press: Press, group: NDArray[np.uint8], exposure_us: float) -> tuple[CameraFrame, Surface]:
        share = exposure_us / self._exposure_us
        self._scene.response = replace(self._base, exposure=self._base.exposure * share)
        grey, surface = self._scene.show(press, group / 255.0)
        image = digitise(grey, self._base.noise_grey, self._random)
        return CameraFrame(image=image, time_s=0.0, sequence=0, source="sim://"), surface


def main(source: str = "synthetic") -> None:
    bench, random = Bench(load_bundle(source)), np.random.default_rng([SEED, 1])
    columns = ("exposure", "contact, deg", "all, deg", "x GelNet's", "depth, mm")
    print(f"{'errors':24}" + "".join(f"{name:>14}" for name in columns))
    for objects, presses in (
        ("4 mm ball", list(ball_presses(AS_BUILT, BALLS, random))),
        ("10 objects", object_presses(random)),
    ):
        print(f"{len(presses)} presses, {objects}")
        ways = bench.ways()
        by_press = [[bench.errors(press, way) for way in ways] for press in presses]
        means = [mean_errors(errors) for errors in zip(*by_press, strict=True)]
        for way, mean in zip(ways, means, strict=True):
            over_network = mean.contact_normal_deg / means[0].contact_normal_deg
            row = "".join(f"{value:14.3f}" for value in (mean.contact_normal_deg, mean.normal_deg, over_network))
            print(f"  {way.name:22}{way.exposure_us / 1e3:11.1f} ms{row}{mean.contact_depth_mm:14.4f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
