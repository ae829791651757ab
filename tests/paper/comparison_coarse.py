"""The statements of section 3.1.1, the coarse stage, beside what was measured here."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import degrees

import numpy as np
from numpy.typing import NDArray

from sim_reference.optimizer.coarse import CHOSEN_NUMBER, CoarseResult
from tests.paper.comparison import Judgement, Statement, judged

_statement = partial(Statement, section="3.1.1")
CURVED_CONVEX = (
    "the paper gives no measures of CCONVEX; as sparse solids it is mostly flat, as prisms with curved outlines steep"
)
STEEPEST = ("CCONVEX", "QUCAVE")
"""which the paper names as those that degrade most with the angle"""
UNKNOWN_MEASURES = "depends on measures of the objects that the paper does not give"


def coarse_judgements(by_reading: Mapping[str, CoarseResult]) -> list[Judgement]:
    """Return the statements of section 3.1.1 under each reading."""
    plain = judged({reading: coarse_statements(result) for reading, result in by_reading.items()})
    nearest = {
        f"{reading}; the step nearest to the mean of the best angles": _nearest_step(result)
        for reading, result in by_reading.items()
    }
    in_degrees = {f"{reading}; rise in degrees": _rise_in_degrees(result) for reading, result in by_reading.items()}
    return [
        Judgement({**plain[0].by_reading, **nearest}),
        *plain[1:-1],
        Judgement({**plain[-1].by_reading, **in_degrees}),
    ]


def coarse_statements(result: CoarseResult) -> list[Statement]:
    """Return the statements of section 3.1.1 under one reading."""
    return [
        *_best_angles(result),
        _falls_and_rises(result),
        _same_for_any_number(result),
        *_number_of_lights(result),
        *_regions(result),
        _low_frequency(result),
        _steepest_rise(result),
    ]


def _best_angles(result: CoarseResult) -> list[Statement]:
    best = degrees(result.best_angle_rad())
    mean = degrees(result.mean_best_angle_rad())
    return [
        _statement(
            claim="the incident angle is 29°, closest to the average minimum",
            measured=f"the averaged Top1 curve is lowest at {best:.0f}°",
            holds_if="29°",
            reproduced=abs(best - 29) < 0.5,
            why="tuned: the objects' measures, which the paper does not give, were chosen so; a property of surfaces "
            "with slopes of some 60°, see the sensitivity below",
        ),
        _statement(
            claim="the best angle averaged over the benchmark is 32.2°",
            measured=f"the mean of the ten best angles is {mean:.1f}°",
            holds_if="within 0.05°, half of the paper's last digit",
            reproduced=abs(mean - 32.2) < 0.05,
            why="on this grid such a mean is a multiple of 0.8, and 32.2 = 322/10 can be one; where exactly it lies, "
            + UNKNOWN_MEASURES,
        ),
    ]


def _nearest_step(result: CoarseResult) -> Statement:
    """The paper chooses 29 degrees as "most close to the average minimum error", after it gave 32.2 as the mean."""
    mean = result.mean_best_angle_rad()
    step = degrees(min(result.groups.angles_rad, key=lambda angle: abs(angle - mean)))
    return replace(
        _best_angles(result)[0],
        measured=f"of the angles tried, {step:.0f}° is nearest to {degrees(mean):.1f}°, the mean of the best ones",
        reproduced=abs(step - 29) < 0.5,
    )


def _falls_and_rises(result: CoarseResult) -> Statement:
    curve = result.mean_top1_rad[result.row(CHOSEN_NUMBER)]
    lowest = int(curve.argmin())
    holds = bool((np.diff(curve[: lowest + 1]) < 0).all() and (np.diff(curve[lowest:]) > 0).all())
    return _statement(
        claim="the error first falls, then rises with the incident angle",
        measured="falls to its minimum and rises after it" if holds else "not monotone on both sides",
        holds_if="monotone on both sides of the lowest point",
        reproduced=holds,
        why="the left branch needs noise or 8 bit: without either, least squares are exact below the first shadow",
    )


def _same_for_any_number(result: CoarseResult) -> Statement:
    best = [result.best_angle_rad(number) for number in result.groups.numbers]
    return _statement(
        claim="the best angle is almost the same for any number of lights",
        measured="best angles " + ", ".join(f"{degrees(angle):.0f}°" for angle in best),
        holds_if="the same for all",
        reproduced=len(set(best)) == 1,
        why="the angle is bounded by shadow, which does not depend on the number; neighbours may change places where "
        "their errors are alike",
    )


def _number_of_lights(result: CoarseResult) -> list[Statement]:
    means = result.map_mean_by_number()
    last = max(means)
    by_angle = result.mean_top1_rad[result.row(CHOSEN_NUMBER)]
    by_number = result.mean_top1_rad[:, result.groups.angles_rad.index(result.best_angle_rad())]
    ratio = float(by_number[-1] / by_number[result.row(CHOSEN_NUMBER)])
    over_angles, over_lights = (float(some.max() / some.min()) for some in (by_angle, by_number))
    return [
        _statement(
            claim="the error falls with the number of lights and is flat beyond 12",
            measured=f"map mean relative to 12 lights: 3: {means[3]:.2f}, 6: {means[6]:.2f}, {last}: {means[last]:.2f}",
            holds_if=f"3 lights above 1.3, {last} above 0.85",
            reproduced=means[3] > 1.3 and means[last] > 0.85,
            why=f"true of the mean over all angles; at the best angle it goes on as 1/√n ({last} lights: {ratio:.2f})",
        ),
        _statement(
            claim="the incident angle changes the error more than the number of lights",
            measured=f"largest to smallest Top1: {over_angles:.0f} over the angles, {over_lights:.1f} over the numbers",
            holds_if="more over the angles",
            reproduced=over_angles > over_lights,
            why="the noise falls as 1/√n; a shadow falsifies what it covers however many lights there are",
        ),
    ]


def _regions(result: CoarseResult) -> list[Statement]:
    top1 = result.errors_rad[..., 2]
    blue = _by_object(result, (top1 < np.radians(5)).sum(axis=(1, 2)))
    red = _by_object(result, (top1 > np.radians(30)).sum(axis=(1, 2)))
    return [
        _statement(
            claim="SCROWN and SINWAVE have a large blue region",
            measured=f"cells under 5°: {_largest(blue, 4, 'SINWAVE')}",
            holds_if="at most three have more than either",
            reproduced=_among_largest(blue, 4, "SCROWN", "SINWAVE"),
            why="those after SCROWN differ by a few cells; which are ahead, " + UNKNOWN_MEASURES,
        ),
        _statement(
            claim="the red region grows with the complexity of the surface, as of the caves and CCONVEX",
            measured=f"cells over 30°: {_largest(red, 3, 'CCONVEX')}",
            holds_if="at most two have more than BALLCAVE or CCONVEX",
            reproduced=_among_largest(red, 3, "BALLCAVE", "CCONVEX"),
            why=CURVED_CONVEX,
        ),
        _statement(
            claim="a simple form with a sharp step, TSTEP, has a large error",
            measured=f"cells under 5°: TSTEP {blue['TSTEP']}, SCROWN {blue['SCROWN']}, SINWAVE {blue['SINWAVE']}",
            holds_if="fewer than both smooth ones",
            reproduced=blue["TSTEP"] < min(blue["SCROWN"], blue["SINWAVE"]),
            why="its walls are steeper, so they lie in shadow at smaller angles; how steep, " + UNKNOWN_MEASURES,
        ),
    ]


def _low_frequency(result: CoarseResult) -> Statement:
    floor = _by_object(result, np.degrees(result.errors_rad[:, result.row(CHOSEN_NUMBER), :, 2].min(axis=1)))
    return _statement(
        claim="the low-frequency sphere under BSWAVE hardly matters beside SINWAVE",
        measured=f"Top1 at the best angle {floor['BSWAVE']:.2f}° and {floor['SINWAVE']:.2f}°",
        holds_if="within a quarter",
        reproduced=abs(floor["BSWAVE"] / floor["SINWAVE"] - 1) < 0.25,
        why="the sphere adds slopes of a few degrees to waves of some fifty",
    )


def _steepest_rise(result: CoarseResult) -> Statement:
    top1 = result.errors_rad[:, result.row(CHOSEN_NUMBER), :, 2]
    rise = _by_object(result, top1.max(axis=1) / top1.min(axis=1))
    return _statement(
        claim="CCONVEX and QUCAVE degrade most with the angle",
        measured=f"largest to smallest Top1: {_largest(rise, 3, 'CCONVEX')}",
        holds_if="at most two rise more than either",
        reproduced=_among_largest(rise, 3, *STEEPEST),
        why=f"{CURVED_CONVEX}; a Top1 exceeds the steepest slope only where no light reaches a hundredth of the "
        "pixels: waves and caves have such pockets, round solids that stand apart hardly",
    )


def _rise_in_degrees(result: CoarseResult) -> Statement:
    top1 = np.degrees(result.errors_rad[:, result.row(CHOSEN_NUMBER), :, 2])
    rise = _by_object(result, np.ptp(top1, axis=1))
    return replace(
        _steepest_rise(result),
        measured=f"largest less smallest Top1, degrees: {_largest(rise, 3, 'CCONVEX')}",
        reproduced=_among_largest(rise, 3, *STEEPEST),
    )


def _by_object(result: CoarseResult, values: NDArray[np.floating | np.integer]) -> dict[str, float]:
    return dict(zip(result.names, values.tolist(), strict=True))


def _among_largest(values: dict[str, float], count: int, *names: str) -> bool:
    """Return whether `names` are all among the `count` largest values; one that equals the last of them counts."""
    least = sorted(values.values())[-count]
    return all(values.get(name, -np.inf) >= least for name in names)


def _largest(values: dict[str, float], count: int, also: str) -> str:
    """Return the largest values with their names, and that of `also` if it is not one of them."""
    order = sorted(values, key=lambda name: -values[name])
    first = ", ".join(f"{name} {values[name]:.0f}" for name in order[:count])
    return first if also in order[:count] or also not in values else f"{first}; {also} {values[also]:.0f}"
