"""The calibration bundle of one sensor: a folder, the same as one `.gelcal` file, or the name "synthetic".

manifest.toml    what the sensor is and the SHA-256 of every other file
reference.png    16-bit RGB, grey level * 256: the mean of many frames of the untouched gel keeps its fraction
network.onnx     GelNet (its file name is in the manifest)
metrics.json     measured error of the network
presses.npz      the table of ball presses it was trained on (optional)
lights.json      the light of each LED alone, for photometric stereo (optional)
directions.npz   lights shown one after the other: a vector for each, and their groups (optional)
picture.json     what is done to each picture first: view, marker dots (optional)
lens.json        the distortion of the camera, measured with a grid of pins (optional)
force.json       the constant that turns depth into newtons (optional)
report.html      all that its calibration measured, as a page (optional)
"""

from __future__ import annotations

import errno
import hashlib
import importlib.util
import io
import json
import logging
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Required, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, first_line
from gellight.base.writing import write_folder
from gellight.bundle.contents import (
    UNZIPPING,
    arrays_of,
    check_archive,
    decoded_reference,
    encoded_reference,
    npz,
    read_file,
)
from gellight.bundle.manifest import (
    AGAIN,
    CAPTURE_OPTIONS,
    MANIFEST,
    METRICS,
    REFERENCE,
    Control,
    Manifest,
    checked_manifest,
    manifest_toml,
    parse_manifest,
    read_metrics,
)
from gellight.bundle.manifest import LedSetting as LedSetting  # part of what a caller of `write_bundle` needs

logger = logging.getLogger(__name__)

SYNTHETIC = "synthetic"
"""Name of the bundle of the simulated sensor that comes with GelLight."""
SUFFIX = ".gelcal"
REPORT = "report.html"

OTHER_UNITS = "learnt_on_other_units"
"""in the metrics of a starter bundle: the names of the sensors whose presses it learnt from"""
_PRESSES = "presses.npz"


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """A bundle that was checked: every checksum, every size."""

    manifest: Manifest
    files: Mapping[str, bytes]
    """content by file name, without the manifest"""
    source: str
    """where it was loaded from, for messages"""

    def __repr__(self) -> str:
        """Return sensor, identity, size and place in one line."""
        height, width = self.image_shape
        return f"<Bundle {self.identity} of sensor {self.manifest.sensor}, {width}x{height}, {self.source}>"

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.manifest.image_height_px, self.manifest.image_width_px

    @property
    def pixel_size_mm(self) -> tuple[float, float]:
        """(x, y)"""
        return self.manifest.pixel_size_mm

    @property
    def network(self) -> bytes:
        """The ONNX file."""
        return self.files[self.manifest.network]

    @property
    def calibrated(self) -> bool:
        """Whether it has a network; the placeholder of a new sensor has none."""
        return bool(self.network)

    @cached_property
    def reference(self) -> NDArray[np.float32]:
        """(H, W, 3) RGB, grey levels with fraction: the mean image of the untouched gel."""
        image = decoded_reference(self.files[REFERENCE], self.image_shape, self.source)
        image.flags.writeable = False
        return image

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """Measured error of the network, as written by the calibration."""
        return read_metrics(self.files[METRICS], self.source)

    @property
    def controls(self) -> dict[str, float]:
        """The controls that the camera has to be set to, by name; how it is opened (format, rate, ...) is left out.

        Raises BundleError for a value that is no number.
        """
        found = {name: value for name, value in self.manifest.camera.items() if name not in CAPTURE_OPTIONS}
        for name, value in found.items():
            if isinstance(value, bool | str):
                raise BundleError(f"{self.source}: {MANIFEST}: camera.{name} = {value!r} is no number: {AGAIN}")
        return {name: float(value) for name, value in found.items()}

    @property
    def colours(self) -> NDArray[np.uint8] | None:
        """(12, 3) RGB of the LEDs while the sensor was calibrated; None where the bundle does not tell them."""
        return np.array([led.rgb for led in self.manifest.led], np.uint8) if self.manifest.led else None

    @property
    def identity(self) -> str:
        """16 hexadecimal digits; see `Manifest.identity`."""
        return self.manifest.identity

    def check_fits(self, camera: str, image_shape: tuple[int, int]) -> None:
        """Raise BundleError unless the images (H, W) of `camera` have the size of this bundle's."""
        if image_shape != self.image_shape:
            raise BundleError(
                f"{camera} delivers {image_shape[1]}x{image_shape[0]} pixels, the calibration {self.source} is for "
                f"{self.image_shape[1]}x{self.image_shape[0]}: choose the bundle of this sensor"
            )

    def with_reference(self, reference: NDArray[np.floating], *, frames: int) -> Bundle:
        """Return this bundle with another reference image, (H, W, 3) RGB, the mean of `frames` frames; in memory only.

        Raises BundleError for grey levels outside 0 to 255 and ValueError for another shape.
        """
        if reference.shape != (*self.image_shape, 3):
            raise ValueError(f"reference image has shape {reference.shape}: give {(*self.image_shape, 3)}")
        other = self.with_files({REFERENCE: encoded_reference(reference)})
        return replace(other, manifest=other.manifest.model_copy(update={"reference_frames": frames}))

    def with_files(self, files: Mapping[str, bytes]) -> Bundle:
        """Return this bundle with more files, by name, or newer ones of the same names; in memory only."""
        content = {**self.files, **files}
        manifest = self.manifest.model_copy(update={"files": _digests(content)})
        return Bundle(manifest=manifest, files=content, source=self.source)

    def presses(self) -> dict[str, NDArray[Any]]:
        """The arrays of `presses.npz`; raises BundleError where the bundle has none."""
        if _PRESSES not in self.files:
            raise BundleError(f"{self.source} has no {_PRESSES}: calibrate the sensor again to record presses")
        try:
            return arrays_of(self.files[_PRESSES])
        except UNZIPPING as error:
            raise BundleError(f"{self.source}: {_PRESSES} cannot be read ({first_line(error)}): {AGAIN}") from error


def load_bundle(path: str | Path) -> Bundle:
    """Load and check a bundle: a folder, a `.gelcal` file, or "synthetic" for the simulated sensor.

    Raises BundleError, saying what is wrong and what to do, unless every checksum and size is right.
    """
    place = _synthetic_folder() if str(path) == SYNTHETIC else Path(path)
    if place.is_dir():
        return _load(str(place), lambda name: read_file(place / name))
    if not place.exists():
        raise BundleError(f"calibration bundle {place} does not exist: give a folder, a {SUFFIX} file or '{SYNTHETIC}'")
    if not place.is_file():
        raise BundleError(f"calibration bundle {place} is a pipe or a device: give a folder or a {SUFFIX} file")
    return _unpacked(place, str(place))


def unpack_bundle(content: bytes, source: str) -> Bundle:
    """Load and check a bundle from the content of a `.gelcal` file that came from `source`; raises BundleError."""
    return _unpacked(io.BytesIO(content), source)


def _unpacked(packed: Path | io.BytesIO, source: str) -> Bundle:
    try:
        with zipfile.ZipFile(packed) as archive:
            check_archive(archive, source)
            return _load(source, archive.read)
    except UNZIPPING as error:
        raise BundleError(f"{source} is not a whole {SUFFIX} file ({first_line(error)}): {AGAIN}") from error


class Description(TypedDict, total=False):
    """What the caller of `write_bundle` says about the sensor, by the names of the manifest."""

    sensor: Required[str]
    name: str
    reference_frames: Required[int]
    noise_grey: Required[float]
    rest_grey: float
    pixel_size_mm: Required[tuple[float, float]]
    follow_light: bool
    level_plane: bool
    skirt_share: float
    light_by_depth: bool
    gel_thickness_mm: float
    camera_height_mm: float
    bulge: float
    led: tuple[LedSetting, ...]
    camera: Mapping[str, Control]


def write_bundle(
    folder: str | Path,
    *,
    reference: NDArray[np.floating],
    network: bytes,
    metrics: Mapping[str, Any],
    network_name: str = "network.onnx",
    presses: Mapping[str, NDArray[Any]] | None = None,
    extra_files: Mapping[str, bytes] | None = None,
    overwrite: bool = False,
    **description: Unpack[Description],
) -> Bundle:
    """Write a bundle as a folder, whole or not at all, and return it as it will be loaded.

    reference: (H, W, 3) RGB, grey levels 0 to 255. presses: the arrays of `presses.npz`. The rest is described at
    `Manifest`. An existing bundle is replaced only with `overwrite`. Raises BundleError; then the folder is as
    before.
    """
    files = {
        **(extra_files or {}),
        REFERENCE: encoded_reference(reference),
        METRICS: (json.dumps(metrics, indent=2, sort_keys=True, allow_nan=False) + "\n").encode(),
        network_name: network,
        **({_PRESSES: npz(_finite(presses))} if presses is not None else {}),
    }
    manifest = checked_manifest(
        folder,
        created=datetime.now(UTC).replace(microsecond=0),
        software=_software(),
        image_width_px=reference.shape[1],
        image_height_px=reference.shape[0],
        network=network_name,
        files=_digests(files),
        **description,
    )
    return save_bundle(Bundle(manifest=manifest, files=files, source=str(folder)), folder, overwrite)


def save_bundle(bundle: Bundle, folder: str | Path, overwrite: bool = False) -> Bundle:
    """Write a bundle as a folder and return it as it will be loaded; otherwise as `write_bundle`."""
    target = Path(folder)
    if target.exists() and not overwrite:
        raise BundleError(f"calibration bundle {target} exists: choose another name or allow overwriting")
    try:
        write_folder(target, {**bundle.files, MANIFEST: manifest_toml(bundle.manifest)})
    except OSError as error:
        raise _not_written(target, error) from error
    return load_bundle(target)


def extend_bundle(bundle: Bundle, folder: str | Path, files: Mapping[str, bytes], *, overwrite: bool = False) -> Bundle:
    """Write a bundle again as a folder with more files, or newer ones of the same names, and return it.

    Raises BundleError; then the folder is as before.
    """
    return save_bundle(bundle.with_files(files), folder, overwrite)


def packed_bundle(bundle: Bundle) -> bytes:
    """Return the content of a `.gelcal` file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(MANIFEST, manifest_toml(bundle.manifest))
        for name, content in bundle.files.items():
            archive.writestr(name, content)
    return packed.getvalue()


def _synthetic_folder() -> Path:
    """The bundle beside the `gelnet` package, which is found without importing it."""
    spec = importlib.util.find_spec("gelnet")
    places = list(spec.submodule_search_locations or []) if spec else []
    for place in places:
        if (Path(place) / SYNTHETIC / MANIFEST).is_file():
            return Path(place) / SYNTHETIC
    raise BundleError(
        f"the '{SYNTHETIC}' bundle is not installed (looked in {places or 'no gelnet package'}): reinstall gellight"
    )


def _load(source: str, read: Callable[[str], bytes]) -> Bundle:
    """Read the manifest, then every file it names."""
    manifest = parse_manifest(_read(source, read, MANIFEST), source)
    files = {name: _verified(source, read, name, digest) for name, digest in manifest.files.items()}
    bundle = Bundle(manifest=manifest, files=files, source=source)
    bundle.reference  # noqa: B018  (decoded now, so that a broken one is an error of loading)
    bundle.metrics  # noqa: B018  (as well)
    return bundle


def _read(source: str, read: Callable[[str], bytes], name: str) -> bytes:
    try:
        return read(name)
    except (KeyError, FileNotFoundError) as error:
        raise BundleError(f"{source} has no {name}: it is not a whole calibration bundle; {AGAIN}") from error
    except UNZIPPING as error:
        raise BundleError(f"{source}: {name} cannot be read ({first_line(error)}): {AGAIN}") from error


def _verified(source: str, read: Callable[[str], bytes], name: str, digest: str) -> bytes:
    content = _read(source, read, name)
    found = hashlib.sha256(content).hexdigest()
    if found != digest:
        raise BundleError(
            f"{source}: {name} was changed after calibration (SHA-256 is {found[:12]}…, the manifest says "
            f"{digest[:12]}…): {AGAIN}"
        )
    return content


def _digests(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())}


def _software() -> str:
    try:
        return f"gellight {version('gellight')}"
    except PackageNotFoundError:
        return "gellight (not installed)"


def _finite(presses: Mapping[str, NDArray[Any]]) -> Mapping[str, NDArray[Any]]:
    for name, values in presses.items():
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise BundleError(f"{_PRESSES}: {name} has NaN or infinite values: drop those presses")
    return presses


def _not_written(target: Path, error: OSError) -> BundleError:
    remedy = "free some space" if error.errno == errno.ENOSPC else "check the folder and its permissions"
    logger.debug("writing %s failed", target, exc_info=error)
    return BundleError(f"{target} was not written ({error.strerror or error}): {remedy} and try again")
