"""What may be asked of a running sensor, by its page, other programs and this one: each call is declared once, here.

A call is JSON such as {"type": "press", "object": "BALL", "depth_mm": 0.8, "x_mm": 0, "y_mm": 0}. The answer is JSON
too, but for `calibration`, whose answer is the content of a `.gelcal` file. `Commands` carries them out.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, JsonValue, TypeAdapter

from gellight.base.allowed import Byte, StrictModel, explained
from gellight.base.errors import InputError
from gellight.base.leds import MOST_LEDS
from gellight.bundle.bundle import packed_bundle

if TYPE_CHECKING:
    from gellight.daemon.calibration_service import CalibrationService
    from gellight.daemon.session import SensorSession
    from gellight.frames.camera import PressStage

MOST_CALL = 65536
"""bytes of a call"""


class Scanning(Protocol):
    """What carries out a scan by hand."""

    def begin(self, name: str) -> None:
        """Go on with the scan of this name, or begin one."""

    def take_back(self) -> None:
        """Take the last press back."""

    def end(self) -> None:
        """End the scan; what was pressed is kept."""


class Commands:
    """A running sensor as those see it who ask for something; safe to use from any thread."""

    def __init__(
        self, sensor: SensorSession, calibration: CalibrationService | None = None, scan: Scanning | None = None
    ) -> None:
        """Carry out calls at `sensor`; those of a calibration or a scan are refused where there is none."""
        self.sensor, self._calibration, self._scan = sensor, calibration, scan
        self._newest: Call | None = None
        """the last one that moves what is in the gel: an older press that is still computed is dropped"""

    def take(self, call: Call) -> Callable[[], bytes]:
        """Return what carries out `call` and returns the answer; it raises what the sensor raises."""
        if isinstance(call, _Move):
            self._newest = call
        return lambda: self._carried_out(call)

    def _carried_out(self, call: Call) -> bytes:
        said = call._do(self)
        return json.dumps({"time_s": commanded_s(self.sensor)}).encode() if said is None else said

    def is_newest(self, call: Call) -> bool:
        """Whether what is in the gel was not to be moved otherwise since `call`."""
        return call is self._newest

    @property
    def stage(self) -> PressStage:
        """What presses into a simulated gel; InputError where the gel is real, or while a calibration presses."""
        if self.sensor.stage is None:
            raise InputError("objects can be pressed into a simulated gel only (sim://)")
        if self.sensor.calibrating:
            raise InputError("a calibration is running, and only its own presses may touch the gel: stop it first")
        return self.sensor.stage

    @property
    def calibration(self) -> CalibrationService:
        """The calibration beside the stream; InputError where there is none."""
        if self._calibration is None:
            raise InputError("no calibration can be asked for here: use the page of `gellight run`")
        return self._calibration

    @property
    def scan(self) -> Scanning:
        """The scan beside the stream; InputError where there is none."""
        if self._scan is None:
            raise InputError("no scan can be asked for here: use the page of `gellight run`")
        return self._scan


class Call(StrictModel):
    """What is asked for."""

    reads: ClassVar[bool] = False
    """whether it changes nothing: every program may ask for it"""
    answer_type: ClassVar[str] = "application/json"

    def _do(self, at: Commands) -> bytes | None:
        """Do it, and return the answer; None: nothing but that it is done."""
        raise NotImplementedError


class Status(Call):
    """What `SensorSession.status` says."""

    type: Literal["status"] = "status"
    reads = True

    def _do(self, at: Commands) -> bytes:
        return json.dumps(at.sensor.status(), default=str).encode()


class Calibration(Call):
    """The bundle in use, with the zero in use."""

    type: Literal["calibration"] = "calibration"
    reads = True
    answer_type = "application/octet-stream"

    def _do(self, at: Commands) -> bytes:
        return packed_bundle(at.sensor.zeroed_bundle)


class Light(Call):
    """Show these colours on the LEDs; None: those of the bundle again."""

    type: Literal["light"] = "light"
    colours: Annotated[list[tuple[Byte, Byte, Byte]], Field(min_length=1, max_length=MOST_LEDS)] | None

    def _do(self, at: Commands) -> None:
        at.sensor.light(None if self.colours is None else np.array(self.colours, np.uint8))


class Mode(Call):
    """Go on in another mode: network or photometric."""

    type: Literal["mode"] = "mode"
    mode: str

    def _do(self, at: Commands) -> None:
        at.sensor.change_mode(self.mode)


class Zero(Call):
    """Set the zero of the depth to the gel as it is now: nothing touches it."""

    type: Literal["zero"] = "zero"

    def _do(self, at: Commands) -> None:
        at.sensor.rezero()


class _Move(Call):
    """What moves an object in a simulated gel."""


class Track(_Move):
    """Give frames the pose of the object that touches, or no more; hand: in a simulated gel one moves by itself."""

    type: Literal["track"] = "track"
    on: bool
    hand: bool = False

    def _do(self, at: Commands) -> None:
        at.sensor.track(self.on)
        if self.hand and at.sensor.stage is not None and not at.sensor.calibrating:
            at.sensor.stage.drive(on=self.on)


class Press(_Move):
    """Press an object into a simulated gel, or move and deepen the press that is there."""

    type: Literal["press"] = "press"
    object: str
    depth_mm: float
    x_mm: float
    y_mm: float

    def _do(self, at: Commands) -> None:
        press = self.object, self.depth_mm, self.x_mm, self.y_mm
        if at.is_newest(self):
            at.stage.prepare(*press)
        if at.is_newest(self):
            at.stage.press(*press)


class Drag(_Move):
    """Move what is pressed into the simulated gel sideways, x, y from where it was pressed, and turn it."""

    type: Literal["drag"] = "drag"
    x_mm: float
    y_mm: float
    turn_rad: float = 0.0

    def _do(self, at: Commands) -> None:
        at.stage.drag(self.x_mm, self.y_mm, self.turn_rad)


class Release(_Move):
    """Lift the object off the simulated gel."""

    type: Literal["release"] = "release"

    def _do(self, at: Commands) -> None:
        at.stage.release()


class Calibrate(Call):
    """Begin a calibration; request: a `CalibrationRequest`."""

    type: Literal["calibrate"] = "calibrate"
    request: dict[str, JsonValue] = Field(default_factory=dict)

    def _do(self, at: Commands) -> None:
        # Here, since a program that subscribes need not load it.
        from gellight.daemon.calibration_service import CalibrationRequest

        at.calibration.begin(made(CalibrationRequest, **self.request))


class Act(Call):
    """Do what the running calibration offers; the circle is in pixels of the camera image."""

    type: Literal["act"] = "act"
    action: Literal["start", "next", "correct", "drop", "accept", "abort"]
    center_x_px: float | None = None
    center_y_px: float | None = None
    contact_radius_px: float | None = Field(default=None, gt=0)

    def _do(self, at: Commands) -> None:
        at.calibration.act(self.action, **self.model_dump(exclude={"type", "action"}, exclude_none=True))


class Restore(Call):
    """Put a stored bundle into service again."""

    type: Literal["restore"] = "restore"
    identity: str = Field(pattern="^[0-9a-f]{1,16}$")

    def _do(self, at: Commands) -> None:
        at.calibration.restore(self.identity)


class ScanBegin(Call):
    """Begin the scan of this name, or go on with it."""

    type: Literal["scan"] = "scan"
    name: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")

    def _do(self, at: Commands) -> None:
        at.scan.begin(self.name)


class ScanUndo(Call):
    """Take the last press of the scan back."""

    type: Literal["scan-undo"] = "scan-undo"

    def _do(self, at: Commands) -> None:
        at.scan.take_back()


class ScanEnd(Call):
    """End the scan."""

    type: Literal["scan-end"] = "scan-end"

    def _do(self, at: Commands) -> None:
        at.scan.end()


AnyCall = (
    Status | Calibration | Light | Mode | Zero | Track | Press | Drag | Release
    | Calibrate | Act | Restore | ScanBegin | ScanUndo | ScanEnd
)  # fmt: skip
_CALLS: TypeAdapter[AnyCall] = TypeAdapter(Annotated[AnyCall, Field(discriminator="type")])
Made = TypeVar("Made", bound=StrictModel)


def read_call(content: bytes) -> AnyCall:
    """Return the call of a message; InputError says what is wrong with it."""
    with explained(lambda wrong: InputError(f"no call of GelLight: {wrong}")):
        return _CALLS.validate_json(content)


def read_json(kind: type[Made], content: str | bytes) -> Made:
    """Return what a message says; InputError says what is wrong with it."""
    with explained():
        return kind.model_validate_json(content)


def made(kind: type[Made], **values: object) -> Made:
    """Return a call with these values; InputError says what is wrong with them."""
    with explained():
        return kind.model_validate(values)


def light_of(colours: NDArray[np.uint8] | None) -> Light:
    """Return the call that shows colours; InputError unless they are (N, 3) whole numbers from 0 to 255, or None."""
    if colours is None:
        return Light(colours=None)
    given = np.asarray(colours)
    if (
        given.ndim != 2
        or given.shape[1] != 3
        or given.dtype.kind not in "iu"
        or not ((given >= 0) & (given < 256)).all()
    ):
        raise InputError(f"colours {given.shape} {given.dtype}: give (12, 3) whole numbers from 0 to 255, R, G, B each")
    return made(Light, colours=[tuple(led) for led in given.tolist()])


def commanded_s(sensor: SensorSession) -> float:
    """Return since when frames show what was commanded just now; 0 for files, whose pictures are old."""
    return 0.0 if sensor.camera.waits else time.monotonic()
