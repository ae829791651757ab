"""Photometric stereo at the rate of the camera, from a window that slides over the frames of a light sequence.

A window holds the newest frame of every light group, so each new frame gives a new result. What makes that quick
enough: only the new frame is taken apart; pixels of a large picture are solved as means over 2 x 2; the height of the
surface as a whole is measured once a turn of the sequence; and near light is computed for the depth of the result
before, which one frame period later is nearly the depth that is there. Where the gel is touched anew, slopes are up to
5 % wrong until the next frame.
"""

import numpy as np

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureSeries
from gellight.photometric.light_model import (
    Bools,
    Floats,
    GroupSignals,
    LightGroups,
    LightModel,
    Signals,
    group_signals,
    joined,
)
from gellight.reconstruction.smoothing import NARROWEST_PX
from gellight.reconstruction.stages import Stages
from gellight.series.reconstructor import PhotometricReconstructor

BLOCK_PX = 2  # chosen: a quarter of the pixels, a quarter of the time
MOST_PIXELS = 100_000
"""a picture of more is solved as means: this many take about one frame period of a camera of 30 Hz"""


class WindowReconstructor(PhotometricReconstructor):
    """Like its base, for windows that follow on each other. One reconstructor serves one thread."""

    def __init__(
        self, bundle: Bundle, model: LightModel, kind: LightGroups, *, smoothing_px: int = NARROWEST_PX
    ) -> None:
        """Compute the light on the flat gel; arguments and errors as the base."""
        height, width = model.image_shape
        coarse = height * width > MOST_PIXELS and height % BLOCK_PX == width % BLOCK_PX == 0
        super().__init__(bundle, model, kind, smoothing_px=smoothing_px, block_px=BLOCK_PX if coarse else 1)
        self._before = np.zeros(self._shape, np.float32)
        """depth map of the result before, mm"""
        self._apart: dict[int, tuple[CameraFrame, GroupSignals]] = {}
        """by light group: the newest frame, taken apart"""
        self._frames = 0
        self._correction_mm = 0.0

    def _signals(self, series: ExposureSeries) -> Signals:
        for group, (frame, *_) in enumerate(series.frames):
            if group not in self._apart or self._apart[group][0] is not frame:
                noise = self.bundle.manifest.noise_grey
                apart = group_signals([frame.image], series.groups[group], self.model, noise, self._block)
                self._apart[group] = frame, apart
        return joined([self._apart[group][1] for group in range(len(series.groups))], len(self.model.colours))

    def _solved(self, signals: Signals, stages: Stages) -> tuple[Floats, Floats, Bools, Floats]:
        scaled: Floats = np.einsum("kip,kp->ip", self._projection, signals.grey)
        scaled, used, predicted = self._refined(scaled, self._before, signals)
        gradient_map, noise = self._slopes(scaled)
        stages.end("slopes")
        self._before = depth = self._depth(gradient_map, scaled, signals)
        gradient_map = self._of_surface(depth, gradient_map, noise)
        stages.end("depth")
        return gradient_map, depth, used, predicted

    def _level_mm(self, depth: Floats, signals: Signals) -> float:
        if self._frames % len(self._apart) == 0:
            self._correction_mm = super()._level_mm(depth, signals)
        self._frames += 1
        return self._correction_mm
