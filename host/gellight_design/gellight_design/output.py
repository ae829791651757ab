"""The results of the coarse stage, the fine stage and the calibration ball as JSON, text and charts; writing files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight_design.charts import Axes, Series, heat_map, line_chart
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer import ball, fine
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult

Array = NDArray[np.float64]
Files = dict[str, bytes | str]
"""contents by file name"""
TUNED = "tuned: the measures of the objects, which the paper does not give, were chosen so that it is 29 by default"
RED_DEG = 30.0
"""heat maps are red from here, as in figure 3"""
BALL_RADII_MM = np.arange(2.0, 8.01, 0.5)


def check_writable(folder: Path) -> None:
    """Make `folder` if need be; raises InputError, before anything is computed, if nothing can be written there."""
    write_all(folder, {".writable": b""})
    (folder / ".writable").unlink()


def write_all(folder: Path, files: Mapping[str, bytes | str]) -> list[Path]:
    """Write files into `folder`, each whole or not at all; raises InputError if that is impossible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            write_file(folder / name, content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}): choose another --out") from error
    return [folder / name for name in files]


def coarse_json(result: CoarseResult) -> dict[str, Any]:
    """Return the coarse study; rows of the maps are numbers of lights, columns angles."""
    return {
        "light_numbers": list(result.groups.numbers),
        "angles_deg": _degrees(result.groups.angles_rad),
        "best_angle_deg": _degrees(result.best_angle_rad()),
        "best_angle_is": TUNED,
        "mean_best_angle_deg": _degrees(result.mean_best_angle_rad()),
        "best_angle_by_object": {name: _degrees(angle) for name, angle in result.best_angles_rad().items()},
        "map_mean_by_lights": {str(n): round(mean, 5) for n, mean in result.map_mean_by_number().items()},
        "top1_deg": _degrees(result.mean_top1_rad),
        "top1_by_object_deg": dict(zip(result.names, _degrees(result.errors_rad[..., 2]), strict=True)),
        "mae_deg": _degrees(result.errors_rad[..., 0].mean(axis=0)),
        "top5_deg": _degrees(result.errors_rad[..., 1].mean(axis=0)),
    }


def coarse_text(result: CoarseResult) -> str:
    """Return the averaged Top1 map and the best angles as lines of text."""
    angles = [f"{degrees(angle):7.0f}" for angle in result.groups.angles_rad]
    lines = ["Top1 in degrees, averaged over the objects", "lights \\ angle" + "".join(angles)]
    for number, row in zip(result.groups.numbers, np.degrees(result.mean_top1_rad), strict=True):
        lines.append(f"{number:14}" + "".join(f"{value:7.2f}" for value in row))
    each = ", ".join(f"{name} {degrees(angle):.0f}" for name, angle in result.best_angles_rad().items())
    lines.append(f"best angle with {CHOSEN_NUMBER} lights: {degrees(result.best_angle_rad()):.0f} degrees ({TUNED})")
    lines.append(f"mean of the objects' best angles: {degrees(result.mean_best_angle_rad()):.1f} degrees ({each})")
    return "\n".join(lines)


def coarse_charts(result: CoarseResult) -> Files:
    """Return a heat map of each object and the averaged curves."""
    return {**{f"{name}.svg": top1_map(result, name) for name in result.names}, "mean.svg": top1_curves(result)}


def top1_map(result: CoarseResult, name: str) -> str:
    """Return a heat map of figure 3a or 4a."""
    values = np.degrees(result.errors_rad[result.names.index(name), ..., 2])
    rows = [str(number) for number in result.groups.numbers]
    columns = [f"{degrees(angle):.0f}°" for angle in result.groups.angles_rad]
    axes = Axes(title=f"{name}: Top1, degrees", x="incident angle", y="number of lights")
    return heat_map(values, rows, columns, axes, largest=RED_DEG)


def top1_curves(result: CoarseResult) -> str:
    """Return the curves of figure 4b, one for each number of lights, of the average."""
    axes = Axes(
        title="average of the benchmark", x="incident angle, degrees", y="Top1, degrees", log=True, legend="lights:"
    )
    angles, rows = _degrees(result.groups.angles_rad), np.degrees(result.mean_top1_rad).tolist()
    curves = zip(result.groups.numbers, rows, strict=True)
    return line_chart([Series(str(number), angles, row) for number, row in curves], axes)


@dataclass(frozen=True)
class FineResult:
    """The fine stage: how a plane is lit with the LEDs at each height."""

    by_height: Sequence[fine.Illumination]

    @property
    def half_saturated_mm(self) -> float:
        """The height at which SAT is a half, NaN where it is not."""
        heights, saturations = zip(*((one.mounting_height_mm, one.saturation) for one in self.by_height), strict=True)
        return fine.height_of_saturation(np.array(heights), np.array(saturations))


def fine_study(geometry: SensorGeometry, diameter_mm: float, gamma: float) -> FineResult:
    """Return the fine stage of a sensor: of the paper's heights those at which its LEDs are above the gel."""
    view = fine.View(diameter_mm=diameter_mm, camera=replace(fine.IDEAL_CAMERA, gamma=gamma))
    heights = [height for height in fine.HEIGHTS_MM if height < geometry.camera_height_mm]
    return FineResult([fine.illumination(fine.at_height(geometry, height), view) for height in heights])


def fine_json(result: FineResult) -> dict[str, Any]:
    """Return equations 6 and 7 by height, and the height at which SAT is a half (null where it is not)."""
    columns = ("mounting_height_mm", "nsd", "saturation", "mean", "variation")
    return {
        "half_saturated_mm": numbers(result.half_saturated_mm),
        **{name: numbers([getattr(one, name) for one in result.by_height]) for name in columns},
    }


def fine_text(result: FineResult) -> str:
    """Return equations 6 and 7 by height as lines of text."""
    brightest = max(one.mean for one in result.by_height)
    rows = [
        f"{one.mounting_height_mm:9g}{one.nsd:8.3f}{one.saturation:8.1%}{one.mean / brightest:9.1%}"
        f"{one.variation:10.1%}"
        for one in result.by_height
    ]
    half = result.half_saturated_mm
    return "\n".join(
        [
            "height mm     NSD     SAT    light    spread",
            *rows,
            f"SAT is 50 % at {half:.1f} mm" if isfinite(half) else "SAT is 50 % at none of these heights",
        ]
    )


def fine_chart(result: FineResult) -> str:
    """Return NSD and SAT by height as SVG."""
    heights = [one.mounting_height_mm for one in result.by_height]
    curves = {"NSD": [one.nsd for one in result.by_height], "SAT": [one.saturation for one in result.by_height]}
    axes = Axes(title="Equations 6 and 7", x="mounting height, mm", y="NSD, SAT", legend="")
    return line_chart([Series(name, heights, values) for name, values in curves.items()], axes)


@dataclass(frozen=True, eq=False)
class BallResult:
    """The recommended calibration ball, and equation 8."""

    choice: ball.BallChoice
    elevation_rad: Mapping[float, Array]
    """by press depth in mm: largest slope for each of `BALL_RADII_MM`, NaN where the press is deeper than the ball"""


def ball_study(geometry: SensorGeometry, press_mm: float, radii_mm: Sequence[float] | None) -> BallResult:
    """Return the best of the balls at hand (by default `BALL_RADII_MM`) for a press.

    Raises InputError for radii that are not positive, a press deeper than the gel or the only ball, or no ball that
    records the wanted slopes.
    """
    at_hand = np.array(sorted(radii_mm)) if radii_mm else BALL_RADII_MM
    try:
        if not (np.isfinite(at_hand).all() and at_hand.min() > 0):
            raise ValueError(f"--radius {', '.join(f'{r:g}' for r in at_hand)}: give radii in mm, greater than 0")
        if len(at_hand) == 1 and press_mm > at_hand[0]:
            raise ValueError(
                f"a press of {press_mm:g} mm is deeper than the ball of {at_hand[0]:g} mm radius: press less"
            )
        choice = ball.choose_ball(at_hand, geometry, press_depth_mm=press_mm)
    except ValueError as error:
        raise InputError(str(error)) from None
    depths = sorted({0.5, 1.0, 1.5, 2.0, 2.5, 3.0, press_mm})
    table = ball.elevation_table(BALL_RADII_MM, np.array(depths))
    return BallResult(choice, dict(zip(depths, table.T, strict=True)))


def ball_json(result: BallResult) -> dict[str, Any]:
    """Return the recommendation and equation 8 as a table; null where the press is deeper than the ball."""
    return {
        "radius_mm": result.choice.radius_mm,
        "press_mm": result.choice.press_depth_mm,
        "elevation_deg": degrees(result.choice.elevation_rad),
        "shadow_free_deg": _degrees(result.choice.shadow_free_rad),
        "radii_mm": BALL_RADII_MM.tolist(),
        "elevation_by_press_deg": {
            f"{depth:g}": numbers(np.degrees(curve)) for depth, curve in result.elevation_rad.items()
        },
    }


def ball_text(choice: ball.BallChoice) -> str:
    """Return the recommendation in words."""
    return (
        f"ball of {choice.radius_mm:g} mm radius, pressed {choice.press_depth_mm:g} mm deep: records slopes up to "
        f"{degrees(choice.elevation_rad):.1f} degrees; in the middle of the gel slopes beyond "
        f"{degrees(choice.shadow_free_rad):.1f} degrees lie in the shadow of an LED, whose light arrives behind the "
        f"window at {90 - degrees(choice.shadow_free_rad):.1f} degrees from the normal"
    )


def ball_chart(result: BallResult) -> str:
    """Return figure 3c as SVG."""
    axes = Axes(
        title="Figure 3c: equation 8",
        x="radius of the ball, mm",
        y="largest elevation angle, degrees",
        levels=((degrees(ball.WANTED_ELEVATION_RAD), "wanted"),),
        legend="press, mm:",
    )
    radii, curves = BALL_RADII_MM.tolist(), result.elevation_rad.items()
    return line_chart([Series(f"{depth:g}", radii, np.degrees(curve).tolist()) for depth, curve in curves], axes)


def _degrees(angles_rad: ArrayLike) -> Any:
    """Return an angle or an array of angles for JSON."""
    return np.round(np.degrees(angles_rad), 4).tolist()


def numbers(values: ArrayLike) -> Any:
    """Return a number or (N,) numbers for JSON, None where they are not finite."""
    rounded = [round(value, 5) if isfinite(value) else None for value in np.atleast_1d(values).tolist()]
    return rounded if np.ndim(values) else rounded[0]
