"""HOLD: show one light after the other, and take frames wholly under each of them. Always right, and slow.

images = [frame.image for frame in exposures(camera, colour_triples(colours))]
"""

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.camera import Camera, CameraTiming
from gellight.frames.frames import CameraFrame, LightLabel, LightState
from gellight.ring.enumerations import State
from gellight.sensor.set_and_light import set_and_light

logger = logging.getLogger(__name__)


def exposures(camera: Camera, groups: NDArray[np.uint8] | Iterable[NDArray[np.uint8]]) -> list[CameraFrame]:
    """Return one clean frame for each light group, in order; afterwards the light is again what it was before.

    `groups` is (n, 12, 3) uint8 RGB, or an iterable of (12, 3). Each frame carries the label `clean` with its index.
    A frame that is read directly afterwards may be mixed: it has no label. Raises CameraError where the camera has no
    ring or delivers no frame of the new light; BoardError where the board does not do it (also: a sequence is running,
    or the current limit scales a light).
    """
    with ring_in_hand(camera):
        return [expose(camera, colours, index)[0] for index, colours in enumerate(groups)]


@contextmanager
def ring_in_hand(camera: Camera) -> Iterator[None]:
    """Give back the light that was there before, dark if there was none, after the block.

    Raises CameraError without a ring, BoardError while it runs a sequence of somebody else.
    """
    ring = camera.ring
    if ring is None:
        raise CameraError(
            f"{camera.url} has no light ring to take its exposures with: connect the ring's board, "
            "or open the sensor that has one"
        )
    if ring.status().state == State.RUNNING:
        raise BoardError("the ring is running a sequence: stop the sequence before taking single exposures")
    before = ring.still
    try:
        yield
    finally:
        _give_back(camera, before)


def _give_back(camera: Camera, light: NDArray[np.uint8] | None) -> None:
    """Show the light of before; a fault underway is not covered up."""
    ring = camera.ring  # another one if the sensor was unplugged meanwhile; none while it is
    try:
        if ring is not None:
            ring.light(light)
    except BoardError as error:
        logger.warning("the light of before could not be given back: %s", error)


def expose(
    camera: Camera, colours: NDArray[np.uint8], index: int, *, timing: CameraTiming | None = None, frames: int = 1
) -> tuple[CameraFrame, ...]:
    """Show (12, 3) uint8 and return frames taken wholly under it, labelled clean with `index`."""
    label = LightLabel(state=LightState.CLEAN, group=index)
    taken = set_and_light(camera, {}, colours, timing=timing, frames=frames)
    return tuple(replace(frame, label=label) for frame in taken)
