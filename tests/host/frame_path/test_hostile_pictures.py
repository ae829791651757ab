"""Every stage from the picture to the watch is bounded in memory and time, whatever the camera delivers."""

import time
import tracemalloc
from collections.abc import Callable
from functools import cache
from itertools import count

import cv2
import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.bundle.contents import npz
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.dot_following import DotFollower
from gellight.frames.dots import Dots, find_dots
from gellight.frames.frames import CameraFrame
from gellight.frames.view import View
from gellight.watch.monitor import SensorWatch
from gellight.watch.other_unit import UnitCheck
from gellight_scan.tracking.tracker import Tracker
from gellight_scan.tracking.view import View as TrackedView

HEIGHT, WIDTH, PITCH = 480, 640, 16.0
MOST_BYTES, MOST_CPU_S = 100e6, 1.0
"""the time is a bound on the kind of work, not a measurement: each stage needs some tens of milliseconds"""
ROWS, COLUMNS = np.indices((HEIGHT, WIDTH))
LATTICE = np.stack(np.meshgrid(np.arange(12, 628, PITCH), np.arange(12, 468, PITCH)), axis=-1).reshape(-1, 2)[:1000]
MIDDLE = np.array([WIDTH, HEIGHT]) / 2


def coloured(grey: np.ndarray) -> np.ndarray:
    return np.repeat(np.broadcast_to(np.asarray(grey, np.uint8), (HEIGHT, WIDTH))[..., None], 3, axis=2)


def with_spots(places: np.ndarray, radius: int = 3) -> np.ndarray:
    image = coloured(np.array(150))
    for x, y in np.rint(places).astype(int).tolist():
        cv2.circle(image, (x, y), radius, (30, 30, 30), -1)
    return image


def turned(angle: float) -> np.ndarray:
    across, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    return np.asarray((LATTICE - MIDDLE) @ np.stack([across, along]) + MIDDLE)


def jumped() -> np.ndarray:
    away = np.square((LATTICE - MIDDLE) / 120).sum(axis=1)
    return np.asarray(LATTICE + np.exp(-away)[:, None] * [0.75 * PITCH, 0.15 * PITCH])


PICTURES: dict[str, Callable[[], np.ndarray]] = {
    "black": lambda: coloured(np.array(0)),
    "white": lambda: coloured(np.array(255)),
    "half black": lambda: coloured(150 * (COLUMNS < WIDTH // 2)),
    "noise": lambda: np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8),
    "noise of a dark camera": lambda: np.random.default_rng(0).integers(0, 5, (HEIGHT, WIDTH, 3), np.uint8),
    "checkerboard": lambda: coloured(255 * ((ROWS // 3 + COLUMNS // 3) % 2)),
    "finest checkerboard": lambda: coloured(255 * ((ROWS + COLUMNS) % 2)),
    "one dot": lambda: with_spots(MIDDLE[None], 5),
    "many dots": lambda: with_spots(np.random.default_rng(0).uniform(0, (WIDTH, HEIGHT), (20_000, 2)), 1),
    "the dots turned": lambda: with_spots(turned(0.3)),
    "the dots after a jump": lambda: with_spots(jumped()),
}
RANDOM, PRESSED = np.random.default_rng(2), 9999
PRESSES = [RANDOM.normal(0, 40, (PRESSED, 3)), RANDOM.uniform((99, 99), (540, 380), (PRESSED, 2)),
           RANDOM.normal(0, 0.3, (PRESSED, 2))]  # fmt: skip
BUNDLE = load_bundle("synthetic").with_files({"presses.npz": npz({"rows": np.hstack(PRESSES)})})
"""its confidence asks, too, what the presses of a calibration were like"""
VIEW = View.of_corners([(20, 10), (600, 40), (620, 470), (5, 460)], (HEIGHT, WIDTH), (HEIGHT, WIDTH))


def follow_dots(image: np.ndarray) -> None:
    for diameter in (5.0, 8.0):
        follower = DotFollower(LATTICE, diameter, 0.8)
        follower.follow(with_spots(LATTICE))
        follower.follow(image)


def fill_dots(image: np.ndarray) -> None:
    for diameter in (5.0, 20.0):
        Dots(diameter_px=diameter, darker_grey=20.0, count=63).filled(image)


PARTS = cache(lambda: (Reconstructor(BUNDLE), SensorWatch(BUNDLE), UnitCheck(BUNDLE)))
NUMBERS = count()


def reconstruct_and_look(image: np.ndarray) -> None:
    (path, watch, unit), number = PARTS(), next(NUMBERS)
    frame = path.reconstruct(CameraFrame(image=image, sequence=number, time_s=0.3 * number))
    assert frame.confidence.value.max() <= 1
    assert frame.force.normal_n >= 0
    height_mm = BUNDLE.manifest.camera_height_mm
    seen = TrackedView.of(frame.depth_mm, frame.gradient_map, BUNDLE.pixel_size_mm, camera_height_mm=height_mm)
    Tracker().follow(seen, 0)
    watch.note(frame)
    unit.figures(image)


STAGES: list[tuple[Callable[[np.ndarray], object], float]] = [
    (find_dots, 1),
    (fill_dots, 1),
    (follow_dots, 2),
    (lambda image: VIEW.of(image, "the picture"), 1),
    (reconstruct_and_look, 4),
]


@pytest.mark.parametrize("picture", PICTURES)
def test_no_picture_costs_more_memory_or_time_than_a_camera_has(picture: str) -> None:
    image = PICTURES[picture]()
    PARTS()
    for stage, frames in STAGES:
        tracemalloc.start()
        begun_s = time.process_time()
        stage(image)
        used_s, (_, peak) = time.process_time() - begun_s, tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < MOST_BYTES, stage
        assert used_s < frames * MOST_CPU_S, stage
