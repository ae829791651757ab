"""A sequence of presses as a file: one object that slides, turns and tilts in the gel, frame by frame.

The file is JSON::

    {"object": "PEG", "within_mm": 0, "steps": [[depth, x, y, turn_x, turn_y, turn_z], null, ...]}

A step is a frame: how deep the highest point is in mm, where the object's origin is in mm from the image centre, and
how it is turned: the axis of the turn, as long as its angle in degrees. null: the object is lifted. `within_mm` cuts an
object that is a height over x and y by a circle of this radius; left out or 0, it is whole.
"""

from math import hypot, radians
from pathlib import Path

from pydantic import Field, ValidationError

from gellight.base.allowed import StrictModel, in_words
from gellight.base.errors import InputError
from gellight.lab.simulator.bodies import body
from gellight.lab.simulator.scene import Press
from sim_reference.geometry import SensorGeometry

MOST_STEPS = 100_000  # chosen: 55 minutes at 30 frames/s
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
