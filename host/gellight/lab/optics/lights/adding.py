"""What `gellight calibrate lights` does: take pictures under each LED, and add the light of each to the bundle."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError, InputError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera
from gellight.lab.optics.lights.ball_series import INNER
from gellight.lab.optics.lights.reference_light import ReferencePictures, light_model
from gellight.lab.optics.lights.ring_fit import RingFit, fit_ring
from gellight.lab.training.labelling import find_circle
from gellight.lab.training.labelling.ball_size import radius_by_slopes_px
from gellight.lab.training.presses import Ball, Press
from gellight.opening import open_camera
from gellight.photometric.light_model import LightGroups, LightModel, signals_of, without_shadows
from gellight.photometric.lights_file import write_lights
from gellight.photometric.ring_geometry import RingGeometry
from gellight.photometric.solver import flat_gel, light_rows, slopes, solve_robustly
from gellight.reconstruction.integration import normals
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.sensor.lighting.hold import Hold
from gellight.sensor.series_cameras import EXPOSURE


def add_lights(
    bundle: Bundle,
    settings: Settings,
    out: Path,
    *,
    frames: int,
    ring_from_light: bool = False,
    ball_radius_mm: float | None = None,
    press_ball: Callable[[], object] = lambda: None,
    overwrite: bool = False,
) -> dict[str, object]:
    """Measure the lights of the sensor that `settings` name, and write its bundle with them to `out`.

    ring_from_light: take the geometry of the ring from the pictures, not from the settings; then a ball of
    ball_radius_mm has to confirm it, which `press_ball` asks for and a simulated sensor presses by itself.
    Returns what was found, ready for JSON. Raises CameraError, BoardError, ConfigError or BundleError.
    """
    if ring_from_light and ball_radius_mm is None:
        raise InputError(
            "the light on the flat gel hardly tells a low ring from a high one, so a ball has to confirm the fit: give "
            "--ball-radius-mm with --ring-from-light"
        )
    ring = RingGeometry.from_overrides(settings.geometry.overrides())
    colours = led_colours(bundle, ring)
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        bundle.check_fits(camera.url, camera.image_shape)
        with _untouched(camera):
            model = take_lights(camera, ring, colours, bundle.pixel_size_mm, frames)
        fit = fit_ring(model, bundle.pixel_size_mm)
        if ring_from_light and ball_radius_mm is not None:
            model = replace(model, ring=fit.ring)
            confirm_ring(model, bundle, _pictures_of_ball(camera, colours, frames, press_ball), ball_radius_mm)
    write_lights(bundle, model, out, overwrite=overwrite)
    return {"calibration": str(out), "ring_used": "light" if ring_from_light else "settings"} | _facts(model, fit)


def _facts(model: LightModel, fit: RingFit) -> dict[str, object]:
    """What was found, ready for JSON."""
    return {
        "leds": len(model.colours),
        "gamma": model.gamma,
        "black_grey": model.black_grey.round(2).tolist(),
        "crosstalk": model.crosstalk.round(3).tolist(),
        "brightest_grey": round(model.brightest_grey, 1),
        "exposure_us": model.exposure_us,
        "pattern_residual": round(model.pattern_residual, 5),
        "ring_from_light": fit.as_json(),
    }


def led_colours(bundle: Bundle, ring: RingGeometry) -> NDArray[np.uint8]:
    """Return the (K, 3) colours of the LEDs: those the bundle was calibrated with, else full on as `ring` has them.

    Raises BundleError where the two disagree about which LED is of which colour.
    """
    if bundle.colours is None:
        return ring.colours
    found = "".join(led.colour for led in bundle.manifest.led)
    if found != ring.led_colours:
        raise BundleError(
            f"{bundle.source} is of a ring {found}, the settings say {ring.led_colours}: correct led_colours in "
            "[geometry]"
        )
    return bundle.colours


def take_lights(
    camera: Camera,
    ring: RingGeometry,
    colours: NDArray[np.uint8],
    pixel_size_mm: tuple[float, float],
    frames: int,
    taking: Callable[[int, int], object] = lambda index, groups: None,
) -> LightModel:
    """Show the gel, which nothing touches, dark, under each LED and under all, and make the light model of it.

    colours: (K, 3) uint8 of the LEDs. frames: averaged under each light. taking: told before each light, which it is
    and how many there are. Raises CameraError without a ring, and what `light_model` and `taking` raise.
    """
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring whose LEDs could be lit one by one: connect its board")
    if camera.stage:
        ring = replace(ring, window_mm=camera.stage.window_mm)
    pictures = _take_pictures(camera, colours, frames, taking)
    controls = camera.controls
    exposure = controls.read(EXPOSURE) if controls and EXPOSURE in controls.names() else None
    return light_model(pictures, ring, colours, pixel_size_mm, exposure_us=exposure)


def _pictures_of_ball(
    camera: Camera, colours: NDArray[np.uint8], frames: int, press_ball: Callable[[], object]
) -> list[list[NDArray[np.uint8]]]:
    """Show a pressed ball under each LED alone."""
    with _untouched(camera):
        if camera.stage:
            camera.stage.press("BALL", 1.0, 0.0, 0.0)
        else:
            press_ball()
        with Hold(camera) as hold:
            return [
                [frame.image for frame in hold.expose(group, index, frames)]
                for index, group in enumerate(single_leds(colours))
            ]


@contextmanager
def _untouched(camera: Camera) -> Iterator[None]:
    """Lift off what a stage presses, and press it again, and nothing else, at the end."""
    stage = camera.stage
    if stage is None:
        yield
        return
    pressed = stage.status()
    stage.release()
    try:
        yield
    finally:
        stage.release()
        if pressed["object"]:
            stage.press(pressed["object"], pressed["depth_mm"], pressed["x_mm"], pressed["y_mm"])


def _take_pictures(
    camera: Camera, colours: NDArray[np.uint8], frames: int, taking: Callable[[int, int], object]
) -> ReferencePictures:
    """Average `frames` frames in the dark, under each LED, under each triple and under all."""
    singles, triples = single_leds(colours), colour_triples(colours)
    groups = [np.zeros_like(colours), *singles, *triples, colours]
    taken = []
    with Hold(camera) as hold:
        for index, group in enumerate(groups):
            taking(index, len(groups))
            images = [frame.image for frame in hold.expose(group, index, frames)]
            # The dark by its median: noise that is cut off at 0 would lift the mean.
            taken.append(np.median(images, axis=0) if index == 0 else np.mean(images, axis=0))
    return ReferencePictures(
        dark=taken[0],
        singles=tuple(taken[1 : 1 + len(singles)]),
        triples=tuple(taken[1 + len(singles) : -1]),
        whole=taken[-1],
    )


TOLERANCE = 0.1
"""relative difference of the radius felt from the ball's"""


def confirm_ring(
    model: LightModel, bundle: Bundle, pictures: Sequence[Sequence[NDArray[np.uint8]]], radius_mm: float
) -> float:
    """Return the radius that a pressed ball feels like by the ring of `model`, mm.

    pictures: of the press, under each LED alone, each (H, W, 3) uint8. Raises BundleError where it is not the radius
    of the ball, and InputError where no ball is found in the pictures.
    """
    ball = Ball.seen_by(bundle, radius_mm)
    signals = signals_of(pictures, model.groups(LightGroups.SINGLES), model, bundle.manifest.noise_grey)
    references = model.references(LightGroups.SINGLES).astype(np.float32).reshape(len(model.colours), -1)
    signals = without_shadows(signals, references)
    circle = find_circle(model.grey(signals.light, model.image_shape), bundle.reference, ball=ball)
    rows = light_rows(flat_gel(model.image_shape, bundle.pixel_size_mm), references, model.ring)
    scaled, _ = solve_robustly(signals.grey, rows, signals.valid, signals.deviation.astype(np.float32))
    gradient_map = np.moveaxis(slopes(scaled).reshape(2, *model.image_shape), 0, 2)
    x, y, radius = circle.center_x_px, circle.center_y_px, circle.contact_radius_px
    press = Press(image=Path("the ball"), center_x_px=x, center_y_px=y, contact_radius_px=radius)
    felt_mm = radius_by_slopes_px(normals(gradient_map), press, 0.0, INNER) * ball.pixel_size_mm
    if not abs(felt_mm / radius_mm - 1) <= TOLERANCE:
        raise BundleError(
            f"the ring that fits the light on the flat gel feels the ball of {radius_mm:g} mm as one of {felt_mm:.3g} "
            "mm, so its LEDs are elsewhere: measure the ring, set [geometry], and leave --ring-from-light out"
        )
    return felt_mm
