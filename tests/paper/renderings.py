"""Rendered pictures of the report: the pressed objects, and the plane under the ring at each height."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.lab.design.studies import StudySetup
from gellight.lab.report.charts import picture
from sim_reference.camera import CameraResponse, digitise, exposure_for, linear_grey
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.optimizer import fine
from sim_reference.optimizer.benchmark import Sampling, deformed
from sim_reference.surface import Surface, sample, untouched

Image = NDArray[np.uint8]
SMALL = Sampling(size_px=150, extent_mm=36.0)
BRIGHTEST_GREY = 200.0
CONTOURS = 12
WIDTH_PX = 115
"""ten in a row"""


def benchmark_depths(setup: StudySetup) -> str:
    """Return the depth of every pressed object, light where it is deep."""
    figures, small = [], replace(SMALL, press_depth_mm=setup.sampling.press_depth_mm)
    for name in setup.names:
        pressed = setup.pressed(name, small)
        slope = np.degrees(pressed.steepest_rad())
        depth = pressed.depth_mm - pressed.depth_mm.min()
        grey = np.rint(255 * depth / depth.max()).astype(np.uint8)
        figures.append(picture(grey, f"{name} {slope:.0f}°, {pressed.depth_mm.max():.2f} mm", WIDTH_PX))
    return "".join(figures)


def benchmark_pictures(setup: StudySetup) -> str:
    """Return figure 4d: every object under the coloured ring."""
    square = SMALL.on(setup.geometry)
    exposed, figures = _exposed(square), []
    for name in setup.names:
        deformation = deformed(name, setup.sampling, square, setup.parameters, setup.model)
        figures.append(picture(_picture(sample(deformation, square, 0, 0), square, exposed), name, WIDTH_PX))
    return "".join(figures)


def plane_pictures(setup: StudySetup, heights_mm: tuple[float, ...]) -> str:
    """Return the upper row of figure 4e: the plane at each height, exposed as at the first."""
    square = SMALL.on(setup.geometry)
    exposed, first = _exposed(fine.at_height(square, heights_mm[0])), square.camera_height_mm - heights_mm[0]
    figures = []
    for height in heights_mm:
        raised = fine.at_height(square, height)
        # Irradiance is relative to the height: the same lamp is (h0 / h)^2 brighter from nearer by.
        nearer = (first / (square.camera_height_mm - height)) ** 2
        response = replace(exposed, exposure=exposed.exposure * nearer * 0.45)
        figures.append(picture(_picture(untouched(raised), raised, response), f"{height:g} mm", 96))
    return "".join(figures)


def channel_pictures(setup: StudySetup) -> str:
    """Return figure 4c: each channel of the plane with contour lines."""
    square = SMALL.on(setup.geometry)
    light = ring_irradiance(untouched(square), square, ring_light(square))
    figures = [picture(_picture(untouched(square), square, _exposed(square)), "plane", 130)]
    for channel, name in enumerate(("red", "green", "blue")):
        figures.append(picture(_contoured(light[..., channel] / light.max(), channel), name, 130))
    figures.append(picture(_contoured(light.mean(axis=2) / light.mean(axis=2).max(), None), "mean", 130))
    return "".join(figures)


def _contoured(share: NDArray[np.float64], channel: int | None) -> Image:
    level = np.floor(share * CONTOURS)
    edge = np.zeros(share.shape, bool)
    edge[:, 1:] |= level[:, 1:] != level[:, :-1]
    edge[1:] |= level[1:] != level[:-1]
    image = np.zeros((*share.shape, 3), np.uint8)
    image[..., range(3) if channel is None else [channel]] = np.rint(255 * share)[..., None]
    # Lines must stand out from what they lie on.
    image[edge] = np.where(share[edge, None] > 0.6, 0, 255)
    return image


def _exposed(geometry: SensorGeometry) -> CameraResponse:
    response = CameraResponse()
    light = ring_irradiance(untouched(geometry), geometry, ring_light(geometry))
    return replace(response, exposure=exposure_for(light, response, BRIGHTEST_GREY))


def _picture(surface: Surface, geometry: SensorGeometry, response: CameraResponse) -> Image:
    light = ring_irradiance(surface, geometry, ring_light(geometry))
    grey = linear_grey(light, response).astype(np.float32)
    return digitise(grey, response.noise_grey, np.random.default_rng(0))
