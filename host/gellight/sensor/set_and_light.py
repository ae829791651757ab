"""Set and light a sensor for some frames: the one way to get a frame that shows certain controls and a certain light.

`Camera.adopt` says how a sensor is from now on, also after it was unplugged, and reads no frame. `set_and_light` reads;
so it is for whoever reads the camera. While a daemon reads it, that is everyone who has `daemon.camera`, in any thread
but the daemon's own.

No clock of the board is trusted, and no frames are counted. The board tells that a light has been latched; what arrives
at the host at some time was latched before that time, and shows one cycle of the LEDs' modulation later. Every frame
whose exposure begins after that is under the new light from its first row on. After the frame has arrived, the board is
asked whether this light is still the one that is on.
"""

import logging
import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import Camera, CameraTiming, set_controls
from gellight.frames.frames import CameraFrame
from gellight.ring.light_ring import LightRing, shows_still

logger = logging.getLogger(__name__)
MOST_DISCARDED = 60
"""a camera whose stamps are right delivers a frame of the new light within two frames and its queue"""
MOST_ATTEMPTS = 3  # chosen: light that goes out again and again is taken away by another program
SETTLING_FRAMES = 4
"""frames that a camera may still show with the exposure or gain of before"""


def set_and_light(
    camera: Camera,
    controls: Mapping[str, float],
    colours: NDArray[np.uint8] | None,
    *,
    timing: CameraTiming | None = None,
    frames: int = 1,
) -> tuple[CameraFrame, ...]:
    """Set controls by name, show (12, 3) uint8 RGB (None: dark), and return frames exposed wholly under both.

    A camera without a ring keeps its light. `timing`: by default what the camera tells. Raises what `Camera.adopt`
    raises; CameraError where no frame of the new light comes; BoardError where the light does not stay on.
    """
    timing = timing or camera.timing or CameraTiming()
    if set_controls(camera, controls):
        settle(camera)
    for _ in range(MOST_ATTEMPTS):
        ring = camera.ring
        light_id = ring.light(colours) if ring else 0
        first = _first_after(camera, time.monotonic() + timing.pulse_period_s, timing)
        taken = (first, *(camera.read() for _ in range(frames - 1)))
        if camera.ring is ring and (ring is None or _still_on(ring, light_id)):
            return taken
        logger.warning("the light went out while its frames were taken; they are taken again")
    raise BoardError(f"the light did not stay on in {MOST_ATTEMPTS} attempts: does another program use the ring?")


def settle(camera: Camera) -> None:
    """Read on until frames show the controls that were set; raises what the camera raises."""
    for _ in range(SETTLING_FRAMES):
        camera.read()


def _first_after(camera: Camera, lit_s: float, timing: CameraTiming) -> CameraFrame:
    for _ in range(MOST_DISCARDED):
        frame = camera.read()
        if timing.span_s(frame.time_s)[0] >= lit_s:
            return frame
    raise CameraError(
        f"{camera.url} delivered {MOST_DISCARDED} frames that began before their light: "
        "its time stamps are not start times on the monotonic clock; see `gellight doctor`"
    )


def _still_on(ring: LightRing, light_id: int) -> bool:
    """Ask the board whether this still light is the one that its LEDs show, and has been all the time."""
    status = ring.status()
    return status.light_id == light_id and shows_still(status)
