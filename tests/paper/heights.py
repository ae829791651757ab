"""The paper's fine stage: how a plane is lit at each mounting height, and how well normals are found there."""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.lab.design.output import Files, numbers
from gellight.lab.design.studies import StudySetup
from gellight.lab.report.charts import Axes, Series, line_chart
from gellight.lab.simulator.sweep import Study, Task
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import design, fine, near_field
from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.refraction import VACUUM, Medium, window_of

Array = NDArray[np.float64]
FINE_DIAMETER_MM = 30.0
"""of the disc that the fine study evaluates at most"""
CAMERA = LightGroups(full_scale_grey=230.0)
METHODS = {
    "one exposure": (True, False),
    "each LED by itself": (False, False),
    "each LED by itself, shadows dropped": (False, True),
}
"""whether all LEDs shine at once, whether shadowed observations are dropped"""
EQUAL_LIGHT = "one exposure, least possible error"
"""of an unbiased estimate, lamps and exposure those of the given sensor at every height"""
FINE_THINNING = 6
"""one in that many pixels is evaluated"""


def fine_errors(name: str, setup: StudySetup, heights_mm: tuple[float, ...], medium: Medium) -> Any:
    """Return MAE and Top1 in rad by method, `EQUAL_LIGHT` last, and height: (methods + 1, heights, 2) as lists.

    They are NaN at a height where the LEDs would be inside the window.
    """
    diameter = min(FINE_DIAMETER_MM, setup.sampling.region_diameter_mm)
    place = setup.press(name, replace(setup.sampling, region_diameter_mm=diameter), FINE_THINNING)
    camera, given = setup.with_noise(CAMERA), near_field.ring_light_vectors(setup.geometry, place.x, place.y, medium)
    h_mm = setup.geometry.camera_height_mm - setup.geometry.mounting_height_mm
    # The unit of light is that of an LED straight above, which falls with the square of its height.
    gain = near_field.restoring_gain(given, near_field.mixing(setup.geometry, one_shot=True)) * h_mm**2
    by_height = [
        _errors_at(fine.at_height(setup.geometry, height), place, medium, camera, gain) for height in heights_mm
    ]
    return np.swapaxes(by_height, 0, 1).tolist()


def _errors_at(
    geometry: SensorGeometry, place: design.Place, medium: Medium, camera: LightGroups, gain_mm2: float
) -> Array:
    """Return MAE and Top1 in rad of each method, and of `EQUAL_LIGHT`: (methods + 1, 2)."""
    above_mm = geometry.camera_height_mm - geometry.mounting_height_mm
    if above_mm <= medium.thickness_mm:
        return np.full((len(METHODS) + 1, 2), np.nan)
    ring = near_field.ring_light_vectors(geometry, place.x, place.y, medium)
    mixed = [(near_field.mixing(geometry, one_shot=at_once), drop) for at_once, drop in METHODS.values()]
    errors = [near_field.normal_error(place.scenes[0], ring, mix, camera, drop_shadows=drop) for mix, drop in mixed]
    at_once = near_field.mixing(geometry, one_shot=True)
    errors.append(near_field.least_error(place.scenes[0], ring, at_once, camera, gain=gain_mm2 / above_mm**2))
    return np.array([[mae, top1] for mae, _, top1 in errors])


@dataclass(frozen=True, eq=False)
class FineResult:
    """The fine stage: how a plane is lit, and how well the normals are reconstructed, at each height."""

    heights_mm: tuple[float, ...]
    light: list[fine.Illumination]
    errors_rad: dict[str, Array]
    """by medium, (methods + 1, heights, 2): MAE and Top1 averaged over the objects, NaN inside the window"""

    @property
    def half_saturation_mm(self) -> float:
        """Height at which SAT reaches 50 %, NaN if it does at none of the heights."""
        return fine.height_of_saturation(np.array(self.heights_mm), np.array([one.saturation for one in self.light]))

    def errors_deg(self, medium: str, method: str) -> Array:
        """Return MAE and Top1 in degrees by height, (heights, 2), of one of `METHODS` or `EQUAL_LIGHT`."""
        return np.asarray(np.degrees(self.errors_rad[medium][[*METHODS, EQUAL_LIGHT].index(method)]))


def fine_study(setup: StudySetup, heights_mm: tuple[float, ...]) -> Study[FineResult]:
    """Return the fine study: one task an object and medium."""
    media = {"air": VACUUM, "window": window_of(setup.geometry)}

    def combine(errors: list[Any]) -> FineResult:
        shape = (len(media), len(setup.names), len(METHODS) + 1, len(heights_mm), 2)
        averaged = np.array(errors).reshape(shape).mean(axis=1)
        light = [fine.illumination(fine.at_height(setup.geometry, height), fine.View()) for height in heights_mm]
        return FineResult(heights_mm, light, dict(zip(media, averaged, strict=True)))

    tasks = [
        Task(f"{name} ({label})", fine_errors, (name, setup, heights_mm, medium))
        for label, medium in media.items()
        for name in setup.names
    ]
    return Study(tasks, combine)


def fine_json(result: FineResult) -> dict[str, Any]:
    """Return the fine study by height; errors are null where the LEDs would be inside the window."""
    light = result.light
    return {
        "height_mm": list(result.heights_mm),
        "sat": [round(one.saturation, 6) for one in light],
        "nsd": [round(one.nsd, 6) for one in light],
        "normal_error_deg": numbers(result.errors_deg("air", "each LED by itself, shadows dropped")[:, 0]),
        "height_of_half_saturation_mm": numbers(result.half_saturation_mm),
        "variation": [round(one.variation, 6) for one in light],
        "within_sigmas": [[round(share, 5) for share in one.within_sigmas] for one in light],
        "mean_light": [round(one.mean / light[0].mean, 5) for one in light],
        "errors_deg": {
            medium: {
                method: dict(zip(("mae", "top1"), map(numbers, result.errors_deg(medium, method).T), strict=True))
                for method in METHODS
            }
            for medium in result.errors_rad
        },
    }


def fine_text(result: FineResult) -> str:
    """Return a line for each height."""
    lines = ["height mm    SAT    NSD   MAE one exposure   each LED alone   shadows dropped   (degrees)"]
    for at, light in enumerate(result.light):
        errors = [result.errors_deg("air", method)[at, 0] for method in METHODS]
        lines.append(
            f"{light.mounting_height_mm:9.1f} {light.saturation:6.1%} {light.nsd:6.2f} {errors[0]:18.2f} "
            f"{errors[1]:16.3f} {errors[2]:17.3f}"
        )
    half = result.half_saturation_mm
    where = f"at {half:.1f} mm" if isfinite(half) else "at none of these heights"
    return "\n".join([*lines, f"SAT reaches 50 % {where} (disc of 35 mm, ideal colours)"])


def fine_charts(result: FineResult) -> Files:
    """Return SAT and NSD against height (figure 4e), and the error of the normals."""
    heights = list(result.heights_mm)
    saturation = Series("", heights, [100 * one.saturation for one in result.light])
    deviation = Series("", heights, [one.nsd for one in result.light])
    errors = [
        Series(
            f"{method} ({medium})", heights, result.errors_deg(medium, method)[:, 0].tolist(), medium == "window", at
        )
        for medium in result.errors_rad
        for at, method in enumerate(METHODS)
    ]
    x = "mounting height, mm"
    half = Axes(title="Figure 4e: SAT of a plane", x=x, y="SAT, %", levels=((50.0, "50 %"),))
    return {
        "saturation.svg": line_chart([saturation], half),
        "deviation.svg": line_chart([deviation], Axes(title="Figure 4e: NSD of a plane", x=x, y="NSD")),
        "error.svg": line_chart(errors, Axes(title="Error of the normals, benchmark", x=x, y="MAE, degrees", log=True)),
    }
