"""Labels that the other presses and their own picture contradict.

On a ball the sine of the slope is linear in the place: sin x = (c - p) / R for the pixel p, the centre c and the radius
R. Slopes in a labelled circle come from a polynomial of colour and place in closed form that learnt from all other
presses. A line through them is zero where the others put the centre; where it hardly falls, no ball lies in the circle.
The worst is taken out of the others, and so on, so that wrong labels do not vouch for each other.

The circle that the picture shows by itself is the second witness. It is looked for where the others object alone, for
that takes a second. From ten presses on a picture that shows no clear ball does not excuse its label.
"""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.lab.training.child import Check, go_on
from gellight.lab.training.labelling.circle import ARC, PressCircle, find_circle
from gellight.lab.training.labelling.pattern import LEAST_QUALITY
from gellight.lab.training.labelling.refinement import shown_circle
from gellight.lab.training.polynomial import powers_up_to, terms_of
from gellight.lab.training.presses import Ball, Floats, Press, distance_px
from gellight.lab.training.table import drift_of_presses
from gellight.lab.training.training import Reference
from gellight.reconstruction.light_drift import difference_of

Array = NDArray[np.float64]
CONTRADICTED = "contradicted_labels"
"""in the metrics"""
BESIDE, SEEN_BESIDE = 0.2, 0.15
"""of the contact radius: the others put the centre farther from that of the label, and so does its picture. Right
labels of real sensors are off by up to 0.20 by the others, those moved by 0.3 radii by 0.26 and more"""
FLAT = 0.4
"""of the ball's curvature: less than that is no ball"""
MANY = 10
"""presses: fewer do not contradict a label without its picture"""
MOST = 1 / 3
"""of the presses: where more are contradicted, all labels may be wrong"""
_LEAST_LEFT = 3
"""presses: of two nobody knows which is wrong"""
_DARKEST = 20.0
"""grey levels below which a ratio says nothing"""
_GREY = 60.0  # chosen: the change of a press is then about 1, as the place is
_COLOUR_DEGREE = 3  # chosen: as of live_error.py of the calibration
_POWERS = [  # of three colours, and of the place linearly at most
    powers
    for powers in powers_up_to(_COLOUR_DEGREE + 1, 5)
    if 1 <= sum(powers[:3]) <= _COLOUR_DEGREE and sum(powers[3:]) <= 1
]
_PENALTY = np.array([1e-3 + 0.1 * sum(powers[3:]) for powers in _POWERS])
"""relative to the squares of all presses: a few do not tell how colours change over the view"""
_LEAST_PIXELS = 8  # chosen: a smaller contact accuses nobody
_SIDE, _WITHIN = 25, 0.9
"""pixels along the diameter of a contact that are looked at; of its radius"""


@dataclass(frozen=True, kw_only=True)
class WrongLabel:
    """A press whose label is contradicted, and by what."""

    press: Press
    why: str


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """Pixels inside the circle of one press, and what they say of the response of the light."""

    terms: Array
    """(n, K)"""
    sines: Array
    """(n, 2) by the label"""
    square: Array
    """(K, K)"""
    product: Array
    """(K, 2)"""


def sorted_out(
    presses: Sequence[Press], reference: Reference, ball: Ball, *, keep: bool = False, check: Check = go_on
) -> tuple[list[Press], dict[str, object]]:
    """Return the presses that are learnt from, and for the metrics which ones are contradicted.

    keep: all are learnt from. So they are where over a third is contradicted: then nobody knows which are right.
    """
    wrong = wrong_labels(presses, reference, ball, check=check)
    keep = keep or len(wrong) > MOST * len(presses)
    accused = set() if keep else {one.press for one in wrong}
    told = [{"image": one.press.image.name, "why": one.why, "kept": keep} for one in wrong]
    return [press for press in presses if press not in accused], {CONTRADICTED: told} if told else {}


def contradicted_lines(metrics: Mapping[str, Any]) -> list[str]:
    """Return for people which labels are contradicted, by what `sorted_out` told."""
    return [
        f"{'WRONG LABEL' if one['kept'] else 'LEFT OUT'}: {one['image']}: {one['why']}: correct its label"
        + ("" if one["kept"] else ", or learn from it all the same (`fit --keep`)")
        for one in metrics.get(CONTRADICTED, [])
    ]


def wrong_labels(
    presses: Sequence[Press], reference: Reference, ball: Ball, *, check: Check = go_on
) -> list[WrongLabel]:
    """Return the presses whose circles are contradicted, the worst first; two presses or fewer accuse nobody.

    Raises InputError for pictures in another light than can be followed.
    """
    if len(presses) < _LEAST_LEFT:
        return []
    image = reference.image
    follow = drift_of_presses(presses, image) > reference.noise_grey
    gain = np.maximum(image, _DARKEST).astype(np.float64)
    gain /= gain.mean()
    seen = [_seen(press, image, gain, ball, follow) for press in presses]
    trusted, excused, wrong = set(range(len(presses))), set[int](), list[WrongLabel]()
    while len(trusted) >= _LEAST_LEFT and len(wrong) <= MOST * len(presses):
        check()
        off = {number: _beside(number, seen, trusted, ball) for number in trusted - excused}
        worst = max(off, key=lambda number: off[number] / presses[number].contact_radius_px, default=None)
        if worst is None or off[worst] <= BESIDE * presses[worst].contact_radius_px:
            break
        found = _witness(presses[worst], presses, image, ball)
        if why := _contradicted(presses[worst], off[worst], found, many=len(presses) >= MANY):
            wrong.append(WrongLabel(press=presses[worst], why=why))
            trusted.remove(worst)
        else:
            excused.add(worst)
    return wrong


def _seen(press: Press, reference: Floats, gain: Array, ball: Ball, follow_light: bool) -> _Seen:
    """Look at some pixels inside a circle; of a circle that shows too few, none."""
    change = difference_of(press.picture(), reference, follow_light=follow_light)
    height, width = change.shape[0], change.shape[1]
    step = max(1, round(2 * press.contact_radius_px / _SIDE))
    inside = distance_px(press, (height, width))[::step, ::step] < _WITHIN * press.contact_radius_px
    if (hidden := press.hidden()) is not None:
        inside &= ~hidden[::step, ::step]
    rows, columns = (step * index for index in np.nonzero(inside))
    colours = (change[rows, columns] / gain[rows, columns]) / _GREY
    terms = terms_of([*colours.T, 2 * columns / width - 1, 2 * rows / height - 1], _POWERS)
    sines = np.stack([press.center_x_px - columns, press.center_y_px - rows], axis=1) / ball.radius_px
    number = max(len(terms), 1)
    return _Seen(terms=terms, sines=sines, square=terms.T @ terms / number, product=terms.T @ sines / number)


def _beside(number: int, seen: Sequence[_Seen], trusted: AbstractSet[int], ball: Ball) -> float:
    """Return how far beside its label the trusted others put the centre of a press, px; inf where they see no ball."""
    one, others = seen[number], sorted(trusted - {number})
    square = np.sum([seen[other].square for other in others], axis=0)
    product = np.sum([seen[other].product for other in others], axis=0)
    felt = one.terms @ np.linalg.solve(square + np.diag(_PENALTY * np.diag(square) + 1e-12), product)
    if len(felt) < _LEAST_PIXELS:
        return 0.0
    labelled = one.sines - one.sines.mean(axis=0)
    curved = float((felt * labelled).sum() / (labelled**2).sum())
    off = ball.radius_px * float(np.hypot(*(felt - one.sines).mean(axis=0)))
    return off / curved if curved > FLAT else np.inf


def _witness(press: Press, presses: Sequence[Press], reference: Floats, ball: Ball) -> PressCircle | InputError:
    """Return the circle that the picture of a press shows by itself, or why it shows none."""
    try:
        if sum(other.image == press.image for other in presses) == 1:
            return find_circle(press.picture(), reference, ball=ball, least_view=ARC)
        circle = shown_circle(press, reference, ball)
    except InputError as error:
        return error
    if circle.quality < LEAST_QUALITY:
        return InputError(f"the pattern of a ball explains {circle.quality:.0%} of what changed there")
    return circle


def _contradicted(press: Press, off_px: float, found: PressCircle | InputError, *, many: bool) -> str:
    """Return what contradicts the label, by the others and by its picture; nothing where that excuses it."""
    others = f"put the ball {off_px:.0f} px beside its circle" if np.isfinite(off_px) else "see no ball in its circle"
    if isinstance(found, InputError):
        return f"the other presses {others}, and its own picture shows none ({found})" if many else ""
    apart = hypot(found.center_x_px - press.center_x_px, found.center_y_px - press.center_y_px)
    if apart <= SEEN_BESIDE * press.contact_radius_px:
        return ""
    return (
        f"the other presses {others}, and its own picture shows one {found.contact_radius_px:.0f} px in radius around "
        f"({found.center_x_px:.0f}, {found.center_y_px:.0f}) px, {apart:.0f} px from it"
    )
