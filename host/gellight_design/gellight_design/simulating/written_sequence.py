"""A sequence of presses as pictures: one object that slides, turns and tilts in the gel, and where it truly was."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gellight.base.csv_file import csv_text
from gellight.base.writing import write_file
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.simulator.sequence import Sequence
from gellight.recording.frame_record import packed_picture
from gellight_design.simulating.choices import RESOLUTION_MM, GelKind
from gellight_design.simulating.gel_models import check_memory, gel_model
from gellight_design.simulating.new_folder import new_folder
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import SensorGeometry

POSE = [f"{axis}{column}" for axis in "xyz" for column in ("_of_x", "_of_y", "_of_z", "_mm")]
"""the first three rows of a pose, which carries points of the object to the sensor, mm"""


@dataclass(frozen=True, kw_only=True)
class SequenceReport:
    """What was written."""

    folder: str
    frames: int


def write_sequence(
    sequence: Sequence,
    folder: Path,
    geometry: SensorGeometry,
    *,
    gel: GelKind = "layer",
    resolution_mm: float = RESOLUTION_MM,
    noise_grey: float = 1.0,
    seed: int = 0,
) -> SequenceReport:
    """Write a picture a frame, 00000.png and so on, and poses.csv with the true pose of each.

    Raises InputError for what cannot be pressed or written, and for a mesh that does not fit the memory.
    """
    if gel == "fem":
        check_memory(resolution_mm, geometry)
    scene = Scene(geometry, CameraResponse(noise_grey=noise_grey), model=gel_model(gel, resolution_mm))
    random = np.random.default_rng(seed)
    rows = []
    with new_folder(folder, "sequence"):
        for number, press in enumerate(sequence.presses):
            image = digitise(scene.show(press)[0], noise_grey, random)
            write_file(folder / f"{number:05}.png", packed_picture(image))
            rows.append(_row(number, press))
        write_file(folder / "poses.csv", csv_text(["frame", "object", "depth_mm", *POSE], rows).encode())
    return SequenceReport(folder=str(folder), frames=len(rows))


def _row(number: int, press: Press | None) -> list[object]:
    """Return a frame's row of poses.csv."""
    if press is None:
        return [number, "", *[""] * 13]
    return [number, press.object_name, press.depth_mm, *press.pose[:3].ravel().round(9).tolist()]
