"""Pictures of a small simulated gel under light groups, without a camera's clock or a board."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from gellight.bundle.bundle import Bundle, write_bundle
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.lab.optics.lights.reference_light import ReferencePictures, light_model
from gellight.lab.simulator.scene import Press, Scene
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.ring_geometry import RingGeometry
from gellight.ring.light_groups import colour_triples, single_leds
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry
from tests.helpers.linear_sensor import linear_network

RING = RingGeometry()
PIXEL_MM = (0.1176, 0.1176)
SMALL = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=PIXEL_MM[0])
GROUPS = {LightGroups.SINGLES: single_leds(RING.colours), LightGroups.TRIPLES: colour_triples(RING.colours)}


class Gel:
    def __init__(
        self, *, noise_grey: float = 1.0, gamma: float = 1.0, black_grey: float = 0.0, seed: int = 0,
        sensor: SensorGeometry = SMALL,
    ) -> None:  # fmt: skip
        self.scene = Scene(sensor, CameraResponse(noise_grey=noise_grey, gamma=gamma))
        self.base = self.scene.response
        self.black_grey = black_grey
        self.random = np.random.default_rng(seed)

    def exact(self, press: Press | None, group: np.ndarray) -> np.ndarray:
        """(H, W, 3) grey levels before noise, black level on top."""
        grey, _ = self.scene.show(press, group / 255.0)
        return grey * (1 - self.black_grey / 255) + self.black_grey

    def picture(self, press: Press | None, group: np.ndarray) -> np.ndarray:
        return digitise(self.exact(press, group).astype(np.float32), self.base.noise_grey, self.random)

    def mean(self, group: np.ndarray, frames: int) -> np.ndarray:
        return np.mean([self.picture(None, group) for _ in range(frames)], axis=0)

    def expose(self, factor: float) -> None:
        """So many times as long as at first."""
        self.scene.response = replace(self.base, exposure=self.base.exposure * factor)

    def bundle(self, folder: Path) -> Bundle:
        return write_bundle(
            folder, sensor="simulated", reference=self.mean(RING.colours, 8), reference_frames=8, noise_grey=1.0,
            pixel_size_mm=PIXEL_MM, network=linear_network(), metrics={},
        )  # fmt: skip

    def references(self, frames: int = 4) -> ReferencePictures:
        dark = np.median([self.picture(None, np.zeros((12, 3))) for _ in range(5)], axis=0)
        return ReferencePictures(
            dark=dark,
            singles=tuple(self.mean(group, frames) for group in GROUPS[LightGroups.SINGLES]),
            triples=tuple(self.mean(group, frames) for group in GROUPS[LightGroups.TRIPLES]),
            whole=self.mean(RING.colours, frames),
        )

    def model(self, frames: int = 4) -> LightModel:
        return light_model(self.references(frames), RING, RING.colours, PIXEL_MM, exposure_us=8000.0)

    def series(self, kind: LightGroups, presses: Press | list[Press | None] | None, number: int = 1) -> ExposureSeries:
        """The exposures of a press, or of one press each, the repetition at the end included."""
        groups = GROUPS[kind]
        each = presses if isinstance(presses, list) else [presses] * (len(groups) + 1)
        frames = [
            CameraFrame(image=self.picture(press, group), time_s=0.07 * i, sequence=number + i, source="test")
            for i, (press, group) in enumerate(zip(each, (*groups, groups[0]), strict=True))
        ]
        return ExposureSeries(
            image=frames[0].image,
            time_s=0.0,
            sequence=number,
            groups=groups,
            frames=tuple((frame,) for frame in frames[:-1]),
            opening=frames[0],
            closing=frames[-1],
        )
