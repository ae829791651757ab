"""The calibration desk of a running sensor: begins the routine beside the stream, installs what passes, restores.

The routine reads along the camera of the daemon, so the stream goes on, under whatever light the routine sets. The
watch rests meanwhile.
"""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
import platformdirs
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.base.errors import GellightError, InputError
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.calibration.choices import RING_COLOURS, RoutineOptions
from gellight.calibration.routine import Routine
from gellight.calibration.state import discard, unfinished
from gellight.daemon.daemon import Daemon
from gellight.daemon.installing import install, restore, sensor_name
from gellight.simulator.virtual_hand import hand_of

Picture = NDArray[np.uint8]
TOOLS = ("ball_radius_mm", "cylinder_diameter_mm", "pin_pitch_mm")
"""wishes that an interrupted calibration was begun with"""


class Wishes(BaseModel):
    """What a user chooses before a calibration begins."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    ball_radius_mm: float = Field(default=4.0, gt=0, le=50)
    cylinder_diameter_mm: float = Field(default=8.0, gt=0, le=50)
    pin_pitch_mm: float | None = Field(default=None, gt=0, le=20)
    """distance of two pins of the grid that measures the lens; None without one"""
    presses: int = Field(default=40, ge=8, le=400)
    hand: bool = False
    """a virtual hand presses, on a simulated sensor"""
    anew: bool = False
    """forget an interrupted calibration instead of going on with it"""


class Guide(Protocol):
    """A calibration that goes on by itself; `Routine` is one."""

    @property
    def ended(self) -> bool:
        """Whether it is finished, aborted or failed."""

    def snapshot(self) -> dict[str, Any]:
        """Return what is to be shown; see `Routine.snapshot`."""

    def pictures(self) -> dict[str, Picture]:
        """Return pictures by name."""

    def act(self, action: str, **arguments: float) -> None:
        """Do what the user chose; InputError where it is not possible now."""

    def stop(self) -> None:
        """Abort at the next frame, whatever is going on."""

    def join(self, timeout_s: float | None = None) -> None:
        """Wait until it has ended."""


Begin = Callable[[Wishes, Callable[[Bundle], object]], Guide]
"""Makes the routine for some wishes; what it is given installs the bundle that passes."""


class Desk:
    """What the wizard of the dashboard works with; safe to use from any thread."""

    def __init__(
        self,
        daemon: Daemon,
        *,
        store: BundleStore | None = None,
        folder: Path | None = None,
        led_colours: str | None = None,
        begin: Begin | None = None,
    ) -> None:
        """Calibrate the sensor of `daemon`; an interrupted calibration is kept in `folder`, by default the user's.

        led_colours: of the ring, anticlockwise from the right; by default those of the paper's.
        `begin` stands in for the routine in tests.
        """
        self._daemon = daemon
        self._store = store or BundleStore()
        self.sensor = sensor_name(daemon.camera)
        self._folder = folder or platformdirs.user_state_path("gellight") / "calibration" / _plain(self.sensor)
        self._led_colours = led_colours or RING_COLOURS
        self._begin = begin or self._routine
        self._guide: Guide | None = None
        self._waiter: threading.Thread | None = None
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        """Return the desk."""
        return self

    def __exit__(self, *problem: object) -> None:
        """Stop a calibration that still runs; what it has measured is kept."""
        if self._guide is not None and not self._guide.ended:
            self._guide.stop()
            self._guide.join()
        if self._waiter is not None:
            self._waiter.join()

    def state(self) -> dict[str, Any]:
        """Return all that the wizard shows, ready for JSON.

        sensor, simulated, defaults of the wishes, interrupted (whether there is a calibration to go on with),
        in_service (identity), bundles of this sensor, routine (the snapshot of the routine, or None).
        """
        return {
            "sensor": self.sensor,
            "simulated": self._daemon.stage is not None,
            "defaults": self._defaults().model_dump(),
            "interrupted": self._interrupted(),
            "in_service": self._daemon.bundle.identity,
            "bundles": [entry.as_json() for entry in self._store.bundles(self.sensor)],
            "routine": self._guide.snapshot() if self._guide else None,
        }

    def _defaults(self) -> Wishes:
        """The tools of an interrupted calibration, which goes on with no others."""
        try:
            begun = unfinished(self._folder)
            tools = {name: getattr(begun, name) for name in TOOLS} if begun else {}
            return Wishes(hand=self._daemon.stage is not None, **tools)
        except (GellightError, ValidationError):
            return Wishes(hand=self._daemon.stage is not None)  # `begin` says what is wrong with it

    def _interrupted(self) -> bool:
        try:
            return unfinished(self._folder) is not None
        except GellightError:
            return True  # `begin` says what is wrong with it

    def begin(self, wishes: Wishes) -> None:
        """Begin a calibration; InputError while another one runs or for wishes that cannot be met."""
        if self._daemon.mode != "network":
            raise InputError(
                f"the sensor streams in mode {self._daemon.mode}, which changes the light all the time: start it with "
                "--mode network to calibrate it"
            )
        with self._lock:
            if self._guide is not None and not self._guide.ended:
                raise InputError("a calibration is going on: stop it before you begin another")
            if wishes.anew:
                discard(self._folder)
            self._guide = self._begin(wishes, self._install)
            self._daemon.pause(True)
            self._guide.act("start")
            self._waiter = threading.Thread(target=self._wait, args=(self._guide,), name="desk", daemon=True)
            self._waiter.start()

    def act(self, action: str, **arguments: float) -> None:
        """Do what the user chose; InputError where it is not possible now."""
        if self._guide is None:
            raise InputError("no calibration is going on: begin one")
        self._guide.act(action, **arguments)

    def restore(self, identity: str) -> None:
        """Put a stored bundle into service again; BundleError or InputError where that cannot be."""
        if self._guide is not None and not self._guide.ended:
            raise InputError("a calibration is going on: stop it before you restore a bundle")
        restore(identity, sensor=self.sensor, store=self._store, running=self._daemon, camera=self._daemon.camera)

    def report(self, identity: str) -> bytes:
        """Return the report of a stored bundle, HTML; BundleError where there is none."""
        return self._store.find(identity).report()

    def rezero(self) -> None:
        """Set the zero of the depth; InputError, saying why, where it must not be set."""
        self._daemon.rezero(asked=True)

    def picture(self, name: str) -> Picture:
        """Return a picture, (H, W, 3) RGB: "live" is the newest frame; InputError where there is none of that name."""
        if name == "live":
            return self._daemon.wait_frame(-1, 2.0).camera_frame.image
        pictures = self._guide.pictures() if self._guide else {}
        if name not in pictures:
            raise InputError(f"there is no picture {name!r} yet")
        return pictures[name]

    def _wait(self, guide: Guide) -> None:
        guide.join()
        self._daemon.pause(False)

    def _install(self, bundle: Bundle) -> None:
        install(bundle, sensor=self.sensor, store=self._store, running=self._daemon, camera=self._daemon.camera)
        # It lies in the store now, and an ended calibration is not to be gone on with.
        discard(self._folder)

    def _routine(self, wishes: Wishes, install: Callable[[Bundle], object]) -> Guide:
        camera = self._daemon.camera
        if wishes.hand and camera.stage is None:
            raise InputError("nobody presses by itself on a real sensor: take the virtual hand off")
        options = RoutineOptions(
            out=self._folder.with_name(self._folder.name + ".bundle"),
            sensor=self.sensor,
            ball_radius_mm=wishes.ball_radius_mm,
            cylinder_diameter_mm=wishes.cylinder_diameter_mm,
            pin_pitch_mm=wishes.pin_pitch_mm,
            presses=wishes.presses,
            overwrite=True,
            led_colours=self._led_colours,
        )
        hand = hand_of(camera) if wishes.hand else None
        return Routine(camera, options, self._folder, hand=hand, install=install)


def _plain(name: str) -> str:
    """A sensor's name as the name of a folder."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)
