"""Calibrate on the measured light of a real sensor.

A table (Taxim; in half precision) says which colour a real sensor showed at each slope and place.
Simulated surfaces are rendered through them, so neither our light model nor our camera model has a part in it. Balls
are pressed at random, found by themselves and learnt from; the error is measured on other objects, pressed
elsewhere.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
from tests.helpers.places import REAL_CROPS, real

Array = NDArray[np.float64]
RESPONSES = REAL_CROPS / "taxim_response", real("taxim_response")
BALL = Ball(radius_mm=4.0, pixel_size_mm=0.09)
GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=BALL.pixel_size_mm)
OBJECTS = (
    ("BALL", ObjectParameters(calibration_ball_radius_mm=2.5)),
    ("BALL", ObjectParameters(calibration_ball_radius_mm=7.0)),
    ("SCROWN", ObjectParameters(region_diameter_mm=8.0)),
    ("SINWAVE", ObjectParameters(region_diameter_mm=8.0)),
)
"""other balls, and two objects of the benchmark cut down to the size of a fingertip"""
AT_REST_GREY = 120.0
NOISE_GREY = 1.0
REACH_MM = (8.0, 5.5)
"""presses stay so near to the middle: towards its corners a table extrapolates its quadratics"""


@dataclass(frozen=True)
class MeasuredResponse:
    """Colour of a slope at a place, as a real sensor showed it."""

    table: Array
    """(angle, direction, 3, 6) coefficients of x^2, y^2, xy, x, y, 1; x, y in px of an image of 640 x 480"""

    @classmethod
    def read(cls, name: str) -> "MeasuredResponse":
        """Read one of the tables."""
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
        return total - np.einsum("ck,hwk->hwc", self.table[0, 0], place)

    def photograph(
        self, surface: Surface | None, random: np.random.Generator, shape: tuple[int, int] = GEOMETRY.image_shape
    ) -> NDArray[np.uint8]:
        """Return a picture of the surface, or of the untouched gel, with the noise of a camera."""
        gradient_map = np.zeros((*shape, 2)) if surface is None else surface.gradient_map
        grey = AT_REST_GREY + self.difference(gradient_map) + random.normal(0, NOISE_GREY, (*shape, 3))
        return np.clip(np.round(grey), 0, 255).astype(np.uint8)


PRESSES = 12


def measure(name: str) -> dict[str, float]:
    """Calibrate on one response and return what it is worth on objects that were not trained on."""
    random = np.random.default_rng(0)
    response = MeasuredResponse.read(name)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for number in range(8):
            write_png(place / f"untouched-{number}.png", response.photograph(None, random))
        reference = read_reference(f"{folder}/untouched-*.png")
        truth = _press_balls(response, place, random)
        found = detect(sorted(truth), reference.image, BALL)
        circles = [(one.image, one.contact) for one in found if isinstance(one.contact, PressCircle)]
        apart = [np.hypot(c.center_x_px - truth[path][0], c.center_y_px - truth[path][1]) for path, c in circles]
        write_presses(place / "presses.csv", found)
        labelled = read_presses(place / "presses.csv", ball=BALL, image_shape=GEOMETRY.image_shape)
        how = Learning(options=TrainingOptions(recipe="fast"))
        bundle = fit(labelled, reference, BALL, place / "bundle", sensor=name, how=how)
        whole_map_deg, contact_deg = _errors_deg(response, Reconstructor(bundle), random)
    return {
        "circles_found": float(len(circles)),
        "center_error_px": float(np.median(apart)),
        "whole_map_deg": whole_map_deg,
        "contact_deg": contact_deg,
    }


def _press_balls(
    response: MeasuredResponse, folder: Path, random: np.random.Generator
) -> dict[Path, tuple[float, float]]:
    """Write pictures of pressed balls; returns the centre of each, px."""
    deformations = [press_object("BALL", depth, GEOMETRY) for depth in (0.5, 1.0, 1.6)]
    truth = {}
    for number in range(PRESSES):
        x, y = random.uniform(-1, 1, 2) * REACH_MM
        surface = sample(deformations[number % 3], GEOMETRY, x, y)
        path = folder / f"press-{number:02}.png"
        write_png(path, response.photograph(surface, random))
        truth[path] = x / BALL.pixel_size_mm + 159.5, y / BALL.pixel_size_mm + 119.5
    return truth


def _errors_deg(response: MeasuredResponse, reconstructor: Reconstructor, random: np.random.Generator) -> list[float]:
    """Normal error over the map and in contact, deg: means over the objects."""
    figures = []
    for number, (name, parameters) in enumerate(OBJECTS):
        x, y = random.uniform(-0.3, 0.3, 2) * REACH_MM
        surface = sample(press_object(name, 0.8, GEOMETRY, parameters=parameters), GEOMETRY, x, y)
        image = response.photograph(surface, random)
        felt = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=number, source=name))
        angle = angle_deg(felt.normal_map, normals(surface.gradient_map))
        figures.append((angle.mean(), angle[surface.contact].mean()))
    return [float(value) for value in np.mean(figures, axis=0)]
