"""A simulated sensor whose faults are made where they arise: at the light, at the gel, at the camera's place."""

import functools
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.lab.simulator.scene import Press, Scene
from gellight.reconstruction.integration import angle_deg, normals
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.helpers.tactile import tactile

NOISE_GREY = 1.0
_FIELDS = 8


@functools.cache
def _noise_fields(shape: tuple[int, int]) -> NDArray[np.float32]:
    """Noise of a few frames; shifted at random it serves for many, at a quarter of the time."""
    return NOISE_GREY * np.random.default_rng(99).standard_normal((_FIELDS, *shape, 3), dtype=np.float32)


@dataclass
class WatchedSensor:
    """Takes frames of the simulated gel, one each time the watch looks, and shows them to it."""

    scene: Scene
    watch: SensorWatch
    seed: int
    leds: dict[int, float] = field(default_factory=dict)
    """light of single LEDs as a share of what it should be"""
    gain: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    """light of the three colours as a share of what it should be"""
    shift_px: tuple[float, float] = (0.0, 0.0)
    """by which the camera's picture is moved, x and y"""
    spot: NDArray[np.float32] | None = None
    """(H, W, 3) share of the light that the camera gets from each place of the gel"""
    time_s: float = 0.0
    told: list[str] = field(default_factory=list)
    """every kind of finding that was ever told, in order"""

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)

    def picture(self, press: Press | None) -> NDArray[np.float32]:
        """(H, W, 3) grey levels before noise."""
        light = self.scene.light * self.gain
        for led, share in self.leds.items():
            light[led] *= share
        grey = self.scene.show(press, light)[0]
        if self.spot is not None:
            grey = grey * self.spot
        if self.shift_px != (0.0, 0.0):
            x, y = self.shift_px
            channels = [ndimage.shift(channel, (y, x), order=3, mode="nearest") for channel in np.moveaxis(grey, 2, 0)]
            grey = np.stack(channels, axis=2).astype(np.float32)
        return grey

    def frame(self, press: Press | None = None) -> TactileFrame:
        return self.expose(self.picture(press))

    def expose(self, grey: NDArray[np.float32]) -> TactileFrame:
        """A frame of this picture, with noise; the watch looks at nothing but the picture."""
        self.time_s += PERIOD_S
        fields = _noise_fields(grey.shape[:2])
        noise = np.roll(fields[self._random.integers(_FIELDS)], self._random.integers(0, 640, 2), axis=(0, 1))
        image = np.clip(np.rint(grey + noise), 0, 255).astype(np.uint8)
        seen = CameraFrame(image=image, time_s=self.time_s, sequence=round(self.time_s / PERIOD_S))
        return replace(tactile(np.zeros((2, 2))), camera_frame=seen)

    def run(self, seconds: float, press: Press | None = None) -> None:
        """Let time pass with `press` in the gel."""
        grey = self.picture(press)
        for _ in range(round(seconds / PERIOD_S)):
            self.watch.note(self.expose(grey))
            self.told += [f.kind for f in self.watch.findings() if f.kind not in self.told]

    def work(self, presses: int, *, depths_mm: tuple[float, ...] = (0.3, 0.7, 1.0)) -> None:
        """Touch the gel at random places with a ball, half a second of rest in between."""
        for _ in range(presses):
            x, y = self._random.uniform(-14, 14), self._random.uniform(-10, 10)
            depth = float(self._random.choice(depths_mm))
            self.run(self._random.choice([0.5, 1.0, 2.0]), Press("BALL", depth, x, y))
            self.run(0.5)

    def figures(self, kind: str) -> dict[str, object]:
        """What is told of a finding."""
        return next(finding.figures for finding in self.watch.findings() if finding.kind == kind)

    def contact_error_deg(self, reconstructor: Reconstructor) -> float:
        """Mean normal error in contact of balls at four places."""
        errors = []
        for place in ((0.0, 0.0), (-9.0, 4.0), (8.0, -6.0), (10.0, 5.0)):
            press = Press("BALL", 1.0, *place)
            felt = reconstructor.reconstruct(self.frame(press).camera_frame)
            surface = self.scene.show(press)[1]
            errors.append(angle_deg(felt.normal_map, normals(surface.gradient_map))[surface.contact].mean())
        return float(np.mean(errors))


def torn(image_shape: tuple[int, int], x_px: int, y_px: int, *, radius_px: float = 18.0, light: float = 0.3,
         seed: int = 0) -> NDArray[np.float32]:  # fmt: skip
    """(H, W, 3) share of light with a ragged hole in the coating, through which little comes back."""
    rows, columns = np.indices(image_shape)
    angle = np.arctan2(rows - y_px, columns - x_px)
    random = np.random.default_rng(seed)
    rag = sum(random.uniform(-0.2, 0.2) * np.cos(k * angle + random.uniform(0, 7)) for k in range(2, 7))
    hole = np.hypot(rows - y_px, columns - x_px) < radius_px * (1 + rag)
    share: NDArray[np.float32] = np.where(hole, np.float32(light), np.float32(1))
    return np.repeat(share[..., None], 3, axis=2)


def dusty(image_shape: tuple[int, int], x_px: int, y_px: int, *, radius_px: float = 20.0,
          light: float = 0.7) -> NDArray[np.float32]:  # fmt: skip
    """(H, W, 3) share of light behind a blurred speck on the window."""
    rows, columns = np.indices(image_shape)
    distance = np.hypot(rows - y_px, columns - x_px) / radius_px
    share = (1 - (1 - light) * np.exp(-(distance**4))).astype(np.float32)
    return np.repeat(share[..., None], 3, axis=2)
