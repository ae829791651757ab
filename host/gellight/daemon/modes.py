"""The ways a sensor feels: which camera and which frame path each of them needs."""

from math import floor

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, CameraError, ConfigError
from gellight.base.settings import LightingSettings, ReconstructionSettings
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera, timing_of
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.lights_file import read_lights
from gellight.reconstruction.lens.lens_file import FILE_NAME, has_lens
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.reconstruction.sequence_path import SequencePath
from gellight.sensor.lighting.lock import settle_s
from gellight.sensor.lighting.sequence_choice import chosen_groups
from gellight.sensor.lighting.sequenced import LightMode, SequencedCamera, clock_error_s
from gellight.sensor.series_cameras import EXPOSURE, SeriesCamera
from gellight.sensor.window_camera import WindowCamera
from gellight.series.reconstructor import PhotometricReconstructor
from gellight.series.single_light_path import SingleLightPath, has_single_lights, read_directions
from gellight.series.window import WindowReconstructor

BRIGHT_GREY = 225.0
"""of the brightest pixel of the untouched gel under one light group"""
LONGEST_US = 30_000.0
"""a camera of 30 frames a second cannot expose longer without becoming slower"""

NO_SEQUENCE = LightingSettings()
KINDS = {"rgb": LightGroups.TRIPLES, "single": LightGroups.SINGLES}
"""light groups that photometric stereo can use, by the name of their sequence"""


def frame_path(
    bundle: Bundle,
    settings: ReconstructionSettings,
    network: Reconstructor,
    lighting: LightingSettings = NO_SEQUENCE,
) -> FramePath:
    """Return the frame path of the mode that is set; `network` is that of GelNet mode.

    Raises BundleError where the bundle does not know its lights, or has a lens, which only GelNet's maps are
    freed of; ConfigError where mode and light do not go together.
    """
    if settings.mode == "network":
        return SequencePath(network, groups_of(bundle, lighting)) if lighting.sequence else network
    if has_lens(bundle):
        raise BundleError(
            f"{bundle.source} has {FILE_NAME}, and {settings.mode} mode measures in the distorted picture: use network "
            "mode, or the bundle without its lens"
        )
    model, kind = read_lights(bundle), _kind(settings, lighting)
    path = PhotometricReconstructor if lighting.light_mode == "hold" else WindowReconstructor
    return path(bundle, model, kind, smoothing_px=settings.smoothing_px)


def single_light_path(bundle: Bundle, settings: ReconstructionSettings, lighting: LightingSettings) -> SingleLightPath:
    """Return the frame path of a bundle with light groups of its own: GelNet, or least squares in photometric mode.

    Raises BundleError where the bundle does not tell its groups, ConfigError where mode or light do not go with it.
    """
    if lighting.sequence:
        raise ConfigError(
            f"{bundle.source} has a light sequence of its own, --sequence {lighting.sequence} does not go with it: "
            "leave it out"
        )
    return SingleLightPath(bundle, settings.mode, threads=settings.threads, smoothing_px=settings.smoothing_px)


def groups_of(bundle: Bundle, lighting: LightingSettings) -> NDArray[np.uint8]:
    """Return the light groups (n, 12, 3) that are set; BundleError where the bundle does not tell its own light."""
    if bundle.colours is None:
        raise BundleError(f"{bundle.source} does not tell the colours of its LEDs, which a sequence needs: calibrate")
    return chosen_groups(lighting.sequence, bundle.colours)


def _kind(settings: ReconstructionSettings, lighting: LightingSettings) -> LightGroups:
    """Return the light groups of photometric stereo; ConfigError for a sequence that it cannot use."""
    if not lighting.sequence:
        return LightGroups(settings.light_groups)
    if lighting.sequence not in KINDS:
        raise ConfigError(
            f"--sequence {lighting.sequence} does not go with --mode {settings.mode}: photometric mode takes rgb or "
            "single, network mode any"
        )
    return KINDS[lighting.sequence]


def tactile_camera(
    camera: Camera, bundle: Bundle, settings: ReconstructionSettings, lighting: LightingSettings = NO_SEQUENCE
) -> Camera:
    """Return the camera that takes what the mode needs: `camera` itself, or one that shows the light groups to it.

    Raises BundleError where the bundle does not know its lights, CameraError without a light ring, ConfigError where
    mode and light do not go together.
    """
    mode, light_mode = settings.mode, LightMode(lighting.light_mode)
    if has_single_lights(bundle):
        groups = read_directions(bundle).groups
        if light_mode is LightMode.HOLD:
            return SeriesCamera(camera, groups, exposure_us=None, frames=settings.frames_per_light)
        return WindowCamera(SequencedCamera(camera, groups, mode=light_mode), groups, exposure_us=None)
    if light_mode is not LightMode.HOLD and not (lighting.sequence or mode == "photometric"):
        raise ConfigError(f"--light-mode {light_mode} moves a sequence on: give --sequence, or --mode photometric")
    if mode == "network":
        return SequencedCamera(camera, groups_of(bundle, lighting), mode=light_mode) if lighting.sequence else camera
    model, kind = read_lights(bundle), _kind(settings, lighting)
    groups = model.groups(kind)
    if light_mode is not LightMode.HOLD:
        return _window_camera(camera, model, groups, light_mode)
    exposure = bright_exposure_us(camera, model)
    return SeriesCamera(camera, groups, exposure_us=exposure, frames=settings.frames_per_light)


def _window_camera(camera: Camera, model: LightModel, groups: NDArray[np.uint8], light_mode: LightMode) -> Camera:
    """Return the camera of the sliding window, as bright as it can be while every frame is of another light."""
    if camera.ring is None:
        raise CameraError(f"{camera.url} has no light ring that can be driven: use --mode network")
    timing = timing_of(camera)
    settle = settle_s(timing, clock_error_s(light_mode), leds=camera.ring.led_count)
    left_s = timing.period_s - timing.readout_s - settle
    longest_us = max(left_s, timing.exposure_s) * 1e6
    exposure = bright_exposure_us(camera, model, longest_us=longest_us)
    if exposure is not None:
        camera.adopt({EXPOSURE: exposure}, camera.ring.still)
    return WindowCamera(SequencedCamera(camera, groups, mode=light_mode), groups, exposure_us=exposure)


def bright_exposure_us(camera: Camera, model: LightModel, *, longest_us: float = LONGEST_US) -> float | None:
    """Return the exposure under which one LED of a colour is as bright as the camera can show it, at most `longest_us`.

    None where it cannot be set, or the model does not know at which exposure it was made.
    """
    controls = camera.controls
    if controls is None or EXPOSURE not in controls.names() or model.exposure_us is None:
        return None
    lowest, highest, step = controls.range(EXPOSURE)
    wanted = min(bright_exposure_of(model), highest, longest_us)
    stepped = lowest + floor((wanted - lowest) / step) * step if step else wanted
    return float(max(stepped, lowest))


def bright_exposure_of(model: LightModel) -> float:
    """Return the exposure, us, that makes the brightest pixel `BRIGHT_GREY`; ValueError where the model has none."""
    if model.exposure_us is None:
        raise ValueError("the light model does not know its exposure")
    return float(min(model.exposure_us * (BRIGHT_GREY / model.brightest_grey) ** model.gamma, LONGEST_US))
