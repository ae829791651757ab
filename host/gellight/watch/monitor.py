"""The watch itself: it is given a frame now and then, and finds what has changed since the calibration."""

import statistics
import threading
import time
from collections import deque
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.status import WatchStatus
from gellight.watch.cells import Cells, cell_means, spread
from gellight.watch.expected import ErrorEstimate, ExpectedError
from gellight.watch.explanation import Explanation, explain
from gellight.watch.findings import (
    WatchFinding,
    advice,
    impossible_depth,
    learnt_elsewhere,
    light_findings,
    never_at_rest,
    no_surface,
    other_unit,
    spot_finding,
    unseen_contact,
)
from gellight.watch.other_unit import UnitCheck
from gellight.watch.rezero import Situation, refusal
from gellight.watch.spots import SpotTracker
from gellight.watch.untouched_model import Mask, UntouchedModel

PERIOD_S = 0.25
"""between two looks; short enough for pauses of half a second between touches"""
JUDGE_S = 1.0
"""between two judgements of what was looked at"""
REST_LOOKS, FEWEST_LOOKS = 12, 6
"""looks at the gel at rest that a judgement is made of"""
REST_MEMORY_S = 30.0  # chosen: older looks may be of another light
NEVER_S = 120.0
"""without a single look at the gel at rest since the start is a finding"""
FREE_CELLS = 2
"""number of cells that may be outliers by chance"""
JUMP_GREY = 0.5
"""a look at rest that is farther than that from those before it begins anew"""
UNSEEN_GREY_S, MOST_UNSEEN_S = 0.25, 10.0
"""as fast may the light drift while nobody looks, because the processor is busy or a new zero is made; the longest such
time that counts"""
NOISE_LOOKS = 20  # chosen: the quietest of so many is the noise: touches that change are louder
MOST_NOISE = 2.0
"""times the noise of the bundle; what is louder than that counts as touched"""
UNIT_LOOKS = (3, 9)
"""looks at which the unit is compared with that of the bundle; both have to find another one"""
ESTIMATE_GREY = 0.3
"""rms by which the change must have changed for another estimate of its cost"""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Judgement:
    """What the looks at rest add up to."""

    time_s: float
    change: Cells
    """(h, w, 3) mean of the looks"""
    fitted: Cells
    """(h, w, 3) what light and place explain of it"""
    explanation: Explanation


@dataclass(frozen=True, kw_only=True, eq=False)
class Zero:
    """A new zero: what light and place have changed, and the reference image with it."""

    cells: Cells
    reference: NDArray[np.float32]
    """(H, W, 3) RGB, grey levels"""
    time_s: float


class SensorWatch:
    """Compares frames with the bundle they are reconstructed by; one thread feeds it, any may read `status`."""

    def __init__(self, bundle: Bundle, *, rezero: bool = True, thickness_mm: float | None = None) -> None:
        """Learn what the untouched sensor looks like.

        rezero: whether the zero follows slow drift by itself. thickness_mm: of the gel; None where nobody knows.
        """
        self.bundle = bundle
        self.rezero = rezero
        self.paused = False
        """whether frames are ignored, because a calibration sets the light"""
        self._model = UntouchedModel(bundle)
        self._spots = SpotTracker(self._model.reference.shape[:2])
        self._estimate: ErrorEstimate | None = None
        self._estimated: tuple[Cells, Cells] | None = None
        self._expected: ExpectedError | None = None
        self._rest: deque[tuple[float, Cells]] = deque(maxlen=REST_LOOKS)
        self._noises: deque[float] = deque([self._model.noise_grey], maxlen=NOISE_LOOKS)
        self._last: Cells | None = None
        self._begun_s = 0.0
        self._judgement: _Judgement | None = None
        self._touched = False
        self._state = "starting"
        self._findings: list[WatchFinding] = []
        self._thickness_mm = thickness_mm
        self._of_bundle = learnt_elsewhere(self.bundle)
        self._of_frame: list[WatchFinding] = []
        """of the latest frame"""
        self._unit_check: UnitCheck | None = None
        self._other_units: list[WatchFinding] = []
        """what the comparisons of the unit have found"""
        self._suspected: set[tuple[str, object]] = set()
        self._lock = threading.Lock()
        self._zero = np.zeros_like(self._model.reference)
        self._zero_s: float | None = None
        self._zeros = 0
        self._sudden_grey = 0.0
        self._looked_s, self._unseen_s = inf, 0.0
        """time of the latest look; how long nobody looked since the latest judgement"""
        self._looks = 0
        self._costs_s: deque[float] = deque(maxlen=100)

    def note(self, frame: TactileFrame) -> None:
        """Look at a frame; a few milliseconds at most, but for some tenths of a second when an error is estimated."""
        begun_s = time.perf_counter()
        camera_frame = frame.camera_frame
        if self.paused or self._under_other_light(camera_frame):
            self._state = "paused" if self.paused else "other light"
            self._rest.clear()
            self._of_frame = []
            return
        deep = impossible_depth(frame, self._thickness_mm)
        self._of_frame = [*deep, *no_surface(frame, self.bundle.pixel_size_mm), *unseen_contact(frame)]
        with self._lock:
            self._look(cell_means(camera_frame.image) - self._model.reference, camera_frame.time_s)
        self._looks += 1
        if self._looks in UNIT_LOOKS:
            self._compare_units(camera_frame)
        self._costs_s.append(time.perf_counter() - begun_s)

    def _compare_units(self, frame: CameraFrame) -> None:
        """Note whether a frame is of another unit than the bundle."""
        self._unit_check = self._unit_check or UnitCheck(self.bundle)
        figures = self._unit_check.figures(frame.image)
        if figures.reason:
            self._estimate = self._estimate or ErrorEstimate(self.bundle)
            change = cell_means(frame.image) - self._model.reference
            felt_deg = self._estimate.of(change, self._model.reference, self._zero).zero_deg
            self._other_units.append(other_unit(figures, felt_deg))
        if self._looks == UNIT_LOOKS[-1]:
            self._unit_check = None

    def _under_other_light(self, frame: CameraFrame) -> bool:
        """Whether the ring was set to other colours than when the sensor was calibrated."""
        if frame.label is not None:
            return True
        calibrated = self.bundle.colours
        return calibrated is not None and frame.light is not None and not np.array_equal(frame.light, calibrated)

    def _look(self, change: Cells, time_s: float) -> None:
        if self._last is None:
            self._begun_s = time_s
        else:
            # The median over the cells sees noise and flicker, and no touch that covers less than half of the view.
            self._noises.append(1.05 * float(np.median(np.abs(change - self._last))))
        self._last = change
        self._unseen_s += max(time_s - self._looked_s - 2 * PERIOD_S, 0.0)
        self._looked_s = time_s
        found = self._model.judge(change, noise_grey=self._noise_grey)
        known = self._spots.around
        self._spots.note(found.outliers, time_s)
        if (self._spots.around & ~known).any():
            self._rest.clear()  # what was seen before the spot would water down what is seen of it
        self._touched = bool((found.outliers & ~self._spots.around).sum() > FREE_CELLS)
        self._state = "touched" if self._touched else "at rest"
        while self._rest and time_s - self._rest[0][0] > REST_MEMORY_S:
            self._rest.popleft()
        if not self._touched:
            if self._rest and _rms(change - self._rest[-1][1], ~found.outliers) > JUMP_GREY + 2 * self._noise_grey:
                self._rest.clear()
            self._rest.append((time_s, change))
        if len(self._rest) >= FEWEST_LOOKS and (self._judgement is None or time_s - self._judgement.time_s >= JUDGE_S):
            self._judge(time_s, ~self._spots.around)
        if self._judgement is None and time_s - self._begun_s >= NEVER_S:
            self._findings = [never_at_rest(time_s - self._begun_s)]

    @property
    def _noise_grey(self) -> float:
        # The quietest of the recent pairs: whatever moves all over the view must not pass for noise.
        least, most = self._model.noise_grey, MOST_NOISE * self._model.noise_grey
        return min(max(least, min(self._noises)), most)

    def _judge(self, time_s: float, kept: Mask) -> None:
        change: Cells = np.stack([look for _, look in self._rest]).mean(axis=0, dtype=np.float32)
        noise = self._noise_grey / np.sqrt(len(self._rest))
        judgement = _Judgement(
            time_s=time_s,
            change=change,
            fitted=self._model.judge(change, noise_grey=self._noise_grey).fitted,
            explanation=explain(self._model, change, kept, noise_grey=float(noise)),
        )
        before = self._judgement.change if self._judgement else np.zeros_like(change)
        unseen_grey = UNSEEN_GREY_S * min(self._unseen_s, MOST_UNSEEN_S)
        self._sudden_grey = max(self._sudden_grey, _rms(change - before, kept) - unseen_grey)
        self._judgement, self._unseen_s = judgement, 0.0
        self._report(judgement)

    def _report(self, judgement: _Judgement) -> None:
        """Report what two judgements in a row have found."""
        found = list(light_findings(judgement.explanation, self.bundle.pixel_size_mm, self.bundle.manifest.rest_grey))
        for spot in self._spots.spots(judgement.change - judgement.fitted, self._model.reference):
            found.append(spot_finding(spot, self.bundle.image_shape, self.bundle.pixel_size_mm))
        if found:
            found += advice(self._cost(judgement.fitted))
        else:
            self._expected = self._estimated = None
        keys = {finding.key for finding in found}
        self._findings = [finding for finding in found if finding.key in self._suspected]
        self._suspected = keys

    def _cost(self, fitted: Cells) -> ExpectedError:
        known = self._estimated
        everywhere = np.ones(fitted.shape[:2], np.bool_)
        if self._expected and known and known[1] is self._zero and _rms(fitted - known[0], everywhere) < ESTIMATE_GREY:
            return self._expected
        self._estimate = self._estimate or ErrorEstimate(self.bundle)
        self._expected = self._estimate.of(fitted, self._model.reference, self._zero)
        self._estimated = fitted, self._zero
        return self._expected

    def refusal(self, *, asked: bool) -> str:
        """Return why the zero must not be set now, empty if it may; `asked` as in `rezero.refusal`."""
        with self._lock:
            if not asked and not self.rezero:
                return "the zero is set only when asked (watch.rezero)"
            if self._of_another_unit:
                return self._of_another_unit[0].text
            return refusal(self._situation(), asked=asked)

    def _situation(self) -> Situation:
        judgement = self._judgement
        newest_s = self._rest[-1][0] if self._rest else -np.inf
        fresh = judgement is not None and judgement.time_s >= newest_s - JUDGE_S and len(self._rest) >= FEWEST_LOOKS
        since = judgement.fitted - self._zero if judgement else np.zeros_like(self._zero)
        return Situation(
            touched=self._touched or not fresh or bool(self._spots.lasting.any()),
            explanation=judgement.explanation if judgement else None,
            since_zero_grey=_rms(since, np.ones(since.shape[:2], np.bool_)),
            sudden_grey=self._sudden_grey,
            since_zero_s=newest_s - self._zero_s if self._zero_s is not None else np.inf,
            rest_grey=self.bundle.manifest.rest_grey,
        )

    def propose_zero(self, *, asked: bool) -> Zero:
        """Return the zero that fits the light now; InputError, saying why, where it must not be set."""
        reason = self.refusal(asked=asked)
        if reason:
            raise InputError(f"the zero was not set: {reason}")
        with self._lock:
            assert self._judgement is not None
            cells, time_s = self._judgement.fitted, self._judgement.time_s
        reference = np.clip(self.bundle.reference + spread(cells, self.bundle.image_shape), 0, 255)
        return Zero(cells=cells, reference=reference, time_s=time_s)

    def accept_zero(self, zero: Zero) -> None:
        """Take note that frames are reconstructed with this zero from now on."""
        with self._lock:
            self._zero, self._zero_s = zero.cells, zero.time_s
            self._zeros += 1
            self._sudden_grey = 0.0

    def findings(self) -> list[WatchFinding]:
        """Return what two judgements in a row have found, and a depth that cannot be at once.

        Empty while the sensor is as it was calibrated.
        """
        return [*self._of_bundle, *self._of_frame, *self._of_another_unit, *self._findings]

    @property
    def _of_another_unit(self) -> list[WatchFinding]:
        return self._other_units[-1:] if len(self._other_units) == len(UNIT_LOOKS) else []

    def status(self) -> WatchStatus:
        """Return all of it: state, findings, expected errors, the zero, what it costs."""
        judgement, expected = self._judgement, self._expected
        return {
            "state": self._state,
            "looks": self._looks,
            "findings": [finding.as_json() for finding in self.findings()],
            "expected": expected.as_json() if expected else None,
            "change_grey": round(judgement.explanation.size_grey, 3) if judgement else None,
            "gains": [round(gain, 4) for gain in judgement.explanation.gains] if judgement else None,
            "zeros": self._zeros,
            "look_ms": round(statistics.median(self._costs_s) * 1e3, 2) if self._costs_s else None,
        }


def _rms(change: Cells, kept: Mask) -> float:
    return float(np.sqrt((change[kept] ** 2).mean())) if kept.any() else 0.0
