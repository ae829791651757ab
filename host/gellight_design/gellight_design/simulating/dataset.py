"""A data set of simulated presses, for training other people's networks: `gellight simulate dataset`.

The folder holds

    dataset.json         the sensor, the light, what was asked for; what each field of a press is
    reference.npz        images and light of the untouched gel
    presses/000000.npz   one press each: images, light, depth_mm, normals, pressure_mpa, contact, force_n
    index.csv            a row a press: file, object, depth_mm, x_mm, y_mm, force_n

docs/dataset.md describes shapes and units. A press depends on the seed and its number alone, so a data set can be
continued and extended, and is the same in the end.
"""

import json
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gellight
from gellight.base.csv_file import csv_text
from gellight.base.errors import InputError
from gellight.base.writing import make_folder, write_file
from gellight.bundle.contents import npz
from gellight.lab.simulator.scene import BRIGHTEST_GREY, Press, Scene
from gellight_design.simulating.choices import GelKind, LightKind
from gellight_design.simulating.gel_models import check_memory, gel_model
from gellight_design.simulating.processes import Progress, call_all
from sim_reference.camera import WHITE, CameraResponse, digitise
from sim_reference.deformation import Deformation
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.imaging import normals
from sim_reference.objects import OBJECT_NAMES

Array = NDArray[np.float64]
FORMAT = "gellight-dataset 2"
INDEX = ("file", "object", "depth_mm", "x_mm", "y_mm", "force_n")
DEPTH_STEP_MM = 0.05
"""between depths that are drawn, so that the gel is computed once for many presses"""
REFERENCE_PICTURES = 8
"""are averaged: the noise of the reference images is a third of that of a picture"""


@dataclass(frozen=True, kw_only=True)
class DatasetRequest:
    """What a data set holds. Lengths in mm."""

    presses: int
    objects: tuple[str, ...] = OBJECT_NAMES
    shallowest_mm: float = 0.2
    deepest_mm: float = 1.0
    spread_mm: float = 6.0
    """how far from the middle of the picture an object may be, along x and along y"""
    light: LightKind = "ring"
    gel: GelKind = "layer"
    resolution_mm: float = 0.3
    """of the finite elements"""
    noise_grey: float = 1.0
    seed: int = 0
    geometry: SensorGeometry = field(default_factory=SensorGeometry)

    def __post_init__(self) -> None:
        """Refuse what cannot be made."""
        unknown = sorted(set(self.objects) - set(OBJECT_NAMES))
        if unknown or not self.objects:
            raise InputError(f"no object {', '.join(unknown) or 'given'}: choose from {', '.join(OBJECT_NAMES)}")
        if not 0 < self.shallowest_mm <= self.deepest_mm <= self.geometry.deepest_press_mm:
            raise InputError(
                f"depths from {self.shallowest_mm:g} to {self.deepest_mm:g} mm cannot be pressed: give positive ones, "
                f"the shallowest first, up to {self.geometry.deepest_press_mm:g} mm, 60 % of the gel's "
                f"{self.geometry.gel_thickness_mm:g} mm"
            )

    def press(self, number: int) -> Press:
        """Draw one press; it depends on the seed and its number alone."""
        random = np.random.default_rng([self.seed, number])
        name = self.objects[random.integers(len(self.objects))]
        steps = np.arange(round(self.shallowest_mm / DEPTH_STEP_MM), round(self.deepest_mm / DEPTH_STEP_MM) + 1)
        depth = float(np.clip(random.choice(steps) * DEPTH_STEP_MM, self.shallowest_mm, self.deepest_mm))
        x, y = random.uniform(-self.spread_mm, self.spread_mm, 2).round(3).tolist()
        return Press(name, round(depth, 4), x, y)


@dataclass(frozen=True, kw_only=True)
class DatasetReport:
    """What was written."""

    folder: str
    presses: int
    megabytes: float


def make_dataset(
    request: DatasetRequest, folder: Path, workers: int = 1, progress: Progress = lambda *told: None
) -> DatasetReport:
    """Make the presses that are missing in `folder`, and the index.

    Raises InputError for a folder with another data set or one that cannot be written, and for a mesh that does not
    fit the memory, ValueError and NotConverged for what cannot be simulated.
    """
    if request.gel == "fem":
        check_memory(request.resolution_mm, request.geometry, workers)
    same = replace(request, presses=0)  # More presses do not change those that are there.
    numbers = range(request.presses)
    try:
        make_folder(folder / "presses")
        _describe(same, folder)
        missing = [number for number in numbers if not _press_file(folder, number).exists()]
        there = request.presses - len(missing)
        progress(there, request.presses, "")
        calls = [(str(folder.resolve()), same, number) for number in missing]
        done = count(there + 1)
        call_all(make_press, calls, workers, lambda at: progress(next(done), request.presses, str(missing[at])))
        write_file(folder / "index.csv", csv_text(INDEX, (_row(folder, same, number) for number in numbers)).encode())
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}): choose another --out") from error
    finally:
        _sensor.cache_clear()
    size = sum(path.stat().st_size for path in folder.rglob("*.npz"))
    return DatasetReport(folder=str(folder), presses=request.presses, megabytes=size / 1e6)


def make_press(folder: str, request: DatasetRequest, number: int) -> None:
    """Write a press."""
    sensor, press = _sensor(request), request.press(number)
    surface, deformation = sensor.scene.show(press)[1], sensor.scene.deformation(press)
    pressure_mpa = deformation.pressure * sensor.shear_modulus_mpa
    _write(
        _press_file(Path(folder), number),
        images=sensor.pictures(sensor.grey(press), np.random.default_rng([request.seed, number, 1])),
        light=np.float32(sensor.light),
        depth_mm=np.float32(surface.depth_mm),
        normals=np.float32(normals(surface.gradient_map)),
        pressure_mpa=_on_pixels(pressure_mpa, deformation, request.geometry, press),
        contact=surface.contact,
        force_n=round(float(pressure_mpa.sum()) * deformation.spacing_mm**2, 5),
    )


def _row(folder: Path, request: DatasetRequest, number: int) -> tuple[object, ...]:
    """Return the row of a press in the index."""
    path, press = _press_file(folder, number), request.press(number)
    with np.load(path) as fields:
        force_n = float(fields["force_n"])
    return f"presses/{path.name}", press.object_name, press.depth_mm, press.x_mm, press.y_mm, force_n


class _Sensor:
    """The simulated sensor of a data set: its scene, and the lights of one series of pictures."""

    def __init__(self, request: DatasetRequest) -> None:
        response = CameraResponse(noise_grey=request.noise_grey)
        self.scene = Scene(request.geometry, response, model=gel_model(request.gel, request.resolution_mm))
        self.light = _lights(request.light, self.scene.light)
        self.shear_modulus_mpa = FemGel().youngs_modulus_mpa / 2 / (1 + request.geometry.poisson_ratio)
        brightest = max(float(self.scene.show(None, light)[0].max()) for light in self.light)
        response = self.scene.response
        self.scene.response = replace(response, exposure=response.exposure * BRIGHTEST_GREY / brightest)

    def grey(self, press: Press | None) -> NDArray[np.float32]:
        """(K, H, W, 3) one picture a light before noise, grey levels."""
        return np.stack([self.scene.show(press, light)[0] for light in self.light])

    def pictures(self, grey: NDArray[np.float32], random: np.random.Generator) -> NDArray[np.uint8]:
        """(K, H, W, 3) uint8 one picture a light, each with noise of its own."""
        return np.stack([digitise(one, self.scene.response.noise_grey, random) for one in grey])


@lru_cache(maxsize=2)
def _sensor(request: DatasetRequest) -> _Sensor:
    return _Sensor(request)


def _lights(kind: LightKind, ring: Array) -> Array:
    """(K, N, 3) brightness of each LED in each picture, 0 to 1."""
    if kind == "ring":
        return ring[None]
    return np.repeat(np.eye(len(ring))[:, :, None], 3, axis=2)


def _on_pixels(pressure_mpa: Array, deformation: Deformation, geometry: SensorGeometry, press: Press) -> Any:
    """(H, W) float32 pressure on the camera's pixels, of the nearest point of the object's grid."""
    x, y = pixel_grid(geometry)
    middle = (len(pressure_mpa) - 1) / 2
    columns, rows = (
        np.rint((at - centre) / deformation.spacing_mm + middle).astype(int)
        for at, centre in ((x.ravel(), press.x_mm), (y.ravel(), press.y_mm))
    )
    inside = [(at >= 0) & (at < len(pressure_mpa)) for at in (rows, columns)]
    result = np.zeros(geometry.image_shape, np.float32)
    result[np.ix_(*inside)] = pressure_mpa[np.ix_(rows[inside[0]], columns[inside[1]])]
    return result


def _describe(request: DatasetRequest, folder: Path) -> None:
    """Write dataset.json and the reference images; raises InputError where the folder holds another data set."""
    said = {name: value for name, value in asdict(request).items() if name != "presses"}
    described = {
        "format": FORMAT,
        "gellight": gellight.__version__,
        "request": said,
        "pixel_size_mm": request.geometry.pixel_size_mm,
    }
    path = folder / "dataset.json"
    if path.exists():
        _check_same(path, json.loads(json.dumps(described)))
    else:
        write_file(path, json.dumps(described, indent=2).encode())
    if not (folder / "reference.npz").exists():
        sensor, random = _sensor(request), np.random.default_rng([request.seed, 0, 2])
        grey = sensor.grey(None)
        taken = [sensor.pictures(grey, random) for _ in range(REFERENCE_PICTURES)]
        mean = np.rint(np.mean(taken, axis=0)).clip(0, WHITE).astype(np.uint8)
        _write(folder / "reference.npz", images=mean, light=np.float32(sensor.light))


def _check_same(path: Path, described: dict[str, Any]) -> None:
    try:
        there = json.loads(path.read_bytes())
        if there == described:
            return
        known = there.get("request", {}) if isinstance(there, dict) else {}
        wanted = described["request"]
        other = [name for name in {**wanted, **known} if known.get(name) != wanted.get(name)]
    except ValueError:
        other = ["dataset.json"]
    how = f"another {', '.join(other)}" if other else "made by another version"
    raise InputError(f"{path.parent} holds another data set ({how}): choose another --out")


def _press_file(folder: Path, number: int) -> Path:
    return folder / "presses" / f"{number:06}.npz"


def _write(path: Path, **fields: Any) -> None:
    write_file(path, npz(fields))
