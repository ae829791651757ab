"""Step 1: lock the camera, check the LEDs, balance the three colours, and measure how even the light is.

Each colour of a ring at the rim falls off across the view, from another side, so no picture of the untouched gel is
evenly grey in every colour. What is set is that the brightest hundredth of the brightest colour lies between 150 and
230: as much light as possible, and room for slopes that face an LED.
"""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import LedSetting
from gellight.frames.camera import Camera, CameraControls, controls_of
from gellight.lab.calibration import led_check
from gellight.lab.calibration.records import Preparation, Uniformity
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import check_light, mean_image
from gellight.photometric.light_model import CLIPPED_GREY

LOWEST_GREY, WANTED_GREY, HIGHEST_GREY = 150.0, 200.0, 230.0
"""of the 99th percentile of the brightest colour of the untouched gel"""
PULSES_US = 1000.0
"""exposures are whole multiples of this where they can be: whole cycles of pulsed LEDs leave no bands"""
_ROUNDS = 6  # chosen: ends a search that does not settle
_CONTROL_FRAMES = 4
"""sensors take a new exposure or gain over two or three frames after it was set"""
_BALANCED = 0.01  # chosen: of the mean, how far colours may differ
_DIMMEST_SHARE = 0.3  # chosen: no colour is dimmed farther in one round


def prepare(run: CalibrationRun) -> None:
    """Do the whole step and keep its figures."""
    camera, options = run.camera, run.options
    run.wait_for_next("Clean the gel, put nothing on it, and keep other light away. Then go on.")
    run.display.update(instruction="The camera is being set and the LEDs are checked. Touch nothing.")
    _lock(camera)
    lights, levels, ring = None, None, options.ring
    if camera.ring is not None:
        if camera.ring.led_count != len(ring.channels):
            raise InputError(
                f"the board drives {camera.ring.led_count} LEDs, led_colours = {ring.led_colours!r} has "
                f"{len(ring.channels)}: give led_colours under [geometry] in gellight.toml, or the board its number of "
                "LEDs with `gellight ring configure --leds`"
            )
        lights = led_check.check_lights(run, ring.colours)
        levels = _balanced(run)
    elif camera.controls is not None:
        _expose(run, camera.controls)
    settings = controls_of(camera)
    camera.adopt(settings, levels)  # so it is set and lit again when it was unplugged
    led = None if levels is None else levels.tolist()
    image = mean_image([run.frame() for _ in range(options.reference_frames // 2)])
    check_light(image, "the untouched gel")
    uniformity = of_image(image.astype(np.float32))
    run.display.show(untouched=image)
    run.folder.finish(
        Preparation(camera=settings, led=led, lights=lights, uniformity=uniformity, advice=_advice(uniformity))
    )


def prepare_again(run: CalibrationRun) -> None:
    """Set camera and LEDs as an interrupted calibration had set them."""
    prepared = run.folder.figures(Preparation)
    run.camera.adopt(prepared.camera, np.array(prepared.led, np.uint8) if prepared.led else None)


def led_settings(levels: list[list[int]] | None) -> tuple[LedSetting, ...]:
    """Return LED levels as they are written into a bundle."""
    return tuple(LedSetting.model_validate({"colour": "RGB"[rgb.index(max(rgb))], "rgb": rgb}) for rgb in levels or [])


def _lock(camera: Camera) -> None:
    """Fix every control where it is, the gain at its lowest: automatic ones would follow the press."""
    controls = camera.controls
    if controls is None:
        return
    for name in controls.names():
        controls.set(name, controls.range(name)[0] if name == "gain" else controls.read(name))


def _brightest(run: CalibrationRun) -> float:
    """Grey level of the brightest hundredth of the brightest colour, when the controls act that were set before."""
    for _ in range(_CONTROL_FRAMES):
        frame = run.frame()
    run.display.show(live=frame.image)
    return float(np.percentile(frame.image[::4, ::4].reshape(-1, 3), 99, axis=0).max())


def _balanced(run: CalibrationRun) -> NDArray[np.uint8]:
    """Dim the brighter colours until the means of the channels agree, and expose; (n, 3) levels.

    Channels overlap, so that it takes some rounds: each multiplies a level by what its channel is off.
    """
    share = np.ones(3)
    for _ in range(_ROUNDS):
        colours = np.rint(run.options.ring.colours * share).astype(np.uint8)
        image = led_check.light(run, colours)
        if run.camera.controls is not None:
            _expose(run, run.camera.controls)
            image = led_check.light(run, colours)
        means = image.mean(axis=(0, 1))
        if means.min() <= 0.5:
            raise InputError(
                f"the picture is dark (means {means.round(1).tolist()}): check lens cap, LEDs and exposure"
            )
        if np.ptp(means) < _BALANCED * means.mean():
            break
        share = np.clip(share * means.min() / means, _DIMMEST_SHARE, 1.0)
        share /= share.max()
    return np.asarray(colours)


def _expose(run: CalibrationRun, controls: CameraControls) -> None:
    """Set the exposure, then if need be the gain, so that the brightest hundredth is as wanted."""
    names = controls.names()
    if "exposure_us" not in names:
        return
    for _ in range(_ROUNDS):
        seen = _brightest(run)
        if LOWEST_GREY < seen < HIGHEST_GREY and abs(seen - WANTED_GREY) < 15:
            return
        low, high, _step = controls.range("exposure_us")
        # A clipped picture does not say by how much it is too bright.
        factor = 0.5 if seen >= CLIPPED_GREY else WANTED_GREY / max(seen, 4.0)
        wanted = controls.read("exposure_us") * factor
        rounded = max(PULSES_US, np.floor(wanted / PULSES_US) * PULSES_US)
        exposure = float(np.clip(rounded if wanted >= PULSES_US else wanted, low, high))
        if exposure == controls.read("exposure_us") and seen < CLIPPED_GREY:
            _amplify(controls, factor)
            return
        controls.set("exposure_us", exposure)


def _amplify(controls: CameraControls, factor: float) -> None:
    if "gain" in controls.names() and factor > 1:
        low, high, _step = controls.range("gain")
        controls.set("gain", float(np.clip(controls.read("gain") * factor, low, high)))


def _advice(found: dict[str, Uniformity]) -> str:
    brightest = max(found[colour].brightest_grey for colour in ("red", "green", "blue"))
    if brightest < LOWEST_GREY:
        return f"the gel is dim: its brightest colour reaches {brightest:.0f}; give more light for less noise"
    if brightest > HIGHEST_GREY:
        return f"the gel is bright: its brightest colour reaches {brightest:.0f}; slopes that face an LED may clip"
    return ""


Floats = NDArray[np.float32]


def uniformity(intensity: Floats) -> Uniformity:
    """Return the figures of (H, W) grey levels."""
    return Uniformity(
        mean_grey=float(intensity.mean()),
        sigma_grey=float(intensity.std()),
        brightest_grey=float(np.percentile(intensity, 99)),
    )


def of_image(image: Floats) -> dict[str, Uniformity]:
    """Return the figures of the average of the colours and of each colour of (H, W, 3) grey levels."""
    seen = {"average": image.mean(axis=2), "red": image[..., 0], "green": image[..., 1], "blue": image[..., 2]}
    return {name: uniformity(intensity) for name, intensity in seen.items()}
