"""What presses objects into a simulated gel: a visitor, or a programme while nobody else does."""

import itertools
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import hypot

import numpy as np

from gellight.base.errors import InputError
from gellight.frames.status import PressStatus
from gellight.lab.simulator.objects import check_name
from gellight.lab.simulator.scene import Press
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import OBJECT_NAMES
from sim_reference.view import seen_height_mm

RETURN_FRAMES = 300
"""after a visitor's last touch until the programme goes on"""
MOST_TURN_RAD = 0.35
"""of a drag: the pressure is not turned with the object"""
PROGRAMME = (  # chosen: what the virtual hand of `gellight demo` presses in turn
    Press("BALL", 1.0, 0.0, 0.0),
    Press("BALL", 1.5, -9.0, 4.0),
    Press("TSTEP", 0.8, 0.0, 0.0),
    Press("BALL", 0.7, 10.0, -5.0),
    Press("SINWAVE", 0.9, 0.0, 0.0),
    Press("CCONVEX", 0.9, 0.0, 0.0),
)


def moving_peg() -> tuple[Press, ...]:
    """Return a peg that slides, turns and tilts, there and back."""
    s = np.linspace(0, 1, 20)
    ways = 1.5 * np.sin(2 * np.pi * s), 1.5 * s, np.radians(2 * np.sin(2 * np.pi * s)), np.radians(12 * s)
    there = [
        Press("PEG", 0.8, x, y, turn_rad=(tilt, 0.0, turn)) for x, y, tilt, turn in np.stack(ways, axis=1).tolist()
    ]
    return (*there, *there[-2:0:-1])


MOVING = moving_peg()
"""what moves by itself while a page tracks"""


def programme_of_presses() -> Iterator[Press | None]:
    """Yield what a virtual hand does in each frame, for ever: press in, hold, release, pause."""
    for press in itertools.cycle(PROGRAMME):
        ramp = _ramp(press)
        yield from (step for step in ramp for _ in range(2))
        yield from itertools.repeat(press, 90)
        yield from (step for step in reversed(ramp[:-1]) for _ in range(2))
        yield from itertools.repeat(None, 15)


def _ramp(press: Press) -> list[Press]:
    """Return the press at a fifth of its depth, two fifths and so on."""
    return [replace(press, depth_mm=round(float(press.depth_mm * step), 3)) for step in np.linspace(0, 1, 6)[1:]]


class Stage:
    """Presses objects into the gel, on behalf of a visitor or of the programme."""

    objects: tuple[str, ...] = OBJECT_NAMES

    def __init__(self, geometry: SensorGeometry, *, programme: bool = True) -> None:
        """Start with nothing in the gel; `programme` lets the virtual hand play while no visitor presses."""
        self._geometry = geometry
        self._lock = threading.Lock()
        self._wanted: Press | None = None
        self._programme = programme_of_presses() if programme else None
        self._sequence: Iterator[Press | None] | None = None
        """what is shown a frame each; a visitor takes it over"""
        self._frames_until_programme = 0
        self._preparing: list[str] = []
        """objects whose press is being computed"""
        self.prepare_ahead: Callable[[Press], None] = lambda press: None
        """what computes a press, once there is a scene"""

    @property
    def max_depth_mm(self) -> float:
        """Deepest press offered: the elastic layer is a small-strain model."""
        return 0.4 * self._geometry.gel_thickness_mm

    @property
    def gel_thickness_mm(self) -> float:
        """Thickness of the simulated gel."""
        return self._geometry.gel_thickness_mm

    @property
    def camera_height_mm(self) -> float:
        """How high the camera seems to stand: see `PressStage`."""
        return seen_height_mm(self._geometry)

    @property
    def window_mm(self) -> float:
        """Thickness of what bends light: see `PressStage`."""
        return self._geometry.window_mm if self._geometry.window else 0.0

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press `object_name` `depth_mm` into the gel at (x, y) from the image centre, until told otherwise.

        Raises InputError for an unknown object, a depth outside 0..max_depth_mm, or a place off the gel.
        """
        self._want(self._checked(object_name, depth_mm, x_mm, y_mm))

    def _checked(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> Press | None:
        """Return the press, None for one that does not touch; InputError for one that cannot be."""
        try:
            check_name(object_name)
        except ValueError as error:
            raise InputError(str(error)) from error
        if not 0 <= depth_mm <= self.max_depth_mm:
            raise InputError(f"press depth {depth_mm} mm: choose 0 to {self.max_depth_mm:g} mm")
        self._check_place(x_mm, y_mm)
        return Press(object_name, round(depth_mm, 3), x_mm, y_mm) if depth_mm > 0 else None

    def _check_place(self, x_mm: float, y_mm: float) -> None:
        radius_mm = self._geometry.gel_diameter_mm / 2
        if not hypot(x_mm, y_mm) <= radius_mm:
            raise InputError(
                f"a press at ({x_mm}, {y_mm}) mm is off the gel: stay within {radius_mm:g} mm of the centre"
            )

    def prepare(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Compute a press, which takes up to some seconds, while frames go on. Raises as `press` does."""
        press = self._checked(object_name, depth_mm, x_mm, y_mm)
        if press is not None:
            with self.computing(press):
                self.prepare_ahead(press)

    @contextmanager
    def computing(self, press: Press) -> Iterator[None]:
        """Say in the status that a press is computed."""
        self._preparing.append(press.object_name)
        try:
            yield
        finally:
            self._preparing.remove(press.object_name)

    def hold(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        """Press for good: no programme plays afterwards. Raises as `press` does."""
        self.press(object_name, depth_mm, x_mm, y_mm)
        self._programme = None

    def play(self, presses: Sequence[Press | None]) -> None:
        """Show a sequence of presses, a frame each, forwards and back for ever; no programme plays afterwards."""
        there_and_back = [*presses, *presses[-2:0:-1]]
        self._sequence, self._programme = itertools.cycle(there_and_back), None

    def drive(self, *, on: bool) -> None:
        """Let a peg slide, turn and tilt by itself, there and back; or lift it. A visitor's press ends it too."""
        self._sequence = itertools.cycle(MOVING) if on else None
        self._want(None)
        self._frames_until_programme = 0 if on else RETURN_FRAMES

    def drag(self, x_mm: float, y_mm: float, turn_rad: float = 0.0) -> None:
        """Move what is pressed straight to (x, y) from where it was pressed, turned from x towards y.

        Raises InputError where nothing is pressed, and for a place off the gel or a turn beyond `MOST_TURN_RAD`.
        """
        with self._lock:
            press = self._wanted
        if press is None:
            raise InputError("nothing is pressed that could be dragged: press an object first")
        if not abs(turn_rad) <= MOST_TURN_RAD:
            raise InputError(f"a turn of {turn_rad} rad: choose up to {MOST_TURN_RAD:g} either way")
        self._check_place(press.x_mm + x_mm, press.y_mm + y_mm)
        self._want(replace(press, path=(*press.path, (float(x_mm), float(y_mm), float(turn_rad)))))

    def release(self) -> None:
        """Lift the object off the gel."""
        self._want(None)

    def take_over(self) -> None:
        """Lift the object; no programme plays afterwards."""
        self._want(None)
        self._programme = self._sequence = None

    def status(self) -> PressStatus:
        """Return what is pressed now."""
        with self._lock:
            press, visitor = self._wanted, self._frames_until_programme > 0
        shown = press or Press("", 0.0)
        x_mm, y_mm, _ = shown.place
        return {
            "object": shown.object_name, "depth_mm": shown.depth_mm, "x_mm": x_mm, "y_mm": y_mm,
            "visitor": visitor, "preparing": next(iter(self._preparing), ""),
        }  # fmt: skip

    def next_press(self) -> Press | None:
        """Return what is in the gel during the next frame."""
        with self._lock:
            if self._frames_until_programme > 0:
                self._frames_until_programme -= self._wanted is None
            elif self._sequence is not None:
                self._wanted = next(self._sequence)
            elif self._programme is not None:
                self._wanted = next(self._programme)
            return self._wanted

    @property
    def plays(self) -> bool:
        """Whether the programme presses, and not a visitor."""
        return self._programme is not None and self._frames_until_programme == 0

    def _want(self, press: Press | None) -> None:
        with self._lock:
            self._wanted = press
            self._frames_until_programme = RETURN_FRAMES
