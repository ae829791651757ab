"""What another program may ask of a daemon: status, calibration, a light, a mode, a zero, a press into a simulated gel.

A call is JSON such as {"type": "press", "object": "BALL", "depth_mm": 0.8, "x_mm": 0, "y_mm": 0}. The answer is JSON
too, but for `calibration`, whose answer is the content of a `.gelcal` file.
"""

import json
import time
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from gellight.base.allowed import StrictModel, in_words
from gellight.base.errors import InputError
from gellight.bundle.bundle import packed_bundle
from gellight.ring.wire import MOST_LEDS
from gellight.stream.wire import Byte

if TYPE_CHECKING:
    from gellight.daemon.session import SensorSession


class Status(StrictModel):
    """What `SensorSession.status` says."""

    type: Literal["status"] = "status"


class Calibration(StrictModel):
    """The bundle in use, with the zero in use."""

    type: Literal["calibration"] = "calibration"


class Light(StrictModel):
    """Show these colours on the LEDs; None: those of the bundle again."""

    type: Literal["light"] = "light"
    colours: Annotated[list[tuple[Byte, Byte, Byte]], Field(min_length=1, max_length=MOST_LEDS)] | None


class Mode(StrictModel):
    """Go on in another mode: network or photometric."""

    type: Literal["mode"] = "mode"
    mode: str


class Zero(StrictModel):
    """Set the zero of the depth to the gel as it is now: nothing touches it."""

    type: Literal["zero"] = "zero"


class Track(StrictModel):
    """Give frames the pose of the object that touches, or no more."""

    type: Literal["track"] = "track"
    on: bool


class Press(StrictModel):
    """Press an object into a simulated gel."""

    type: Literal["press"] = "press"
    object: str
    depth_mm: float
    x_mm: float
    y_mm: float


class Drag(StrictModel):
    """Move what is pressed into the simulated gel sideways, x, y from where it was pressed, and turn it."""

    type: Literal["drag"] = "drag"
    x_mm: float
    y_mm: float
    turn_rad: float = 0.0


class Release(StrictModel):
    """Lift the object off the simulated gel."""

    type: Literal["release"] = "release"


Made = TypeVar("Made", bound=StrictModel)
Call = Status | Calibration | Light | Mode | Zero | Track | Press | Drag | Release
_CALLS: TypeAdapter[Call] = TypeAdapter(Annotated[Call, Field(discriminator="type")])


def read_call(content: bytes) -> Call:
    """Return the call of a message; InputError says what is wrong with it."""
    try:
        return _CALLS.validate_json(content)
    except ValidationError as error:
        raise InputError(f"no call of GelLight: {in_words(error)}") from None


def made(kind: type[Made], **values: object) -> Made:
    """Return a call with these values; InputError says what is wrong with them."""
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise InputError(in_words(error)) from None


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


READING = (Status, Calibration)
"""calls that change nothing: every program may make them"""


def answer(daemon: "SensorSession", call: Call) -> bytes:
    """Do what is asked and return the answer; raises what the daemon raises."""
    match call:
        case Status():
            return json.dumps(daemon.status(), default=str).encode()
        case Calibration():
            return packed_bundle(daemon.zeroed_bundle)
        case Light():
            daemon.light(None if call.colours is None else np.array(call.colours, np.uint8))
        case Mode():
            daemon.change_mode(call.mode)
        case Zero():
            daemon.rezero()
        case Track():
            daemon.track(call.on)
        case Press() | Drag() | Release():
            move(daemon, call)
    return json.dumps({"time_s": commanded_s(daemon)}).encode()


def commanded_s(daemon: "SensorSession") -> float:
    """Return since when frames show what was commanded just now; 0 for files, whose pictures are old."""
    return 0.0 if daemon.camera.waits else time.monotonic()


def move(daemon: "SensorSession", call: Press | Drag | Release) -> None:
    """Press, drag or lift an object; InputError on a sensor whose gel is not simulated."""
    if daemon.stage is None:
        raise InputError("objects can be pressed into a simulated gel only (sim://)")
    if isinstance(call, Release):
        daemon.stage.release()
    elif isinstance(call, Drag):
        daemon.stage.drag(call.x_mm, call.y_mm, call.turn_rad)
    else:
        daemon.stage.press(call.object, call.depth_mm, call.x_mm, call.y_mm)
