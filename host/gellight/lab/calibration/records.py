"""What a calibration measures: a record for each step, as it stands in `state.json` and is shown."""

from typing import Any, ClassVar

from pydantic import ConfigDict

from gellight.lab.report.record import Record


class StepPart(Record):
    """A part of what a step measured; what an older version kept beside it is left out."""

    model_config = ConfigDict(extra="ignore")


class StepFigures(StepPart):
    """What one finished step measured."""

    step: ClassVar[str]
    """name of the step, see `display.STEPS`"""


class Uniformity(StepPart):
    """The distribution of one intensity over the view; the paper's sensor: 159.02, 6.67."""

    mean_grey: float
    sigma_grey: float
    brightest_grey: float
    """99th percentile"""


class LedAnswer(Record):
    """What one LED did to the picture."""

    led: int
    colour: str
    """as the ring is built"""
    grey: float
    """mean rise of the brightest channel"""
    seen_colour: str
    azimuth_deg: float
    """from where it shines, anticlockwise from the right"""


class LedCheck(StepPart):
    """Every LED and every light group, lit by itself."""

    leds: tuple[LedAnswer, ...]


class Preparation(StepFigures):
    """Camera and LEDs as they were set, and the light that makes."""

    step = "prepare"
    camera: dict[str, float]
    """controls by name"""
    led: list[list[int]] | None = None
    """(12, 3) levels; None without a ring"""
    lights: LedCheck | None = None
    uniformity: dict[str, Uniformity]
    """of each colour, and of the average of all, by name"""
    advice: str


class WarmUp(Record):
    """How long the light took to become steady, and how far it moved meanwhile."""

    warm_up_frames: int
    warm_up_grey: float
    drift_grey: float
    """between the last two windows"""


class UntouchedGel(StepFigures, WarmUp):
    """The reference image and its noise."""

    step = "reference"
    frames: int
    noise_grey: float
    pixel_noise_grey: float


class PixelSize(StepFigures):
    """The size of a pixel."""

    step = "pixel_size"
    x_mm: float
    y_mm: float
    pixel_size_mm: float
    """geometric mean of x and y"""


class MeasuredPixelSize(PixelSize):
    """The size of a pixel by the cylinder; without one the user has given it."""

    presses: int
    diameter_px: float
    spread_px: float
    x_spread_mm: float
    y_spread_mm: float


class Coverage(Record):
    """Counts of presses by place, and of pixels by slope; see `coverage`."""

    places: list[list[int]]
    """rows of presses that reached each part of the view"""
    slopes: list[list[int]]
    """labelled pixels by direction, and by band of steepness"""
    steepness_deg: tuple[float, ...]
    """where the bands begin and end"""
    steepest_deg: float


class BallPresses(StepFigures):
    """The ball presses to train on."""

    step = "presses"
    presses: int
    refused: int
    coverage: Coverage
    held_out: tuple[tuple[int, float], ...]
    """(presses, normal error in degrees of each press by all others), as the presses came in"""
    held_out_um: float | None = None
    """error of the depth beside its contact's mean, likewise, at the last one; None in records of before"""


class Fit(StepFigures):
    """The metrics of the draft, and the loss after each epoch; more than is shown is kept for the bundle."""

    model_config = ConfigDict(extra="allow")

    step = "fit"
    training: dict[str, Any]
    held_out: dict[str, Any] | None = None
    """None in a calibration that was begun by an older version"""
    losses: tuple[float, ...]


class CheckErrors(StepPart):
    """What one fresh press says of the calibration inside its contact circle, or the means over several."""

    depth_mm: float
    """mean absolute depth error after the mean error of each press was taken off: a contact circle does not say how
    deep its rim lies"""
    normal_deg: float
    """mean angle between the normals felt and those of the ball"""
    indentation_mm: float
    felt_over_expected: float | None = None
    """how deep the ball is felt, over how deep by contact mechanics; None where nobody told how thick the gel is"""
    true_depth_mm: float | None = None
    """mean absolute depth error against a simulator's truth, nothing taken off; None on a real sensor"""
    true_normal_deg: float | None = None
    """against the same truth, over the whole map"""

    @property
    def known_depth_mm(self) -> float:
        """The depth error with nothing taken off, where a simulator knows it; else the same as `depth_mm`."""
        return self.depth_mm if self.true_depth_mm is None else self.true_depth_mm


class Verification(StepFigures, CheckErrors):
    """The mean errors over the fresh ball presses."""

    step = "verify"
    presses: int


class Verdict(Record):
    """Whether the calibration is good enough, and why."""

    passed: bool
    depth_um: float
    """`CheckErrors.known_depth_mm`"""
    normal_deg: float
    text: str


class Circle(Record):
    """A contact circle in the picture."""

    model_config = ConfigDict(allow_inf_nan=False)

    center_x_px: float
    center_y_px: float
    contact_radius_px: float


class ShownCircle(Circle):
    """The circle of the last press, as it is shown."""

    number: int | None = None
    state: str
    """measured, taken, corrected or checked"""

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return (
            f"centre and radius {self.center_x_px:.1f}, {self.center_y_px:.1f}, {self.contact_radius_px:.1f} px "
            f"({self.state})"
        )
