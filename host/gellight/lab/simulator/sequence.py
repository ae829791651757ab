"""A sequence of presses as a file: one object that slides, turns and tilts in the gel, frame by frame.

The file is JSON::

    {"object": "PEG", "within_mm": 0, "steps": [[depth, x, y, turn_x, turn_y, turn_z], null, ...]}

A step is a frame: how deep the highest point is in mm, where the object's origin is in mm from the image centre, and
how it is turned: the axis of the turn, as long as its angle in degrees. null: the object is lifted. `within_mm` cuts an
object that is a height over x and y by a circle of this radius; left out or 0, it is whole.
"""

import csv
import io
from dataclasses import dataclass
from math import hypot, radians
from pathlib import Path

import numpy as np
from pydantic import Field, ValidationError

from gellight.base.allowed import StrictModel, in_words
from gellight.base.errors import InputError
from gellight.base.writing import new_folder, write_file
from gellight.lab.simulator.bodies import body
from gellight.lab.simulator.choices import RESOLUTION_MM, GelKind
from gellight.lab.simulator.gel_models import check_memory, gel_model
from gellight.lab.simulator.scene import Press, Scene
from gellight.recording.frame_record import packed_picture
from sim_reference.camera import CameraResponse, digitise
from sim_reference.deformation import NotConverged
from sim_reference.geometry import SensorGeometry

MOST_STEPS = 100_000
Step = tuple[float, float, float, float, float, float]


class Sequence(StrictModel):
    """What is pressed, and how in each frame."""

    object_name: str = Field(alias="object", min_length=1)
    within_mm: float = Field(default=0.0, ge=0, le=30)
    steps: tuple[Step | None, ...] = Field(min_length=1, max_length=MOST_STEPS, strict=False)

    @property
    def presses(self) -> list[Press | None]:
        """The press of each frame; None: nothing touches."""
        return [self._press(step) for step in self.steps]

    def _press(self, step: Step | None) -> Press | None:
        if step is None or step[0] == 0:
            return None
        depth, x, y, *turn_deg = step
        turn_x, turn_y, turn_z = (radians(angle) for angle in turn_deg)
        return Press(self.object_name.upper(), depth, x, y, turn_rad=(turn_x, turn_y, turn_z), within_mm=self.within_mm)


def read_sequence(path: Path, geometry: SensorGeometry) -> Sequence:
    """Read and check a file of a sequence; InputError, naming what is wrong in it."""
    try:
        sequence = Sequence.model_validate_json(path.read_bytes())
        body(sequence.object_name.upper(), sequence.within_mm)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): give a JSON file of a sequence") from error
    except ValidationError as error:
        raise InputError(
            f'{path}: {in_words(error)}; give {{"object": "PEG", "steps": [[depth, x, y, turn_x, turn_y, '
            "turn_z], null, ...]} in mm and degrees"
        ) from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    radius_mm = geometry.gel_diameter_mm / 2
    for number, step in enumerate(sequence.steps):
        if step is not None and not (0 <= step[0] <= geometry.deepest_press_mm and hypot(*step[1:3]) <= radius_mm):
            raise InputError(
                f"{path}: step {number} is {step[0]:g} mm deep at ({step[1]:g}, {step[2]:g}) mm: give 0 to "
                f"{geometry.deepest_press_mm:g} mm, within {radius_mm:g} mm of the centre"
            )
    return sequence


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
    try:
        with new_folder(folder):
            for number, press in enumerate(sequence.presses):
                image = digitise(scene.show(press)[0], noise_grey, random)
                write_file(folder / f"{number:05}.png", packed_picture(image))
                rows.append(_row(number, press))
            write_file(folder / "poses.csv", _table(rows))
    except (ValueError, NotConverged) as error:
        raise InputError(f"this sequence cannot be simulated: {error}") from error
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror}): choose another --out") from error
    return SequenceReport(folder=str(folder), frames=len(rows))


def _row(number: int, press: Press | None) -> list[object]:
    """Return a frame's row of poses.csv."""
    if press is None:
        return [number, "", *[""] * 13]
    return [number, press.object_name, press.depth_mm, *press.pose[:3].ravel().round(9).tolist()]


def _table(rows: list[list[object]]) -> bytes:
    """Return poses.csv: the first three rows of each pose, which carries points of the object to the sensor, mm."""
    text = io.StringIO()
    writer = csv.writer(text)
    pose = [f"{axis}{column}" for axis in "xyz" for column in ("_of_x", "_of_y", "_of_z", "_mm")]
    writer.writerows([["frame", "object", "depth_mm", *pose], *rows])
    return text.getvalue().encode()
