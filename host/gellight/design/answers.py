"""What a study found: as JSON for programs, as lines for people, as drawings and parts for the folder of results."""

from collections.abc import Mapping, Sequence
from math import degrees, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.base.writing import write_file
from gellight.design.studies import METHODS, FineResult, Subject
from gellight.report.charts import Axes, Series, heat_map, line_chart
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters
from sim_reference.optimizer import ball, fine
from sim_reference.optimizer.benchmark import Sampling
from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult

Array = NDArray[np.float64]
Files = dict[str, bytes | str]
RED_DEG = 30.0
"""heat maps are red from here, as in figure 3"""
BALL_RADII_MM = np.arange(2.0, 8.01, 0.5)


def subject_of(
    geometry: SensorGeometry, press_mm: float, relief_mm: float, size: int, noise_grey: float = 1.0
) -> Subject:
    """Return what is studied; raises InputError for a press or a relief that is not positive and less than the gel."""
    if not 0 < relief_mm < geometry.gel_thickness_mm:
        raise InputError(
            f"--relief {relief_mm:g} mm: it must be positive and less than the gel's {geometry.gel_thickness_mm:g} mm"
        )
    if not 0 < press_mm < geometry.gel_thickness_mm:
        raise InputError(
            f"--press {press_mm:g} mm: it must be positive and less than the gel's {geometry.gel_thickness_mm:g} mm"
        )
    return Subject(
        geometry=geometry,
        parameters=ObjectParameters(relief_mm=relief_mm),
        sampling=Sampling(size_px=size, press_depth_mm=press_mm),
        noise_grey=noise_grey,
    )


def writable(folder: Path) -> None:
    """Make `folder` if need be; raises InputError if nothing can be written there, before anything is computed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_file(folder / ".writable", b"")
        (folder / ".writable").unlink()
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}): choose another --out") from error


def write_all(folder: Path, files: Mapping[str, bytes | str]) -> list[Path]:
    """Write files into `folder`, each whole or not at all; raises InputError if that is impossible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            write_file(folder / name, content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}): choose another --out") from error
    return [folder / name for name in files]


def coarse_answer(result: CoarseResult) -> dict[str, Any]:
    """Return the coarse study; rows of the maps are numbers of lights, columns angles."""
    return {
        "light_numbers": list(result.groups.numbers),
        "angles_deg": _round_degrees(result.groups.angles_rad),
        "best_angle_deg": _deg(result.best_angle_rad()),
        "mean_best_angle_deg": _deg(result.mean_best_angle_rad()),
        "best_angle_by_object": {name: _deg(angle) for name, angle in result.best_angles_rad().items()},
        "map_mean_by_lights": {str(n): round(mean, 5) for n, mean in result.map_mean_by_number().items()},
        "top1_deg": _round_degrees(result.mean_top1_rad),
        "top1_by_object_deg": dict(zip(result.names, _round_degrees(result.errors_rad[..., 2]), strict=True)),
        "mae_deg": _round_degrees(result.errors_rad[..., 0].mean(axis=0)),
        "top5_deg": _round_degrees(result.errors_rad[..., 1].mean(axis=0)),
    }


def coarse_text(result: CoarseResult) -> str:
    """Return the averaged Top1 map and the best angles as lines of text."""
    angles = [f"{degrees(angle):7.0f}" for angle in result.groups.angles_rad]
    lines = ["Top1 in degrees, averaged over the objects", "lights \\ angle" + "".join(angles)]
    for number, row in zip(result.groups.numbers, np.degrees(result.mean_top1_rad), strict=True):
        lines.append(f"{number:14}" + "".join(f"{value:7.2f}" for value in row))
    each = ", ".join(f"{name} {degrees(angle):.0f}" for name, angle in result.best_angles_rad().items())
    lines.append(f"best angle with {CHOSEN_NUMBER} lights: {degrees(result.best_angle_rad()):.0f} degrees")
    lines.append(f"mean of the objects' best angles: {degrees(result.mean_best_angle_rad()):.1f} degrees ({each})")
    return "\n".join(lines)


def coarse_drawings(result: CoarseResult) -> Files:
    """Return a heat map for each object and the averaged curves."""
    maps: Files = {f"{name}.svg": top1_map(result, name) for name in result.names}
    maps["mean.svg"] = top1_curves(result, None)
    return maps


def top1_map(result: CoarseResult, name: str, figure: int = 2) -> str:
    """Return a heat map of figure 3a or 4a: figure 0 is MAE, 1 Top5, 2 Top1."""
    values = np.degrees(result.errors_rad[result.names.index(name), ..., figure])
    rows = [str(number) for number in result.groups.numbers]
    columns = [f"{degrees(angle):.0f}°" for angle in result.groups.angles_rad]
    title = f"{name}: {('MAE', 'Top5', 'Top1')[figure]}, degrees"
    axes = Axes(title=title, x="incident angle", y="number of lights")
    return heat_map(values, rows, columns, axes, largest=RED_DEG)


def top1_curves(result: CoarseResult, name: str | None) -> str:
    """Return the curves of figure 4b, one a number of lights, of an object or of the average."""
    values = result.mean_top1_rad if name is None else result.errors_rad[result.names.index(name), ..., 2]
    angles = _round_degrees(result.groups.angles_rad)
    series = [
        Series(str(number), angles, row)
        for number, row in zip(result.groups.numbers, np.degrees(values).tolist(), strict=True)
    ]
    axes = Axes(
        title=name or "average of the benchmark",
        x="incident angle, degrees",
        y="Top1, degrees",
        log=True,
        legend="lights:",
    )
    return line_chart(series, axes)


def fine_answer(result: FineResult) -> dict[str, Any]:
    """Return the fine study by height; errors are null where the LEDs would be inside the window."""
    air, chosen = result.errors_rad["air"], list(METHODS).index("each LED by itself, shadows dropped")
    heights, saturations = np.array(result.heights_mm), np.array([light.saturation for light in result.light])
    half = fine.height_of_saturation(heights, saturations)
    return {
        "height_mm": list(result.heights_mm),
        "sat": [round(light.saturation, 6) for light in result.light],
        "nsd": [round(light.nsd, 6) for light in result.light],
        "normal_error_deg": [_number(value) for value in np.degrees(air[chosen, :, 0])],
        "height_of_half_saturation_mm": _number(half),
        "variation": [round(light.variation, 6) for light in result.light],
        "within_sigmas": [[round(share, 5) for share in light.within_sigmas] for light in result.light],
        "mean_light": [round(light.mean / result.light[0].mean, 5) for light in result.light],
        "errors_deg": {
            medium: {
                method: {
                    "mae": [_number(value) for value in np.degrees(table[at, :, 0])],
                    "top1": [_number(value) for value in np.degrees(table[at, :, 1])],
                }
                for at, method in enumerate(METHODS)
            }
            for medium, table in result.errors_rad.items()
        },
    }


def fine_text(result: FineResult) -> str:
    """Return a line a height."""
    lines = ["height mm    SAT    NSD   MAE one exposure   each LED alone   shadows dropped   (degrees)"]
    for at, light in enumerate(result.light):
        errors = np.degrees(result.errors_rad["air"][:, at, 0])
        lines.append(
            f"{light.mounting_height_mm:9.1f} {light.saturation:6.1%} {light.nsd:6.2f} {errors[0]:18.2f} "
            f"{errors[1]:16.3f} {errors[2]:17.3f}"
        )
    heights, saturations = np.array(result.heights_mm), np.array([light.saturation for light in result.light])
    half = fine.height_of_saturation(heights, saturations)
    where = f"at {half:.1f} mm" if isfinite(half) else "at none of these heights"
    return "\n".join([*lines, f"SAT reaches 50 % {where} (disc of 35 mm, ideal colours)"])


def fine_drawings(result: FineResult) -> Files:
    """Return the curves of figure 4e and those of the error."""
    saturation, deviation, error = fine_charts(result)
    return {"saturation.svg": saturation, "deviation.svg": deviation, "error.svg": error}


def fine_charts(result: FineResult) -> tuple[str, str, str]:
    """Return SAT, NSD and the error of the normals against height."""
    heights = list(result.heights_mm)
    saturation = Series("", heights, [100 * one.saturation for one in result.light])
    deviation = Series("", heights, [one.nsd for one in result.light])
    errors = [
        Series(f"{method} ({medium})", heights, np.degrees(table[at, :, 0]).tolist(), medium == "window", at)
        for medium, table in result.errors_rad.items()
        for at, method in enumerate(METHODS)
    ]
    mounting = "mounting height, mm"
    return (
        line_chart(
            [saturation], Axes(title="Figure 4e: SAT of a plane", x=mounting, y="SAT, %", levels=((50.0, "50 %"),))
        ),
        line_chart([deviation], Axes(title="Figure 4e: NSD of a plane", x=mounting, y="NSD")),
        line_chart(errors, Axes(title="Error of the normals, benchmark", x=mounting, y="MAE, degrees", log=True)),
    )


def ball_choice(
    geometry: SensorGeometry, press_mm: float, radii: Sequence[float] | None
) -> tuple[ball.BallChoice, dict[float, Array]]:
    """Return the recommended ball and the curves of figure 3c by press depth; raises InputError as `ball` does."""
    at_hand = np.array(sorted(radii)) if radii else BALL_RADII_MM
    try:
        if not (np.isfinite(at_hand).all() and at_hand.min() > 0):
            raise ValueError(f"--radius {', '.join(f'{r:g}' for r in at_hand)}: give radii in mm, greater than 0")
        if len(at_hand) == 1 and press_mm > at_hand[0]:
            raise ValueError(
                f"a press of {press_mm:g} mm is deeper than the ball of {at_hand.min():g} mm radius: press less"
            )
        choice = ball.choose_ball(at_hand, geometry, press_depth_mm=press_mm)
    except ValueError as error:
        raise InputError(str(error)) from None
    depths = sorted({0.5, 1.0, 1.5, 2.0, 2.5, 3.0, press_mm})
    table = ball.elevation_table(BALL_RADII_MM, np.array(depths))
    return choice, {depth: table[:, column] for column, depth in enumerate(depths)}


def ball_answer(choice: ball.BallChoice, curves: dict[float, Array]) -> dict[str, Any]:
    """Return the recommendation and equation 8 as a table; null where the press is deeper than the ball."""
    return {
        "radius_mm": choice.radius_mm,
        "press_mm": choice.press_depth_mm,
        "elevation_deg": degrees(choice.elevation_rad),
        "shadow_free_deg": _deg(choice.shadow_free_rad),
        "radii_mm": BALL_RADII_MM.tolist(),
        "elevation_by_press_deg": {
            f"{depth:g}": [_number(value) for value in np.degrees(curve)] for depth, curve in curves.items()
        },
    }


def ball_text(choice: ball.BallChoice) -> str:
    """Return the recommendation in words."""
    return (
        f"ball of {choice.radius_mm:g} mm radius, pressed {choice.press_depth_mm:g} mm deep: records slopes up to "
        f"{degrees(choice.elevation_rad):.1f} degrees; slopes beyond {degrees(choice.shadow_free_rad):.0f} degrees lie "
        "in shadow"
    )


def ball_chart(curves: dict[float, Array]) -> str:
    """Return figure 3c as SVG."""
    series = [
        Series(f"{depth:g}", BALL_RADII_MM.tolist(), np.degrees(curve).tolist()) for depth, curve in curves.items()
    ]
    axes = Axes(
        title="Figure 3c: equation 8",
        x="radius of the ball, mm",
        y="largest elevation angle, degrees",
        levels=((degrees(ball.WANTED_ELEVATION_RAD), "wanted"),),
        legend="press, mm:",
    )
    return line_chart(series, axes)


def _deg(angle_rad: float) -> float:
    return round(degrees(angle_rad), 4)


def _round_degrees(angles_rad: Any) -> Any:
    return np.round(np.degrees(angles_rad), 4).tolist()


def _number(value: float) -> float | None:
    return round(float(value), 5) if isfinite(value) else None
