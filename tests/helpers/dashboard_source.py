"""A sensor made of formulas: a smooth bump whose every figure is known exactly, for the tests of the dashboard."""

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from gellight.frames.frames import CameraFrame, Contact, GroundTruth, Patch, TactileFrame
from gellight.reconstruction.contact import find_contact, measure_patches
from sim_reference.objects import OBJECT_NAMES

HEIGHT, WIDTH, PIXEL_MM = 480, 640, 0.0588
SIGMA_MM = 3.0
REFERENCE_GREY = 128.0
LIGHT = np.repeat(np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8), 4, axis=0)
AZIMUTHS = np.radians([45.0, 165.0, 285.0])
"""where the red, green and blue light comes from"""


def bump(depth_mm: float, x_mm: float, y_mm: float, *, shape: tuple[int, int] = (HEIGHT, WIDTH)) -> TactileFrame:
    """Return the frame of a Gaussian bump; its depth, gradients, normals and contact are exact."""
    height, width = shape
    pixel = PIXEL_MM * WIDTH / width
    x = ((np.arange(width) - (width - 1) / 2) * pixel - x_mm)[None, :]
    y = ((np.arange(height) - (height - 1) / 2) * pixel - y_mm)[:, None]
    depth = depth_mm * np.exp(-(x**2 + y**2) / (2 * SIGMA_MM**2))
    gradient = np.stack([-depth * x / SIGMA_MM**2, -depth * y / SIGMA_MM**2], axis=-1)
    difference = shade(gradient)
    touched = contact(depth, pixel)
    return TactileFrame(
        camera_frame=CameraFrame(
            image=np.clip(np.rint(REFERENCE_GREY + difference), 0, 255).astype(np.uint8),
            time_s=time.monotonic(),
            sequence=0,
            source="formula",
            light=LIGHT,
        ),
        difference=difference.astype(np.float32),
        gradient_map=gradient.astype(np.float32),
        depth_mm=depth.astype(np.float32),
        contact=touched,
        contacts=numbered(measure_patches(touched.mask, depth, gradient, pixel)),
        stage_seconds={"gelnet": 0.008, "integration": 0.003},
    )


def numbered(patches: Sequence[Patch]) -> tuple[Patch, ...]:
    """Number the contacts as a sensor does that runs."""
    return tuple(replace(patch, number=number) for number, patch in enumerate(patches, start=1))


def two_bumps(*, truth_factor: float | None = None) -> TactileFrame:
    """Return two bumps far apart, 1 mm and 0.5 mm deep; the truth is `truth_factor` times as deep."""
    first, second = bump(1.0, 7.0, 3.0), bump(0.5, -9.0, -5.0)
    depth = first.depth_mm + second.depth_mm
    gradient = first.gradient_map + second.gradient_map
    contact = find_contact(depth, PIXEL_MM)
    contacts = numbered(measure_patches(contact.mask, depth, gradient, PIXEL_MM))
    frame = replace(first, depth_mm=depth, gradient_map=gradient, contact=contact, contacts=contacts)
    return frame if truth_factor is None else with_truth(frame, truth_factor)


def with_truth(frame: TactileFrame, factor: float) -> TactileFrame:
    """Return `frame` with a truth that is `factor` times as deep."""
    truth = GroundTruth(
        depth_mm=frame.depth_mm * np.float32(factor),
        gradient_map=frame.gradient_map * np.float32(factor),
        contact=frame.contact.mask,
    )
    return replace(frame, camera_frame=replace(frame.camera_frame, truth=truth))


def shade(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W, 3) grey levels by which a slope brightens each colour's light."""
    towards = np.stack([np.cos(AZIMUTHS), -np.sin(AZIMUTHS)])
    return np.clip(-220.0 * gradient @ towards, -REFERENCE_GREY, 255 - REFERENCE_GREY)


def contact(depth_mm: NDArray[np.float64], pixel_mm: float) -> Contact:
    mask = depth_mm > 0.05
    rows, columns = np.nonzero(mask)
    height, width = mask.shape
    centre = (columns.mean() - (width - 1) / 2, rows.mean() - (height - 1) / 2) if mask.any() else None
    return Contact(
        mask=mask,
        area_mm2=float(mask.sum() * pixel_mm**2),
        indentation_mm=float(depth_mm.max()) if mask.any() else 0.0,
        centroid_mm=centre and (float(centre[0] * pixel_mm), float(centre[1] * pixel_mm)),
    )


class RecordingStage:
    """A stage that remembers what it was asked for."""

    objects = OBJECT_NAMES
    max_depth_mm = 2.0

    def __init__(self) -> None:
        self.calls: list[tuple[str, float, float, float] | None] = []
        self.prepared: list[tuple[str, float, float, float]] = []
        self.may_prepare = threading.Event()
        self.may_prepare.set()

    def prepare(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        self.prepared.append((object_name, depth_mm, x_mm, y_mm))
        self.may_prepare.wait(60)

    def press(self, object_name: str, depth_mm: float, x_mm: float, y_mm: float) -> None:
        self.calls.append((object_name, depth_mm, x_mm, y_mm))

    def release(self) -> None:
        self.calls.append(None)

    def drive(self, *, on: bool) -> None:
        """Nothing moves."""

    def status(self) -> dict[str, object]:
        name, depth, x, y = (self.calls and self.calls[-1]) or ("", 0.0, 0.0, 0.0)
        return {"object": name, "depth_mm": depth, "x_mm": x, "y_mm": y, "visitor": bool(self.calls), "preparing": ""}


class FormulaSource:
    """Gives a frame whenever one is put into it, or at a steady rate by `play`."""

    pixel_size_mm = (PIXEL_MM, PIXEL_MM)

    def __init__(self, *, stage: RecordingStage | None = None) -> None:
        self.stage = stage
        self.error: str | None = None
        self.calibrating = False
        self.camera = SimpleNamespace(waits=False)
        self.zeros = 0
        self.figures: dict[str, object] = {
            "sensor": "formula://bump",
            "frames": 1234,
            "fps": 29.97,
            "frame_age_ms": {"median": 11.2, "p95": 17.8},
            "dropped": 3,
            "stage_ms": {"gelnet": 8.1, "integration": 3.2, "contact": 0.6},
        }
        self._changed = threading.Condition()
        self._frame: TactileFrame | None = None
        self._sequence = -1
        self.asked = 0

    def put(self, frame: TactileFrame) -> int:
        """Make `frame` the newest; return its sequence number."""
        with self._changed:
            self._sequence += 1
            object.__setattr__(frame.camera_frame, "sequence", self._sequence)
            object.__setattr__(frame.camera_frame, "time_s", time.monotonic())
            self._frame = frame
            self._changed.notify_all()
            return self._sequence

    def wait_frame(self, after_sequence: int, timeout_s: float) -> TactileFrame:
        with self._changed:
            self.asked += 1
            if not self._changed.wait_for(lambda: self._sequence > after_sequence, timeout_s) or self._frame is None:
                raise TimeoutError("no frame")
            return self._frame

    def track(self, on: bool) -> None:
        self.tracking = on

    def rezero(self) -> None:
        self.zeros += 1

    def status(self) -> dict[str, object]:
        return {**self.figures, "error": self.error}

    def play(self, frames: list[TactileFrame], fps: float, stop: threading.Event) -> None:
        """Put `frames` in turn, for ever, until `stop`."""
        turn = 0
        while not stop.wait(1 / fps):
            self.put(frames[turn % len(frames)])
            turn += 1


def moving_bump(count: int) -> list[TactileFrame]:
    """Return a bump that circles the view and breathes."""
    turns = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return [bump(0.75 + 0.5 * np.sin(t), 8 * np.cos(t), 5 * np.sin(t)) for t in turns]
