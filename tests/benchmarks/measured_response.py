"""Calibrate on the measured light of real sensors: `python -m tests.benchmarks.measured_response [NAME...]`.

A table (Taxim; in half precision) says which colour a real sensor showed at each slope and place, and quadratics of the
normal and the place (gssim) what seven units showed under each of six lights, three of which are red, green and blue
here. Simulated surfaces are rendered through them, so neither our light model nor our camera model has a part in it.
Balls are pressed at random, found by themselves and learnt from; the error is measured on other objects, pressed
elsewhere, also of gs_sdk's recipe on the same circles.
"""

import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.lab.report.pictures import write_png
from gellight.lab.training.label_file import read_presses
from gellight.lab.training.labelling.circle import PressCircle
from gellight.lab.training.labelling.detection import detect, write_presses
from gellight.lab.training.presses import Ball
from gellight.lab.training.training import Learning, TrainingOptions, fit, read_reference
from gellight.reconstruction.integration import angle_deg, normals
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import ObjectParameters
from sim_reference.surface import Surface, press_object, sample
from tests.benchmarks.peer_network import PeerNetwork
from tests.helpers.places import REAL_CROPS, real

Array = NDArray[np.float64]
Floats = NDArray[np.floating]
Felt = Callable[[NDArray[np.uint8]], tuple[Floats, Floats]]
"""slopes and depth, mm, of a picture"""
RESPONSES = REAL_CROPS / "taxim_response", real("taxim_response")
UNITS = REAL_CROPS / "gssim_devices" / "quadratics.npz"
TABLE = "polycalib"
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.09)
GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=BALL.pixel_size_mm)
OBJECTS = (
    ("BALL", ObjectParameters(calibration_ball_radius_mm=2.5)),
    ("BALL", ObjectParameters(calibration_ball_radius_mm=7.0)),
    ("SCROWN", ObjectParameters(region_diameter_mm=8.0)),
    ("SINWAVE", ObjectParameters(region_diameter_mm=8.0)),
)
"""other balls, and two objects of the benchmark cut down to the size of a fingertip"""
BRIGHT_RAD, BRIGHTEST_GREY = 0.7, 200.0
"""a unit is exposed so that slopes of 40 degrees in the middle of the view are so bright at most"""
AT_REST_GREY = 120.0
NOISE_GREY = 1.0
REACH_MM = (8.0, 5.5)
"""presses stay so near to the middle: towards its corners a table extrapolates its quadratics"""


class MeasuredLight(ABC):
    """Colours of slopes at places, as a real sensor showed them."""

    @abstractmethod
    def grey(self, gradient_map: Array) -> Array:
        """Return the (H, W, 3) picture of the (H, W, 2) slopes, grey levels, without noise."""

    def photograph(
        self, surface: Surface | None, random: np.random.Generator, shape: tuple[int, int] = GEOMETRY.image_shape
    ) -> NDArray[np.uint8]:
        """Return a picture of the surface, or of the untouched gel, with the noise of a camera."""
        gradient_map = np.zeros((*shape, 2)) if surface is None else surface.gradient_map
        grey = self.grey(gradient_map) + random.normal(0, NOISE_GREY, (*shape, 3))
        return np.clip(np.round(grey), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class MeasuredUnit(MeasuredLight):
    """A unit whose light was fitted by its maker."""

    quadratics: Array
    """(6 or 3, 3, 10) of x^2, x y, y^2, x, y, 1, or the last three, and of the normal's a b c symmetrically, then
    linearly, then 1; x, y from the middle, in heights of the picture"""

    @classmethod
    def read(cls, name: str) -> "MeasuredUnit":
        """Read a unit, under the first, third and fifth of its lights."""
        with np.load(UNITS) as file:
            unit = cls(file[name][:, ::2].astype(np.float64))
        steep = np.linspace(0, 2 * np.pi, 13)[:, None]
        brightest = max(
            unit.grey(np.tan(BRIGHT_RAD) * np.stack([np.cos(a), np.sin(a)], axis=1)[None]).max() for a in steep
        )
        return cls(unit.quadratics * BRIGHTEST_GREY / brightest)

    def grey(self, gradient_map: Array) -> Array:
        """Return what the maker's program does."""
        height, width = gradient_map.shape[:2]
        y, x = ((np.indices((height, width)).T - [(height - 1) / 2, (width - 1) / 2]) / height).T
        place = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)])[-len(self.quadratics) :]
        upright = 1 / np.sqrt(1 + (gradient_map**2).sum(axis=2))
        a, b, c = -gradient_map[..., 0] * upright, -gradient_map[..., 1] * upright, upright
        squares = a * a, 2 * a * b, 2 * a * c, b * b, 2 * b * c, c * c
        normal = np.stack([*squares, a, b, c, np.ones_like(a)])
        share = np.einsum("phw,plk,khw->hwl", place, self.quadratics, normal)
        return np.asarray(255 * np.maximum(share, 0))


@dataclass(frozen=True)
class MeasuredResponse(MeasuredLight):
    table: Array
    """(angle, direction, 3, 6) coefficients of x^2, y^2, xy, x, y, 1; x, y in px of an image of 640 x 480"""

    @classmethod
    def read(cls, name: str) -> "MeasuredResponse":
        with np.load(next(p for place in RESPONSES if (p := place / f"{name}.npz").exists())) as file:
            table = np.stack([file[f"grad_{colour}"] for colour in "rgb"], axis=2)
        # A flat gel has no direction: what the directions disagree about there is scatter.
        table[0] = table[0].mean(axis=0)
        return cls(table)

    def difference(self, gradient_map: Array) -> Array:
        """Return the (H, W, 3) colour change against the flat gel, grey levels, linear between the bins."""
        gx, gy = gradient_map[..., 0], gradient_map[..., 1]
        bins = len(self.table) - 1
        angle = np.arctan(np.hypot(gx, gy)) / (np.pi / 2) * bins
        turn = (np.arctan2(gx, gy) + np.pi) / (2 * np.pi) * bins
        rows, columns = np.indices(gx.shape)
        x, y = columns * 640 / gx.shape[1], rows * 480 / gx.shape[0]
        place = np.stack([x**2, y**2, x * y, x, y, np.ones_like(x)], axis=-1)
        first, second = np.floor(angle).astype(int), np.floor(turn).astype(int)
        total = np.zeros((*gx.shape, 3))
        for i in (0, 1):
            for j in (0, 1):
                share = np.abs(1 - i - (angle - first)) * np.abs(1 - j - (turn - second))
                cell = self.table[np.minimum(first + i, bins), (second + j) % bins]
                total += share[..., None] * np.einsum("hwck,hwk->hwc", cell, place)
        return np.asarray(total - np.einsum("ck,hwk->hwc", self.table[0, 0], place))

    def grey(self, gradient_map: Array) -> Array:
        """Return the picture of an evenly bright gel."""
        return np.asarray(AT_REST_GREY + self.difference(gradient_map))


PRESSES = 12


def light_of(name: str) -> MeasuredLight:
    """Return the table or the unit of this name."""
    return MeasuredResponse.read(name) if name == TABLE else MeasuredUnit.read(name)


def measure(name: str) -> dict[str, float]:
    """Calibrate on one light and return what it is worth on objects that were not trained on."""
    random = np.random.default_rng(0)
    light = light_of(name)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for number in range(8):
            write_png(place / f"untouched-{number}.png", light.photograph(None, random))
        reference = read_reference(f"{folder}/untouched-*.png")
        truth = _press_balls(light, place, random)
        found = detect(sorted(truth), reference.image, BALL)
        circles = [(one.image, one.contact) for one in found if isinstance(one.contact, PressCircle)]
        apart = [np.hypot(c.center_x_px - truth[path][0], c.center_y_px - truth[path][1]) for path, c in circles]
        write_presses(place / "presses.csv", found)
        presses = read_presses(place / "presses.csv", ball=BALL, image_shape=GEOMETRY.image_shape)
        how = Learning(options=TrainingOptions(recipe="fast"))
        felt = Reconstructor(fit(presses, reference, BALL, place / "bundle", sensor=name, how=how))
        peer = PeerNetwork(presses, reference.image, BALL)

    def ours(image: NDArray[np.uint8]) -> tuple[Floats, Floats]:
        frame = felt.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0, source=name))
        return frame.gradient_map, frame.depth_mm

    errors = _errors(light, ours), _errors(light, lambda image: peer.felt(image, BALL.pixel_size_mm))
    return {
        "circles_found": float(len(circles)),
        "center_error_px": float(np.median(apart)),
        **dict(zip(("whole_map_deg", "contact_deg", "depth_mm"), errors[0], strict=True)),
        **dict(zip(("peer_whole_map_deg", "peer_contact_deg", "peer_depth_mm"), errors[1], strict=True)),
    }


def _press_balls(light: MeasuredLight, folder: Path, random: np.random.Generator) -> dict[Path, tuple[float, float]]:
    """Write pictures of pressed balls; returns the centre of each, px."""
    deformations = [press_object("BALL", depth, GEOMETRY) for depth in (0.5, 1.0, 1.6)]
    truth = {}
    for number in range(PRESSES):
        x, y = random.uniform(-1, 1, 2) * REACH_MM
        path = folder / f"press-{number:02}.png"
        write_png(path, light.photograph(sample(deformations[number % 3], GEOMETRY, x, y), random))
        truth[path] = x / BALL.pixel_size_mm + 159.5, y / BALL.pixel_size_mm + 119.5
    return truth


def _errors(light: MeasuredLight, felt: Felt) -> list[float]:
    """Normal error over the map and in contact, deg, and depth error in contact, mm: means over the objects."""
    random, figures = np.random.default_rng(1), []
    for name, parameters in OBJECTS:
        x, y = random.uniform(-0.3, 0.3, 2) * REACH_MM
        surface = sample(press_object(name, 0.8, GEOMETRY, parameters=parameters), GEOMETRY, x, y)
        slopes, depth_mm = felt(light.photograph(surface, random))
        angle = angle_deg(normals(slopes), normals(surface.gradient_map))
        off_mm = np.abs(depth_mm - surface.depth_mm)[surface.contact].mean()
        figures.append((angle.mean(), angle[surface.contact].mean(), off_mm))
    return [float(value) for value in np.mean(figures, axis=0)]


def main() -> None:
    with np.load(UNITS) as file:
        every = [TABLE, *file.files]
    for name in sys.argv[1:] or every:
        try:
            print(name, *(f"{key}={value:.4g}" for key, value in measure(name).items()), flush=True)
        except InputError as error:
            print(f"{name}: {error}", flush=True)


if __name__ == "__main__":
    main()
