"""HOLD: show a light, wait until it shines, take one frame that was exposed wholly under it. Always right, and slow.

images = [frame.image for frame in exposures(camera, colour_triples(colours))]

Nothing is counted and no clock of the board is trusted. The board tells that a light has been latched; what arrives at
the host at some time was latched before that time, and shows one cycle of the LEDs' modulation later. Every frame whose
exposure begins after that is under the new light from its first row on. After the frame has arrived, the board is asked
whether this light is still the one that is on.
"""

import logging
import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import Camera
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.frames.timing import CameraTiming
from gellight.ring import protocol
from gellight.ring.enumerations import Dark, State
from gellight.ring.light_ring import LightRing

logger = logging.getLogger(__name__)
Groups = NDArray[np.uint8]
MOST_DISCARDED = 60
"""a camera whose stamps are right delivers a frame of the new light within two frames and its queue"""
MOST_ATTEMPTS = 3
LATCH_TIMEOUT_S = 5.0


class PictureCheck(Protocol):
    """What can tell from a picture alone which light groups were lit; `lighting.content` has one."""

    def label(self, image: NDArray[np.uint8]) -> LightLabel:
        """Return what (H, W, 3) uint8 shows."""


def exposures(
    camera: Camera,
    groups: Groups | Iterable[NDArray[np.uint8]],
    *,
    timing: CameraTiming | None = None,
    check: PictureCheck | None = None,
) -> list[CameraFrame]:
    """Return one clean frame for each light group, in order; afterwards the light is again what it was before.

    `groups` is (n, 12, 3) uint8 RGB, or an iterable of (12, 3). Each frame carries the label `clean` with its index.
    `check` has to agree, else the frame is taken again. A frame that is read directly afterwards may be mixed: it has
    no label. Raises CameraError where the camera has no ring, delivers no frame of the new light, or shows another
    light than was asked; BoardError where the board does not do it (also: a sequence is running, or the current limit
    scales a light).
    """
    with Hold(camera, timing=timing, check=check) as hold:
        return [hold.expose(colours, index) for index, colours in enumerate(groups)]


class Hold:
    """The light ring of a camera, in hand. As a context manager it gives back the light that was there before."""

    def __init__(
        self, camera: Camera, *, timing: CameraTiming | None = None, check: PictureCheck | None = None
    ) -> None:
        """Take the ring of `camera`; CameraError if there is none."""
        if camera.ring is None:
            raise CameraError(
                f"{camera.url} has no light ring to take its exposures with: connect the ring's board, "
                "or open the sensor that has one"
            )
        self._camera, self._ring = camera, camera.ring
        self._timing = timing or camera.timing or CameraTiming()
        self._check = check
        self.discarded = 0
        """frames that were thrown away because they began before the light had settled"""

    def __enter__(self) -> "Hold":
        """Remember the light; BoardError while a sequence runs: it is somebody's, and goes on."""
        if self._ring.status().state == State.RUNNING:
            raise BoardError("the ring is running a sequence: stop the sequence before taking single exposures")
        self._before = self._ring.still
        return self

    def __exit__(self, *_: object) -> None:
        """Give back the light that was there before, dark if there was none; a fault underway is not covered up."""
        try:
            if self._before is None:
                self._ring.blank()
            else:
                settled_light(self._ring, self._before)
        except BoardError as error:
            logger.warning("the light of before could not be given back: %s", error)

    def expose(self, colours: NDArray[np.uint8], index: int) -> CameraFrame:
        """Show (12, 3) uint8 and return a frame taken wholly under it, labelled clean with `index`."""
        label = LightLabel(state=LightState.CLEAN, group=index)
        seen = label
        for _ in range(MOST_ATTEMPTS):
            light_id, settled_s = settled_light(self._ring, colours, self._timing)
            frame = self._first_after(settled_s)
            if not still_lit(self._ring, light_id):
                logger.warning("light group %d went out while its frame was taken; it is taken again", index)
                continue
            seen = self._check.label(frame.image) if self._check else label
            if seen == label:
                return replace(frame, label=label)
            logger.warning("light group %d was asked, the picture shows %s; it is taken again", index, seen)
        if seen != label:
            raise CameraError(
                f"{self._camera.url} shows {seen.state} light (group {seen.group}) where group {index} was asked: "
                "check that ring and camera belong to one sensor, and take the reference images again"
            )
        raise BoardError(
            f"light group {index} did not stay on in {MOST_ATTEMPTS} attempts: does another program use the ring?"
        )

    def _first_after(self, settled_s: float) -> CameraFrame:
        for _ in range(MOST_DISCARDED):
            frame = self._camera.read()
            if self._timing.span_s(frame.time_s)[0] >= settled_s:
                return frame
            self.discarded += 1
        raise CameraError(
            f"{self._camera.url} delivered {MOST_DISCARDED} frames that began before their light: "
            "its time stamps are not start times on the monotonic clock; see `gellight doctor`"
        )


def settled_light(ring: LightRing, colours: NDArray[np.uint8], timing: CameraTiming | None = None) -> tuple[int, float]:
    """Show (12, 3) uint8 RGB; return the light's number and from what time (`time.monotonic`) on it surely shows.

    Raises BoardError where the board refuses the light, scales it to its current limit, or does not latch it.
    """
    timing = timing or CameraTiming()
    reply = ring.set_leds(colours)
    if reply.scale != protocol.FULL_SCALE:
        raise BoardError(
            f"the current limit scales this light to {reply.scale / protocol.FULL_SCALE:.1%}: it would not be the "
            "light of its reference image; dim the group, or raise the limit with an external supply"
        )
    ring.wait_for_light(reply.light_id, LATCH_TIMEOUT_S)
    return reply.light_id, time.monotonic() + timing.pulse_period_s


def still_lit(ring: LightRing, light_id: int) -> bool:
    """Ask the board whether this still light is the one that its LEDs show, and has been all the time."""
    status = ring.status()
    gone = status.dark not in (Dark.NOT_DARK, Dark.COMMAND)
    return status.light_id == light_id and status.state == State.STILL and not gone
