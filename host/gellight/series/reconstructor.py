"""From a series of exposures to a tactile frame: the same result as GelNet's, measured instead of learned.

First every pixel is solved as if the gel were flat, by one precomputed product. Then the light reaching the depth found
is computed, and the pixels that are touched or shadowed are solved again with it; twice. A gel pressed 1 mm towards
LEDs 20 mm away is lit from lower angles than the gel at rest: without this second look its slopes are 5 % wrong.
"""

from math import inf
from typing import Any, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, ExposureReport, ExposureSeries, TactileFrame
from gellight.frames.pixel_grid import block_means, plane_means, spread_blocks
from gellight.frames.status import PathStatus
from gellight.photometric import static_scene
from gellight.photometric.level import find_level
from gellight.photometric.light_model import (
    Bools,
    Floats,
    LightGroups,
    LightModel,
    Signals,
    signals_of,
    without_shadows,
)
from gellight.photometric.solver import (
    Points,
    flat_gel,
    inverse,
    light_rows,
    normal_matrix,
    predict,
    slopes,
    solve_robustly,
)
from gellight.reconstruction.integration import far_from_touch
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.perspective import Perspective, depth_seen, surface_seen
from gellight.reconstruction.smoothing import NARROWEST_PX, Smoother
from gellight.reconstruction.stages import Stages, tactile_frame
from gellight.series.summary import as_picture, exposure_report

STAGES = ("signals", "slopes", "depth", "refined", "still", "normals", "contact")
"""Keys of `TactileFrame.stage_seconds`, in the order of the path."""
REFINEMENTS = 2  # chosen: each takes the light at the depth of the one before
FLAT_MM = 0.01
"""depth below which the light is taken to be that on the flat gel: slopes are then wrong by some 0.0004"""
BLOCK_POINTS = 8192  # chosen: points solved at once, so that memory does not grow with the picture
Image = TypeVar("Image", bound=NDArray[Any])
_CELL = 4  # chosen: px; the noise of such means is a quarter
_SIGNIFICANT = 6.0  # chosen: normal noise of a mean passes once in 500 million


class PhotometricReconstructor:
    """Everything that stays the same between the series of one sensor. One reconstructor serves one thread."""

    def __init__(
        self,
        bundle: Bundle,
        model: LightModel,
        kind: LightGroups,
        *,
        smoothing_px: int = NARROWEST_PX,
        block_px: int = 1,
    ) -> None:
        """Compute the light on the flat gel, some 90 MB for twelve lights at 640 x 480 pixels.

        kind: the light groups of the series. smoothing_px: half width of the smoothing of the gradient map, as for
        GelNet. block_px: solve for the means over squares of this side. Raises ValueError where model and calibration
        are of different image sizes.
        """
        if model.image_shape != bundle.image_shape:
            raise ValueError(f"the lights are for {model.image_shape} pixels, the calibration {bundle.image_shape}")
        self.bundle = bundle
        self.model = model
        self._perspective, self._whole_view = (Perspective.of_bundle(bundle, side) for side in (block_px, 1))
        self._smoother = Smoother(smoothing_px // block_px)
        self._block = block_px
        self._shape = model.image_shape[0] // block_px, model.image_shape[1] // block_px
        self._pixel_size_mm = bundle.pixel_size_mm[0] * block_px, bundle.pixel_size_mm[1] * block_px
        self._points = flat_gel(self._shape, self._pixel_size_mm)
        references = plane_means(model.references(kind), block_px) if block_px > 1 else model.references(kind)
        self._references = references.astype(np.float32).reshape(len(model.colours), -1)
        self._flat_rows = light_rows(self._points, self._references, model.ring)
        self._projection, self._slope_noise = _flat_solution(self._flat_rows)
        self._measures = BundleMeasures(bundle, from_network=False)

    def status(self) -> PathStatus:
        """Return the mode, ready for JSON."""
        return {"mode": "photometric"}

    def reconstruct(self, camera_frame: CameraFrame) -> TactileFrame:
        """Reconstruct gradient, normal and depth map and the contact from one series.

        The frame carries a report: whether the scene rested, and how many lights each pixel saw. Its picture is the sum
        of the exposures, as bright as the reference image: what this exposure would show under the whole ring, dimmed
        to the `light` of the frame. Raises InputError for what is no series.
        """
        if not isinstance(camera_frame, ExposureSeries):
            raise InputError(
                f"{camera_frame.source or 'the image'} is one picture, photometric stereo needs one for each light "
                "group: set reconstruction.mode = network"
            )
        series, stages = camera_frame, Stages()
        signals = without_shadows(self._signals(series), self._references)
        picture = self._picture(series, signals)
        difference = np.subtract(picture.image, self.bundle.reference, dtype=np.float32)
        stages.end("signals")
        gradient_map, depth, used, predicted = self._solved(signals, stages)
        gradient_map, depth = self._enlarged(gradient_map), self._enlarged(depth)
        report = self._report(series, signals, used, predicted)
        stages.end("still")
        size_mm, maps = self.bundle.pixel_size_mm, (difference, gradient_map, depth)
        return tactile_frame(
            picture, *maps, size_mm, stages, report, measures=self._measures, perspective=self._whole_view
        )

    def _signals(self, series: ExposureSeries) -> Signals:
        """Take the pictures apart into the light of each LED."""
        return signals_of(series.pictures, series.groups, self.model, self.bundle.manifest.noise_grey)

    def _picture(self, series: ExposureSeries, signals: Signals) -> CameraFrame:
        """Return the sum of the exposures as one picture, under the whole ring at the level of the reference image."""
        ours = self.model.exposure_us
        share = 1.0 if ours is None or series.exposure_us is None else ours / series.exposure_us
        light = np.rint(self.model.colours * share).astype(np.uint8)
        image = self._enlarged(self.model.grey(signals.light * np.float32(share), self._shape))
        return as_picture(series, image, light)

    def _enlarged(self, image: Image) -> Image:
        """Return an image or a map of the solution's pixels at the size of the camera's."""
        if self._block == 1:
            return image
        height, width = self.model.image_shape
        return cast("Image", cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR))

    def _solved(self, signals: Signals, stages: Stages) -> tuple[Floats, Floats, Bools, Floats]:
        """Return gradient map, depth map, the lights used and what they should have shown, (K, P) each."""
        scaled: Floats = np.einsum("kip,kp->ip", self._projection, signals.grey)  # every light, on the flat gel
        gradient_map, noise = self._slopes(scaled)
        stages.end("slopes")
        depth = self._depth(gradient_map, scaled, signals)
        stages.end("depth")
        used, predicted = signals.valid, signals.grey
        for _ in range(REFINEMENTS):
            scaled, used, predicted = self._refined(scaled, depth, signals)
            gradient_map, noise = self._slopes(scaled)
            depth = self._depth(gradient_map, scaled, signals)
        gradient_map = self._of_surface(depth, gradient_map, noise)
        stages.end("refined")
        return gradient_map, depth, used, predicted

    def _slopes(self, scaled: Floats) -> tuple[Floats, Floats]:
        """Return the gradient map, smoothed by the narrowest filter, and its noise."""
        planes = slopes(scaled).reshape(2, *self._shape)
        return self._smoother.prefilter(np.ascontiguousarray(np.moveaxis(planes, 0, 2), np.float32))

    def _of_surface(self, depth: Floats, gradient_map: Floats, noise: Floats) -> Floats:
        """Return the slopes of the surface: see `Smoother.of_surface`."""
        return surface_seen(self._smoother, depth, self._pixel_size_mm, gradient_map, noise, self._perspective)

    def _depth(self, gradient_map: Floats, scaled: Floats, signals: Signals) -> Floats:
        """Integrate, and set the height by the gel at rest or by the light."""
        rest = far_from_touch(self._touched(gradient_map, scaled, signals))
        depth = depth_seen(gradient_map, self._pixel_size_mm, self._perspective, at_rest=rest)
        return depth + np.float32(self._level_mm(depth, signals))

    def _level_mm(self, depth: Floats, signals: Signals) -> float:
        """Return by how much the light says that the whole surface lies deeper than `depth`."""
        return find_level(signals, self._references, depth.reshape(-1), self._places, self.model.ring).correction_mm

    def _places(self, pixels: NDArray[np.intp], depth_mm: Floats) -> Points:
        """Return where the gel is that pixels see, `depth_mm` (N,) deep."""
        x, y = self._points.x_mm[pixels], self._points.y_mm[pixels]
        return Points.seen_at(x, y, depth_mm, self.bundle.manifest.camera_height_mm or inf)

    def _touched(self, gradient_map: Floats, scaled: Floats, signals: Signals) -> Bools:
        """Mark the pixels whose slopes stand out of the noise, on cells of 4 x 4 pixels."""
        cells = block_means(gradient_map, _CELL)
        # The length of the scaled normal is the exposure in units of that of the light model.
        brightness = max(float(np.median(scaled[2, ::97])), 1e-3)
        noise = float(signals.deviation.max()) * self._slope_noise / brightness / _CELL
        standing = (np.abs(cells) > _SIGNIFICANT * noise).any(axis=2)
        return spread_blocks(standing, _CELL, self._shape)

    def _refined(self, scaled: Floats, depth: Floats, signals: Signals) -> tuple[Floats, Bools, Floats]:
        """Solve again where gel is not flat or a light is missing; return scaled normals, lights used, predictions."""
        scaled, used = scaled.copy(), signals.valid.copy()
        predicted = predict(self._flat_rows, scaled)
        heights = depth.reshape(-1)
        anew = np.flatnonzero((np.abs(heights) > FLAT_MM) | ~signals.valid.all(axis=0))
        for start in range(0, len(anew), BLOCK_POINTS):
            chosen = anew[start : start + BLOCK_POINTS]
            points = self._places(chosen, heights[chosen])
            rows = light_rows(points, self._references[:, chosen], self.model.ring)
            scaled[:, chosen], used[:, chosen] = solve_robustly(
                signals.grey[:, chosen], rows, signals.valid[:, chosen], signals.deviation.astype(np.float32)
            )
            predicted[:, chosen] = predict(rows, scaled[:, chosen])
        return scaled, used, predicted

    def _report(self, series: ExposureSeries, signals: Signals, used: Bools, predicted: Floats) -> ExposureReport:
        lights = used.sum(axis=0, dtype=np.uint8).reshape(self._shape)
        return exposure_report(
            series,
            spread_blocks(lights, self._block, self.model.image_shape) if self._block > 1 else lights,
            noise_grey=self.bundle.manifest.noise_grey,
            misfit=static_scene.misfit(signals.grey, used, predicted, signals.deviation, self._shape),
        )


def _flat_solution(rows: NDArray[np.floating]) -> tuple[Floats, float]:
    """Return the (K, 3, P) product that solves every pixel with all lights, and its slope noise per grey level."""
    inverted = inverse(normal_matrix(rows, rows))
    # n / n_z of the flat gel: a grey level of noise in each light is the root of this in a slope, rho being 1.
    noise = float(np.sqrt(max(np.median(inverted[0, 0]), np.median(inverted[1, 1]))))
    return np.ascontiguousarray(np.einsum("ijp,kjp->kip", inverted, rows), np.float32), noise
