"""Lights each LED and each light group by itself and looks whether the right one shines, in the right colour."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BoardError, CameraError
from gellight.frames.pixel_grid import block_means
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.records import LedAnswer, LedCheck
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import BLOCK_PX
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.set_and_light import set_and_light

Floats = NDArray[np.float32]
COLOURS = "RGB"
_SAME_GREY = 1.0
"""frames under the same light differ by less, in the mean over blocks"""
_LONGEST_WAIT_FRAMES = 90  # chosen: three seconds at 30 frames/s
_DEAD_SHARE = 0.15
"""an LED that gives less than this share of the median LED of its colour is dead"""
_WEAK_SHARE = 0.6  # chosen: of the median LED of its colour
_GROUP_ERROR = 0.08
"""a light group may differ from the sum of its LEDs by this share: more is a supply that sags"""


def light(run: CalibrationRun, colours: NDArray[np.uint8]) -> Floats:
    """Light the LEDs and return the block means of the picture that was exposed wholly under them.

    Two frames in a row that agree are waited for, since not every camera tells exactly when it exposed. Raises
    CameraError if the picture does not come to rest.
    """
    (frame,) = set_and_light(run.camera, {}, colours)
    before = block_means(frame.image, BLOCK_PX)
    for _ in range(_LONGEST_WAIT_FRAMES):
        image = run.frame().image
        seen = block_means(image, BLOCK_PX)
        run.display.show(live=image)
        if float(np.abs(seen - before).mean()) < _SAME_GREY:
            return np.asarray((seen + before) / 2, np.float32)
        before = seen
    raise CameraError("the picture does not come to rest under steady light: cover the sensor from other light")


def check_lights(run: CalibrationRun, colours: NDArray[np.uint8]) -> LedCheck:
    """Light every LED of (12, 3) `colours` and every colour triple; return what was seen.

    Raises BoardError that names every LED that is dead, far too weak, or shines in a colour that is not its own.
    """
    dark = light(run, np.zeros_like(colours))
    rises: list[Floats] = []
    for led, group in enumerate(single_leds(colours)):
        run.display.update(progress=Progress(done=led, wanted=len(colours), unit="LEDs"))
        rises.append(light(run, group) - dark)
    answers = tuple(_answer(led, rise, colours) for led, rise in enumerate(rises))
    _refuse(answers)
    _check_groups(run, colours, dark, rises)
    return LedCheck(leds=answers)


def _answer(led: int, rise: Floats, colours: NDArray[np.uint8]) -> LedAnswer:
    channel = int(rise.mean(axis=(0, 1)).argmax())
    bright = np.maximum(rise[..., channel], 0)
    rows, columns = np.indices(bright.shape)
    weight = bright / max(float(bright.sum()), 1e-6)
    middle_y, middle_x = (np.array(bright.shape) - 1) / 2
    # A gradient of brightness moves the centroid by as much as the side of the picture squared.
    x = float((weight * (columns - middle_x)).sum()) / bright.shape[1] ** 2
    y = float((weight * (rows - middle_y)).sum()) / bright.shape[0] ** 2
    return LedAnswer(
        led=led,
        colour=COLOURS[int(colours[led].argmax())],
        grey=float(bright.mean()),
        seen_colour=COLOURS[channel],
        azimuth_deg=float(np.degrees(np.arctan2(-y, x)) % 360),
    )


def _refuse(answers: Sequence[LedAnswer]) -> None:
    usual = {c: float(np.median([a.grey for a in answers if a.colour == c] or [0.0])) for c in COLOURS}
    most = max(usual.values())
    dead = [a.led for a in answers if a.grey < max(_DEAD_SHARE * usual[a.colour], 0.02 * most, 0.3)]
    swapped = [f"{a.led} ({a.seen_colour} for {a.colour})" for a in answers if a.seen_colour != a.colour]
    weak = [a.led for a in answers if a.grey < _WEAK_SHARE * usual[a.colour] and a.led not in dead]
    faults = []
    if dead:
        faults.append(f"LED {_listed(dead)} stays dark: check its solder joints, or replace it")
    if swapped and not dead:
        faults.append(f"LED {_listed(swapped)} shines in another colour: check the colour order of the board")
    if weak:
        faults.append(f"LED {_listed(weak)} is far weaker than the others: clean it, or replace it")
    if faults:
        raise BoardError("; ".join(faults))


def _listed(names: Sequence[object]) -> str:
    return ", ".join(map(str, names))


def _check_groups(run: CalibrationRun, colours: NDArray[np.uint8], dark: Floats, rises: list[Floats]) -> None:
    """Light each colour triple: its picture has to be the sum of its LEDs."""
    for number, group in enumerate(colour_triples(colours)):
        members = [led for led in range(len(colours)) if group[led].any()]
        rise = light(run, group) - dark
        wanted = np.sum([rises[led] for led in members], axis=0)
        error = float(np.abs(rise - wanted).mean() / max(float(np.abs(wanted).mean()), 1e-6))
        if error > _GROUP_ERROR:
            raise BoardError(
                f"light group {number} (LED {_listed(members)}) differs by {error:.0%} from the sum of its LEDs: the "
                "supply of the ring sags or other light falls in; use a stronger supply and cover the sensor"
            )
