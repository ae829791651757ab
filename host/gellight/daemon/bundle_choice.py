"""Which bundle belongs to a sensor: the one that the settings or its board name, or the one in service for it."""

from urllib.parse import parse_qsl, urlsplit

import numpy as np

from gellight.base.errors import BundleError
from gellight.base.settings import GeometrySettings, Settings
from gellight.bundle.bundle import SYNTHETIC, Bundle, load_bundle
from gellight.bundle.manifest import METRICS
from gellight.bundle.store import BundleStore
from gellight.frames.camera import Camera


def placeholder(image_shape: tuple[int, int]) -> Bundle:
    """Return a bundle for pictures (H, W) that has no network, in memory only; its reference image is black.

    The light is that of the simulated sensor's bundle, for a sensor with our ring. Nothing in it was measured: a pixel
    counts as 1 mm.
    """
    manifest = load_bundle(SYNTHETIC).manifest.model_copy(
        update={
            "sensor": "not calibrated",
            "image_width_px": image_shape[1],
            "image_height_px": image_shape[0],
            "pixel_size_mm": (1.0, 1.0),
            "gel_thickness_mm": 0.0,
        }
    )
    empty = Bundle(manifest=manifest, files={METRICS: b"{}", manifest.network: b""}, source="no calibration")
    return empty.with_reference(np.zeros((*image_shape, 3)), frames=1)


AUTO = "auto"
"""Setting of the calibration that stands for whichever bundle belongs to the sensor."""
SIMULATED = "simulated"
"""Sensor of the bundle that comes with GelLight."""


class BundleChoice:
    """Chooses the bundle of a camera as soon as its board can be asked, so that it is opened once, and keeps it.

    Where the settings name none it is that of the simulated sensor for `sim://`, and for a sensor that has none yet; a
    sensor that is not like the simulated one has none, and `bundle` stays None.
    """

    bundle: Bundle | None = None

    def __init__(self, settings: Settings) -> None:
        """Load what the settings name; BundleError for a bundle that is damaged or missing."""
        self._named = named = settings.sensor.calibration
        if named is None and settings.sensor.url.startswith("sim://") and not _drawn(settings.sensor.url):
            self.bundle = _of_simulated(settings.geometry)
        elif named is not None and named != AUTO:
            self.bundle = load_bundle(named)

    def __call__(self, camera: Camera) -> Bundle | None:
        """Return the bundle; `camera` need not be open yet, but for its board. BundleError where it cannot be had."""
        if self.bundle is None:
            bundle = bundle_of(camera, BundleStore(), default=SYNTHETIC if self._named is None else None)
            like_simulated = camera.bundle is not None or camera.ring is not None
            if self._named is not None or bundle.manifest.sensor != SIMULATED or like_simulated:
                self.bundle = bundle
        if self._named is None and self.bundle is not None and self.bundle.image_shape == camera.image_shape:
            self.bundle = self.bundle.with_files(camera.picture_files) if camera.picture_files else self.bundle
        return self.bundle


def _drawn(url: str) -> bool:
    """Whether a simulated sensor is drawn from a bundle, which then comes with its frames."""
    return "bundle" in dict(parse_qsl(urlsplit(url).query))


def _of_simulated(geometry: GeometrySettings) -> Bundle:
    """Return the bundle of the simulated sensor, or a placeholder where its pictures have another size."""
    bundle = load_bundle(SYNTHETIC)
    height, width = bundle.image_shape
    shape = geometry.image_height_px or height, geometry.image_width_px or width
    return bundle if shape == bundle.image_shape else placeholder(shape)


def sensor_name(camera: Camera) -> str:
    """Return the serial number of the board of a sensor, by which its bundles are known.

    Where it has none it is the simulated sensor's name, or the URL without its parameters.
    """
    if camera.ring is not None:
        return camera.ring.hello.unique_id.hex().upper()
    return SIMULATED if camera.url.startswith("sim://") else camera.url.partition("?")[0]


def bundle_of(camera: Camera, store: BundleStore, *, default: str | None = None) -> Bundle:
    """Return the bundle of the sensor behind a camera: the one its board names, else the one in service for it.

    That of a recording came with its frames.
    default: names the bundle of a sensor that has none yet; for the simulated sensor it is the one that comes with
    GelLight. Raises BundleError where there is none, or where the bundle that the board names is of another sensor.
    """
    if camera.bundle is not None:
        return camera.bundle
    sensor = sensor_name(camera)
    identity = camera.ring.configuration().bundle if camera.ring is not None else b""
    if any(identity) and set(identity) != {0xFF}:
        try:
            bundle = store.find(identity.hex()).load()
        except BundleError as error:
            raise BundleError(
                f"the board of sensor {sensor} names bundle {identity.hex()}, which cannot be had here ({error}): "
                "bring it with `gellight calibrate install`, or calibrate the sensor again"
            ) from error
        check_sensor(bundle, sensor)
        return bundle
    if camera.url.startswith("sim://"):
        default = SYNTHETIC
    if default is not None and sensor not in store.sensors():
        return load_bundle(default)
    return store.current(sensor).load()


def check_sensor(bundle: Bundle, sensor: str) -> None:
    """Raise BundleError for a bundle of another sensor."""
    if bundle.manifest.sensor != sensor:
        raise BundleError(
            f"{bundle.source} is the bundle of sensor {bundle.manifest.sensor!r}, this is {sensor!r}: nothing was "
            "replaced; calibrate this sensor, or give the bundle of this one"
        )
