"""The three ways a sensor feels: which camera and which frame path each of them needs."""

from math import floor

from gellight.base.errors import BundleError
from gellight.base.settings import ReconstructionSettings
from gellight.bundle.bundle import Bundle
from gellight.frames.camera import Camera
from gellight.reconstruction.lens.lens_file import FILE_NAME, has_lens
from gellight.reconstruction.photometric.hybrid import HybridReconstructor
from gellight.reconstruction.photometric.light_model import LightGroups, LightModel
from gellight.reconstruction.photometric.lights_file import read_lights
from gellight.reconstruction.photometric.reconstructor import PhotometricReconstructor
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.sensor.series_cameras import EXPOSURE, RestingCamera, SeriesCamera

BRIGHT_GREY = 225.0
"""of the brightest pixel of the untouched gel under one light group"""
LONGEST_US = 30_000.0
"""a camera of 30 frames a second cannot expose longer without becoming slower"""
UNRAISED_FRAMES = 8
"""frames of each light group in hybrid mode where the exposure cannot be raised: single LEDs are dim"""


def frame_path(bundle: Bundle, settings: ReconstructionSettings, network: Reconstructor) -> FramePath:
    """Return the frame path of the mode that is set; `network` is that of GelNet mode.

    Raises BundleError where the bundle does not know its lights, or has a lens, which only GelNet's maps are
    freed of.
    """
    if settings.mode == "network":
        return network
    if has_lens(bundle):
        raise BundleError(
            f"{bundle.source} has {FILE_NAME}, and {settings.mode} mode measures in the distorted picture: use network "
            "mode, or the bundle without its lens"
        )
    model, kind = read_lights(bundle), LightGroups(settings.light_groups)
    stereo = PhotometricReconstructor(bundle, model, kind, smoothing_px=settings.smoothing_px)
    return stereo if settings.mode == "photometric" else HybridReconstructor(network, stereo)


def tactile_camera(camera: Camera, bundle: Bundle, settings: ReconstructionSettings) -> Camera:
    """Return the camera that takes what the mode needs: `camera` itself, or one that shows the light groups to it.

    Raises BundleError where the bundle does not know its lights, CameraError without a light ring.
    """
    if settings.mode == "network":
        return camera
    model = read_lights(bundle)
    groups, exposure = model.groups(LightGroups(settings.light_groups)), bright_exposure_us(camera, model)
    frames = settings.frames_per_light
    if settings.mode == "photometric":
        return SeriesCamera(camera, groups, exposure_us=exposure, frames=frames)
    return RestingCamera(
        camera,
        groups,
        exposure_us=exposure,
        frames=frames if exposure else max(frames, UNRAISED_FRAMES),
        untouched=bundle.reference,
        noise_grey=bundle.manifest.noise_grey,
    )


def bright_exposure_us(camera: Camera, model: LightModel) -> float | None:
    """Return the exposure under which one LED of a colour is as bright as the camera can show it, at most `LONGEST_US`.

    None where it cannot be set, or the model does not know at which exposure it was made.
    """
    controls = camera.controls
    if controls is None or EXPOSURE not in controls.names() or model.exposure_us is None:
        return None
    lowest, highest, step = controls.range(EXPOSURE)
    wanted = min(bright_exposure_of(model), highest)
    stepped = lowest + floor((wanted - lowest) / step) * step if step else wanted
    return float(max(stepped, lowest))


def bright_exposure_of(model: LightModel) -> float:
    """Return the exposure, us, that makes the brightest pixel `BRIGHT_GREY`; ValueError where the model has none."""
    if model.exposure_us is None:
        raise ValueError("the light model does not know its exposure")
    return float(min(model.exposure_us * (BRIGHT_GREY / model.brightest_grey) ** model.gamma, LONGEST_US))
