"""When the zero of the depth may follow the light: never in contact, never far, never suddenly.

Only the change that light and place explain goes into the new reference image, and that is smooth and without noise; so
even a touch that nobody noticed would not be absorbed. Beyond that the zero is set anew only

- while no cell of the view shows anything that light cannot do;
- up to a bound, counted from the reference image of the calibration and not from the last zero;
- for a change that came slowly: a sudden one is reported as a finding, and the zero does not follow it.
"""

from dataclasses import dataclass

from gellight.watch.explanation import Explanation

WORTH_GREY = 0.1
"""rms of a change since the last zero that is worth a new one: some 0.01 mm on the simulated sensor, and three times
the noise that is left in the mean of the looks"""
MOST_GAIN = 0.15
"""every channel stays within this share of the reference image"""
MOST_LEFT_GREY = 0.5
"""rms that neither light nor place explain"""
SUDDEN_GREY = 1.0
"""rms of a change from one look at the gel at rest to the next"""
PERIOD_S = 10.0
"""between two zeros"""


@dataclass(frozen=True, kw_only=True)
class Situation:
    """What decides whether the zero may be set now."""

    touched: bool
    """whether any cell shows what light cannot do, or no frame at rest was seen of late"""
    explanation: Explanation | None
    """of the whole change since the calibration; None before the first frames at rest"""
    since_zero_grey: float
    """rms of the change since the last zero"""
    sudden_grey: float
    """largest rms of a change from one look at the gel at rest to the next, since the last zero"""
    since_zero_s: float
    rest_grey: float = 0.0
    """what the gel at rest differs from its reference by in any case, rms: nobody has to understand that"""


def refusal(situation: Situation, *, asked: bool) -> str:
    """Return why the zero must not be set now, with the remedy; empty if it may.

    asked: a person asks for it and says that nothing touches, so a change may have come at once and be small.
    """
    explanation = situation.explanation
    if explanation is None:
        return "the gel has not been seen at rest long enough: lift everything off it and wait two seconds"
    if situation.touched:
        return "something touches the gel: lift everything off it"
    worst = max(abs(gain - 1) for gain in explanation.gains)
    if worst > MOST_GAIN:
        return f"the light has changed by {worst:.0%}, more than {MOST_GAIN:.0%}: calibrate the sensor again"
    if explanation.pressed_mm:
        return (
            f"the picture changed as if something flat pressed the whole gel, up to {explanation.pressed_mm:.2f} mm: "
            "lift everything off it; if nothing is on it, the gel or the camera has moved: calibrate the sensor again"
        )
    if explanation.leaves(MOST_LEFT_GREY, situation.rest_grey):
        return (
            f"{explanation.left_grey:.1f} grey levels of the change are not understood: clean the sensor, see that its "
            "camera and its ring are tight, then calibrate it again"
        )
    if asked:
        return ""
    if situation.since_zero_grey < WORTH_GREY:
        return "the zero is right"
    if situation.since_zero_s < PERIOD_S:
        return f"the zero was set {situation.since_zero_s:.0f} s ago"
    if situation.sudden_grey > SUDDEN_GREY:
        return f"the picture changed by {situation.sudden_grey:.1f} grey levels at once: that is no drift"
    return ""
