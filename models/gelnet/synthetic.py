"""Make GelNet for the simulated sensor: `python -m gelnet.synthetic --out DIR`.

Presses balls into the simulated gel all over the view, photographs their slopes with a simulated camera, as if all of
the gel lay at the depth of the gel at rest, trains on them, and writes DIR/network.onnx, training.json, reference.npy
and provenance.json, all or none. The host takes off what depth and shadows do to the light, and makes the bundle:
`python -m tests.helpers.simulated_bundle`.
"""

import argparse
import hashlib
import json
import platform
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from gelnet.export import ExportError
from gelnet.recipes import RECIPES, Recipe
from gelnet.table import Table, TableError, checked
from gelnet.train import add_training_options
from gelnet.trainers import make_trainer
from gelnet.training import Trainer, normal_error_deg, print_progress, record_of, train, write
from sim_reference import gel
from sim_reference.camera import WHITE, CameraResponse, digitise, exposure_for, linear_grey
from sim_reference.deformation import GelModel
from sim_reference.geometry import AS_BUILT, SensorGeometry, pixel_grid
from sim_reference.imaging import direct_light, ring_irradiance, ring_light
from sim_reference.objects import ObjectParameters
from sim_reference.surface import Surface, press_object, sample, untouched
from sim_reference.view import falloff

Floats = NDArray[np.float32]

BRIGHTEST_GREY = 200.0
"""of the untouched gel, as the simulated sensor of the host exposes it"""
REFERENCE_FRAMES = 100
SEEDS = {"training": 1, "validation": 2}
"""Test presses have their own seed, in the host."""
SEEN = "perspective", "window", "obliquity"
_TOUCHED_SLOPE = 2e-3


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is pressed and how much of it is learnt; chosen on the validation presses, see the model card."""

    presses: int = 600
    places: int = 1
    """at which each pressed ball is photographed; more than one where pressing takes long"""
    rows_per_press: int = 2500
    """of a picture"""
    flat_share: float = 0.05
    """of a press's rows, from pixels where the gel is flat"""
    contact_share: float = 0.5
    """of a press's rows, from pixels in contact; the rest is from the gel that sinks around it"""
    main_radius_mm: float = 4.0
    other_share: float = 0.5
    """of the presses, with balls of other radii"""
    other_radii_mm: tuple[float, float] = (1.0, 12.0)
    """log-uniform"""
    deepest_mm: float = 3.0
    recipe: str = "fine"
    epochs: int | None = None
    """instead of the recipe's number"""

    def how(self) -> Recipe:
        """Return the recipe, of so many epochs."""
        recipe = RECIPES[self.recipe]
        return recipe if self.epochs is None else replace(recipe, epochs=self.epochs)


@dataclass(frozen=True, eq=False)
class Sensor:
    """The simulated sensor, exposed."""

    geometry: SensorGeometry
    response: CameraResponse
    light: NDArray[np.float64]
    """(12, 3)"""
    reference: Floats
    """(H, W, 3) mean of REFERENCE_FRAMES frames of the untouched gel, grey levels"""


def simulated_sensor(geometry: SensorGeometry, *, seed: int) -> Sensor:
    """Expose the untouched gel and take its reference image."""
    light = ring_light(geometry)
    irradiance = ring_irradiance(untouched(geometry), geometry, light)
    response = CameraResponse()
    response = replace(response, exposure=exposure_for(irradiance, response, BRIGHTEST_GREY))
    grey = linear_grey(irradiance, response).astype(np.float32)
    random = np.random.default_rng([seed, 0])
    total = np.zeros(grey.shape, np.float64)
    for _ in range(REFERENCE_FRAMES):
        total += digitise(grey, response.noise_grey, random)
    return Sensor(geometry, response, light, (total / REFERENCE_FRAMES).astype(np.float32))


def table_of_presses(
    sensor: Sensor, options: Options, *, count: int, noise_grey: float | None, seed: int, model: GelModel = gel.press
) -> Table:
    """Press `count` balls at random into a gel and return their labelled pixels, photographed with this noise.

    Without noise the colours are not rounded either. The network learns from such pictures: learnt from noisy colours
    it answers the most probable slope, which flattens gentle slopes and with them the depth; the host averages noise
    over neighbouring slopes instead. Each picture is an image of the table. Raises what the model of the gel raises.
    """
    random = np.random.default_rng(seed)
    parts = [part for _ in range(count) for part in _rows_of_press(sensor, options, noise_grey, random, model)]
    height, width = sensor.geometry.image_shape
    return checked(
        np.concatenate(parts),
        np.repeat(np.arange(len(parts), dtype=np.int32), [len(part) for part in parts]),
        np.array([width, height]),
        name="the simulated presses",
    )


def _rows_of_press(
    sensor: Sensor, options: Options, noise_grey: float | None, random: np.random.Generator, model: GelModel
) -> list[Floats]:
    """Press one ball and photograph it at random places; return (n, 7) rows of each picture."""
    geometry = sensor.geometry
    radius = options.main_radius_mm
    if random.random() < options.other_share:
        radius = float(np.exp(random.uniform(*np.log(options.other_radii_mm))))
    depth = random.uniform(0.05, min(options.deepest_mm, radius))
    view_mm = np.array(geometry.image_shape[::-1]) * geometry.pixel_size_mm
    places = random.uniform(-0.5, 0.5, (options.places, 2)) * view_mm
    parameters = ObjectParameters(calibration_ball_radius_mm=radius)
    deformation = press_object("BALL", depth, geometry, parameters=parameters, model=model)
    surfaces = (sample(deformation, geometry, x, y) for x, y in places.tolist())
    return [_rows_of_picture(sensor, surface, options, noise_grey, random) for surface in surfaces]


def _rows_of_picture(
    sensor: Sensor, surface: Surface, options: Options, noise_grey: float | None, random: np.random.Generator
) -> Floats:
    """Photograph the slopes of a surface, all at the depth of the gel at rest; return some pixels as (n, 7) rows."""
    chosen = _chosen_pixels(surface.gradient_map, surface.contact, options, random)
    row, column = np.divmod(chosen, sensor.geometry.image_width_px)
    slopes = surface.gradient_map[row, column]
    grey = linear_grey(_level_light(sensor, column, row, slopes), sensor.response).astype(np.float32)
    shown = grey.clip(0, WHITE) if noise_grey is None else digitise(grey, noise_grey, random)
    return np.column_stack([shown - sensor.reference[row, column], column, row, slopes]).astype(np.float32)


def _level_light(
    sensor: Sensor, column: NDArray[np.intp], row: NDArray[np.intp], slopes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the light (n, 3) that slopes (n, 2) show in pixels at the depth of the gel at rest."""
    geometry, total = sensor.geometry, np.zeros((len(column), 3))
    x, y = (axis.ravel()[at] for axis, at in zip(pixel_grid(geometry), (column, row), strict=True))
    for led, colour in enumerate(sensor.light):
        total += direct_light(geometry, led, x, y, np.zeros(len(x)), slopes)[0][:, None] * colour
    return total * falloff(geometry)[row, column, None] if geometry.perspective else total


def _chosen_pixels(
    gradient_map: NDArray[np.float64], contact: NDArray[np.bool_], options: Options, random: np.random.Generator
) -> NDArray[np.intp]:
    """Draw pixels in contact, beside it and far from it, in the shares of the options."""
    sloped = np.abs(gradient_map).max(axis=2) > _TOUCHED_SLOPE
    n = options.rows_per_press
    wanted = (
        (contact, options.contact_share),
        (sloped & ~contact, 1 - options.contact_share - options.flat_share),
        (~sloped & ~contact, options.flat_share),
    )
    drawn = []
    for mask, share in wanted:
        pixels = np.flatnonzero(mask)
        drawn.append(random.choice(pixels, min(len(pixels), round(n * share)), replace=False))
    return np.concatenate(drawn)


def geometry_hash(geometry: SensorGeometry, response: CameraResponse) -> str:
    """Return the SHA-256 of every number that describes the simulated sensor; the exposure follows from them.

    Of how it is seen what is not there is left out: so it was while nothing else could be.
    """
    described = {name: value for name, value in asdict(geometry).items() if value or name not in SEEN}
    numbers = {"geometry": described, "camera": asdict(response) | {"exposure": None}, "grey": BRIGHTEST_GREY}
    text = json.dumps(numbers, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def make(options: Options, trainer: Trainer, *, width: int, seed: int, out: Path) -> dict[str, Any]:
    """Press, train, measure on validation presses and write the files; returns the provenance."""
    sensor = simulated_sensor(AS_BUILT, seed=seed)
    training, validation = (
        table_of_presses(sensor, options, count=count, noise_grey=noise, seed=SEEDS[name] + 1000 * seed)
        for name, count, noise in (
            ("training", options.presses, None),
            ("validation", max(2, options.presses // 10), sensor.response.noise_grey),
        )
    )
    recipe = options.how()
    trained = train(training, recipe, trainer, width=width, progress=print_progress)
    record = record_of(options.recipe, recipe, width, seed, trained, training)
    provenance = _provenance(options, sensor, trained.network, validation, width=width, seed=seed)
    with tempfile.TemporaryDirectory(prefix=".synthetic-", dir=_made(out)) as place:
        partial = Path(place)
        np.save(partial / "reference.npy", sensor.reference)
        (partial / "provenance.json").write_text(json.dumps(provenance, indent=2) + "\n")
        write(trained.network, record, training, partial)
        for file in sorted(partial.iterdir()):
            file.replace(out / file.name)
    return provenance


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _provenance(
    options: Options, sensor: Sensor, network: Trainer, validation: Table, *, width: int, seed: int
) -> dict[str, Any]:
    return {
        "command": f"python -m gelnet.synthetic --trainer {network.version.split()[0]} --recipe {options.recipe} "
        f"--width {width} --seed {seed}",
        "options": asdict(options),
        "sensor_sha256": geometry_hash(sensor.geometry, sensor.response),
        "geometry": asdict(sensor.geometry),
        "camera": asdict(sensor.response),
        "light": sensor.light.tolist(),
        "reference_frames": REFERENCE_FRAMES,
        "validation_normal_error_deg": normal_error_deg(network, validation),
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "trainer": network.version,
    }


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m gelnet.synthetic", description=__doc__.splitlines()[0])
    add_training_options(parser)
    for name in ("presses", "rows_per_press", "epochs"):
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=getattr(Options, name))
    parser.add_argument("--recipe", choices=sorted(RECIPES), default=Options.recipe)
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    chosen = _arguments(arguments)
    trainer = make_trainer(chosen.trainer, seed=chosen.seed, threads=chosen.threads)
    options = Options(
        presses=chosen.presses, rows_per_press=chosen.rows_per_press, epochs=chosen.epochs, recipe=chosen.recipe
    )
    try:
        make(options, trainer, width=chosen.width, seed=chosen.seed, out=chosen.out)
    except (TableError, ExportError, ValueError, OSError) as error:
        print(f"gelnet.synthetic: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
