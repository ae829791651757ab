"""What is inside the virtual sensor: a camera, and the board whose light ring lights what the camera sees."""

from collections.abc import Mapping

from gellight.base.allowed import query_of
from gellight.base.errors import ConfigError, InputError
from gellight.frames.camera import Camera
from gellight.ring.emulator.child import SimulatedBoard
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import LED_COUNT


class UncommandedRing(LightRing):
    """The ring of a board that another program commands: the one at the other end of the virtual USB cable."""

    def __init__(self, board: SimulatedBoard) -> None:
        """Hold the board without speaking to it."""
        self.transport = board

    def close(self) -> None:
        """Switch the board off."""
        self.transport.close()


class CameraAndBoard:
    """A camera and an emulated board that runs the firmware's image while the sensor has power."""

    def __init__(self, camera: Camera, *, frame_rate: float = 30.0, unique_id: bytes | None = None) -> None:
        """Take over a camera without a ring, which runs at `frame_rate`.

        `unique_id` are the 8 bytes from which the board makes its serial number; None: there is no board.
        """
        self.camera, self.frame_rate = camera, frame_rate
        self.board: SimulatedBoard | None = None
        self._unique_id = unique_id

    @property
    def serial_path(self) -> str:
        """Path of the terminal at which the board's serial port ends; "" while there is none."""
        return self.board.path if self.board else ""

    def power_on(self) -> None:
        """Start the board, its LEDs dark."""
        if self._unique_id is not None:
            self.board = SimulatedBoard(pty=True, unique_id=self._unique_id)
            self.camera.ring = UncommandedRing(self.board)

    def power_off(self) -> None:
        """End the board, with its LEDs dark: the camera keeps the dead board until a new one starts."""
        if self.board is not None:
            self.board.close()
        self.board = None

    def close(self) -> None:
        """Switch off for good and close the camera."""
        self.power_off()
        self.camera.close()


def open_inside(url: str, *, unique_id: bytes, geometry: Mapping[str, float | int | str]) -> CameraAndBoard:
    """Open the simulated sensor of a `sim://` URL; with `board=0` its light is steady and its serial port silent.

    Raises InputError or ConfigError.
    """
    if not url.startswith("sim://"):
        raise InputError(f"a virtual sensor shows a simulated one: {url!r} is none, give sim:// with its parameters")
    from gellight.simulator.simulated_camera import SimulatedUrl, built, open_simulated

    wanted, leds = query_of(url, SimulatedUrl), len(built(geometry).led_colours)
    if wanted.board and leds != LED_COUNT:
        raise ConfigError(f"the sensor has {leds} LEDs, the board drives {LED_COUNT}: use sim://?board=0")
    camera = open_simulated(url + ("&" if "?" in url else "?") + "board=0", geometry)
    camera.url = url
    return CameraAndBoard(camera, frame_rate=wanted.fps, unique_id=unique_id if wanted.board else None)
