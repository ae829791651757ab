"""Photometric stereo against one-shot GelNet on the same simulated presses, with noise: `gellight bench photometric`.

Every press is seen three ways: once under the whole ring (GelNet), in 4 exposures of a red, a green and a blue LED, and
in 12 of one LED. Each picture has its own noise of the same standard deviation. The light model is that of the bundle,
measured on noisy pictures of the untouched gel like on a real sensor.
"""

from dataclasses import asdict, dataclass, replace

import numpy as np

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.daemon.modes import bright_exposure_of
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.series import ExposureSeries
from gellight.reconstruction.integration import angle_deg, normals
from gellight.reconstruction.photometric.light_model import LightGroups, LightModel
from gellight.reconstruction.photometric.lights_file import read_lights
from gellight.reconstruction.photometric.reconstructor import PhotometricReconstructor
from gellight.reconstruction.pipeline import Reconstructor
from gellight.simulator.scene import Press, Scene
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES
from sim_reference.surface import Surface

SEED = 2024
BALLS = 20
MARGIN_MM = 3.0
FILLING_MM = 3.0
"""how far from the middle objects are pressed that fill the view"""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Errors of one way to see, means over presses."""

    way: str
    objects: str
    presses: int
    exposures: int
    exposure_us: float
    """of one picture"""
    contact_normal_deg: float
    whole_normal_deg: float
    contact_depth_mm: float
    over_network: float
    """error of the normals in contact, as a multiple of GelNet's on the same presses"""


Errors = dict[str, list[tuple[float, float, float]]]


def compare_ways(bundle: Bundle, *, noise_grey: float = 1.0, seed: int = SEED, balls: int = BALLS) -> list[Figures]:
    """Press balls of 4 mm radius 1 mm deep at random places, then each benchmark object once; return all figures.

    Raises BundleError for a bundle that does not know its lights, InputError for one of another sensor.
    """
    bench = _Bench(bundle, noise_grey, seed)
    random = np.random.default_rng([seed, 1])
    result = bench.measure("4 mm ball", list(ball_presses(bench.geometry, balls, random)))
    return result + bench.measure("10 objects", list(object_presses(random)))


def ball_presses(geometry: SensorGeometry, count: int, random: np.random.Generator) -> list[Press]:
    """Balls 1 mm deep all over the view, the contact whole."""
    height, width = geometry.image_shape
    half = np.array([width, height]) * geometry.pixel_size_mm / 2 - MARGIN_MM
    return [Press("BALL", 1.0, *(float(value) for value in random.uniform(-half, half))) for _ in range(count)]


def object_presses(random: np.random.Generator) -> list[Press]:
    """Each of the objects but the ball, about the middle."""
    names = [name for name in OBJECT_NAMES if name != "BALL"]
    places = random.uniform(-FILLING_MM, FILLING_MM, (len(names), 2)).tolist()
    depths = random.uniform(0.6, 0.9, len(names)).round(2).tolist()
    return [Press(name, depth, x, y) for name, depth, (x, y) in zip(names, depths, places, strict=True)]


class _Bench:
    """One simulated sensor, and the three ways to see what is pressed into it."""

    def __init__(self, bundle: Bundle, noise_grey: float, seed: int) -> None:
        self.geometry = SensorGeometry()
        if bundle.image_shape != self.geometry.image_shape:
            raise InputError(f"{bundle.source} is not of the simulated sensor: give 'synthetic'")
        self._model: LightModel = read_lights(bundle)
        self._scene = Scene(self.geometry, CameraResponse(noise_grey=noise_grey))
        self._base = self._scene.response
        self._noise_grey = noise_grey
        self._random = np.random.default_rng(seed)
        self._network = Reconstructor(bundle)
        self._stereo = {kind: PhotometricReconstructor(bundle, self._model, kind) for kind in LightGroups}
        self._exposure_us = self._model.exposure_us or 8000.0

    def measure(self, objects: str, presses: list[Press]) -> list[Figures]:
        """Press all, see each in every way, and return the means."""
        bright = bright_exposure_of(self._model)
        ways = [("GelNet, one picture", None, self._exposure_us)] + [
            (f"{len(self._model.groups(kind))} exposures, {length}", kind, exposure)
            for length, exposure in (("as long", self._exposure_us), ("longer", bright))
            for kind in (LightGroups.TRIPLES, LightGroups.SINGLES)
        ]
        errors: Errors = {}
        for press in presses:
            for name, kind, exposure in ways:
                errors.setdefault(name, []).append(self._errors(press, kind, exposure))
        means = {name: np.mean(found, axis=0).tolist() for name, found in errors.items()}
        network = means[ways[0][0]][0]
        return [
            Figures(
                way=name,
                objects=objects,
                presses=len(presses),
                exposures=len(self._model.groups(kind)) if kind else 1,
                exposure_us=exposure,
                contact_normal_deg=means[name][0],
                whole_normal_deg=means[name][1],
                contact_depth_mm=means[name][2],
                over_network=means[name][0] / network,
            )
            for name, kind, exposure in ways
        ]

    def _errors(self, press: Press, kind: LightGroups | None, exposure_us: float) -> tuple[float, float, float]:
        if kind is None:
            frame, surface = self._picture(press, self._model.colours, exposure_us)
            return errors_of(self._network.reconstruct(frame), surface)
        groups = self._model.groups(kind)
        taken = [self._picture(press, group, exposure_us) for group in (*groups, groups[0])]
        frames = [frame for frame, _ in taken]
        series = ExposureSeries(
            image=frames[0].image,
            time_s=0.0,
            sequence=0,
            groups=groups,
            frames=tuple((frame,) for frame in frames[:-1]),
            opening=frames[0],
            closing=frames[-1],
            exposure_us=exposure_us,
        )
        return errors_of(self._stereo[kind].reconstruct(series), taken[0][1])

    def _picture(self, press: Press, group: np.ndarray, exposure_us: float) -> tuple[CameraFrame, Surface]:
        share = exposure_us / self._exposure_us
        self._scene.response = replace(self._base, exposure=self._base.exposure * share)
        grey, surface = self._scene.show(press, group / 255.0)
        image = digitise(grey, self._noise_grey, self._random)
        return CameraFrame(image=image, time_s=0.0, sequence=0, source="sim://"), surface


def errors_of(felt: TactileFrame, surface: Surface) -> tuple[float, float, float]:
    """Mean normal error in contact and over all, degrees, and mean absolute depth error in contact, mm."""
    angle = angle_deg(felt.normal_map, normals(surface.gradient_map))
    depth = np.abs(felt.depth_mm - surface.depth_mm)
    return float(angle[surface.contact].mean()), float(angle.mean()), float(depth[surface.contact].mean())


def as_rows(figures: list[Figures]) -> list[dict[str, object]]:
    """Turn figures into plain dictionaries, for JSON."""
    return [asdict(row) for row in figures]
