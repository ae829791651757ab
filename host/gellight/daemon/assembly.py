"""Puts a running sensor together: camera, calibration, reconstruction and, where it can be, the self-check."""

from typing import get_args

from gellight.base.errors import InputError
from gellight.base.settings import GeometrySettings, ReconstructionSettings, Settings
from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.bundle.placeholder import placeholder
from gellight.bundle.store import BundleStore
from gellight.daemon.daemon import Daemon, Equipment
from gellight.daemon.installing import SIMULATED, bundle_of
from gellight.daemon.modes import frame_path, single_light_path, tactile_camera
from gellight.daemon.switched_camera import SwitchedCamera
from gellight.opening import open_camera
from gellight.reconstruction.picture_path import PicturePath
from gellight.reconstruction.pipeline import FramePath, Reconstructor
from gellight.series.single_light_path import has_single_lights
from gellight.watch.monitor import SensorWatch

MODES = get_args(ReconstructionSettings.model_fields["mode"].annotation)
AUTO = "auto"
"""Setting of the calibration that stands for whichever bundle belongs to the sensor."""


def open_session(settings: Settings, *, every: bool = False) -> Daemon:
    """Return the daemon (not yet started) of the sensor and the calibration that `settings` name.

    every: where the sensor is a file, its pictures wait for a reader that uses `Daemon.next_frame`.
    Raises CameraError, BoardError, InputError, ConfigError or BundleError; the camera is closed again, and its
    LEDs are dark, when something does not fit.
    """
    bundle = chosen_bundle(settings)
    camera = open_camera(settings.sensor.url, geometry=settings.geometry.overrides(), bundle=bundle)
    try:
        bundle.check_fits(camera.url, camera.image_shape)
        mode = settings.reconstruction.mode
        judgeable = bundle.calibrated and not (mode == "network" and settings.lighting.sequence)
        judge = camera.selfcheck(bundle.pixel_size_mm) if judgeable else None
        first = equipment(bundle, settings)
        camera = SwitchedCamera(camera, first.equip)
        return Daemon(
            camera,
            first.rebuild(bundle),
            selfcheck=judge,
            rebuild=first.rebuild,
            watch=SensorWatch(bundle, rezero=first.rezero) if first.watched else None,
            equipment=lambda used, other: equipment(used, in_mode(settings, other)),
            every=every,
            realtime=settings.service.realtime,
        )
    except BaseException:
        camera.close()
        raise


def equipment(bundle: Bundle, settings: Settings) -> Equipment:
    """Return what a sensor with `bundle` needs to run as `settings` say."""
    changing = settings.lighting.sequence or settings.reconstruction.mode != "network" or has_single_lights(bundle)
    return Equipment(
        equip=lambda camera: tactile_camera(camera, bundle, settings.reconstruction, settings.lighting),
        rebuild=lambda replacement: path_for(replacement, settings),
        watched=settings.watch.enabled and not changing and bundle.calibrated,
        rezero=settings.watch.rezero,
    )


def in_mode(settings: Settings, mode: str) -> Settings:
    """Return the settings with another mode; InputError for one that is not known.

    A light mode that moves a sequence on is that of photometric mode, and means nothing in the others without one.
    """
    if mode not in MODES:
        raise InputError(f"there is no mode {mode!r}: choose one of {', '.join(MODES)}")
    reconstruction = settings.reconstruction.model_copy(update={"mode": mode})
    lighting = settings.lighting
    if mode != "photometric" and not lighting.sequence:
        lighting = lighting.model_copy(update={"light_mode": "hold"})
    return settings.model_copy(update={"reconstruction": reconstruction, "lighting": lighting})


def chosen_bundle(settings: Settings) -> Bundle:
    """Return the bundle that `settings` name; "auto" asks the board of the sensor, which is opened for that.

    Where they name none it is that of the simulated sensor for `sim://`, and for a sensor that has none yet; for a
    sensor that is not like the simulated one it is one without a network. Raises BundleError for a bundle that is
    damaged or missing, else as `open_camera`.
    """
    named, url = settings.sensor.calibration, settings.sensor.url
    if named is None and url.startswith("sim://"):
        return _of_simulated(settings.geometry)
    if named is not None and named != AUTO:
        return load_bundle(named)
    with open_camera(url, geometry=settings.geometry.overrides()) as camera:
        bundle = bundle_of(camera, BundleStore(), default=SYNTHETIC if named is None else None)
        like_simulated = camera.bundle is not None or camera.ring is not None or camera.waits
        if named is None and bundle.manifest.sensor == SIMULATED and not like_simulated:
            return placeholder(camera.image_shape)
        return bundle


def _of_simulated(geometry: GeometrySettings) -> Bundle:
    """Return the bundle of the simulated sensor, or a placeholder where its pictures have another size."""
    bundle = load_bundle(SYNTHETIC)
    height, width = bundle.image_shape
    shape = geometry.image_height_px or height, geometry.image_width_px or width
    return bundle if shape == bundle.image_shape else placeholder(shape)


def path_for(bundle: Bundle, settings: Settings) -> FramePath:
    """Return the frame path of `bundle` in the mode that `settings` say; BundleError where it cannot be."""
    if not bundle.calibrated:
        return PicturePath(bundle)
    if has_single_lights(bundle):
        return single_light_path(bundle, settings.reconstruction, settings.lighting)
    return frame_path(bundle, settings.reconstruction, reconstructor_for(bundle, settings), settings.lighting)


def reconstructor_for(bundle: Bundle, settings: Settings) -> Reconstructor:
    """Return the frame path of GelNet with `bundle`, set as `settings` say."""
    chosen = settings.reconstruction
    return Reconstructor(
        bundle,
        threads=chosen.threads,
        smoothing_px=chosen.smoothing_px,
        masked=chosen.masked,
        cast_shadows=chosen.cast_shadows,
    )
