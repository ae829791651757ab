"""What is inside the virtual housing: a camera, and the controller of the light ring that lights what it sees."""

from collections.abc import Mapping
from typing import Protocol

from gellight.base.errors import ConfigError, InputError
from gellight.frames.camera import Camera
from gellight.ring.emulator.child import SimulatedBoard
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import LED_COUNT


class Body(Protocol):
    """Hardware behind the plug."""

    camera: Camera
    frame_rate: float
    """that the camera runs at"""
    port: str
    """path of the terminal at which the controller's serial port ends; "" while there is none"""

    def power_on(self) -> None:
        """Start the controller, its LEDs dark."""

    def power_off(self) -> None:
        """Take the power from the controller."""

    def close(self) -> None:
        """Switch off for good and close the camera."""


class UncommandedRing(LightRing):
    """A ring whose board somebody else commands: the program at the other end of the virtual USB cable."""

    def __init__(self, board: SimulatedBoard) -> None:
        """Hold the board without speaking to it."""
        self.transport = board

    def close(self) -> None:
        """Switch the board off."""
        self.transport.close()


class CameraBody:
    """Any camera that a URL opens, without a controller; its serial port is silent."""

    port = ""

    def __init__(self, camera: Camera, *, frame_rate: float = 30.0) -> None:
        """Take over a camera."""
        self.camera, self.frame_rate = camera, frame_rate

    def power_on(self) -> None:
        """Nothing to start."""

    def power_off(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Close the camera."""
        self.power_off()
        self.camera.close()


class SimulatedBody(CameraBody):
    """The simulated sensor, lit by what the firmware's image does in an emulator."""

    def __init__(self, camera: Camera, *, unique_id: bytes, frame_rate: float = 30.0) -> None:
        """Take over a simulated camera without a ring; `unique_id` are the 8 bytes of the controller's flash."""
        super().__init__(camera, frame_rate=frame_rate)
        self._unique_id = unique_id
        self.board: SimulatedBoard | None = None

    def power_on(self) -> None:
        """Start the firmware."""
        self.board = SimulatedBoard(pty=True, unique_id=self._unique_id)
        self.port = self.board.path
        self.camera.ring = UncommandedRing(self.board)

    def power_off(self) -> None:
        """End it, with the LEDs dark for good: the camera keeps the dead board until a new one starts."""
        if self.board is not None:
            self.board.close()
        self.board, self.port = None, ""


def open_body(url: str, *, unique_id: bytes, geometry: Mapping[str, float | int | str]) -> Body:
    """Build the body of the simulated sensor that a URL describes.

    With `board=0` in the URL the light is steady and the serial port silent. Raises InputError or ConfigError.
    """
    if not url.startswith("sim://"):
        raise InputError(f"a virtual sensor shows a simulated one: {url!r} is none, give sim:// with its parameters")
    from gellight.simulator.simulated_camera import built, open_simulated

    leds = len(built(geometry).led_colours)
    if "board=0" in url:
        return CameraBody(open_simulated(url, geometry), frame_rate=frame_rate_of(url))
    if leds != LED_COUNT:
        raise ConfigError(f"the sensor has {leds} LEDs, the controller drives {LED_COUNT}: use sim://?board=0")
    camera = open_simulated(url + ("&" if "?" in url else "?") + "board=0", geometry)
    camera.url = url
    return SimulatedBody(camera, unique_id=unique_id, frame_rate=frame_rate_of(url))


def frame_rate_of(url: str) -> float:
    """Return what the `fps` of a valid `sim://` URL says, 30 where it says nothing."""
    from urllib.parse import parse_qs, urlsplit

    return float(parse_qs(urlsplit(url).query).get("fps", ["30"])[0])
