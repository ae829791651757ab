"""Which light groups a sequence shows: `rgb`, `single`, or those of a file."""

import re
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from gellight.base.allowed import StrictModel, explained
from gellight.base.errors import InputError
from gellight.ring import protocol
from gellight.ring.light_groups import Groups, colour_triples, single_leds

SEQUENCES = {"rgb": colour_triples, "single": single_leds}
"""rgb: a red, a green and a blue LED in each group; single: one LED"""
MOST_BYTES = 100_000  # chosen: 16 groups of 24 colours have some 4 kB
Colour = Annotated[str, Field(pattern=re.compile("^[0-9a-fA-F]{6}$"))]


class SequenceFile(StrictModel):
    """Light groups as JSON: for each the colours of all LEDs, RRGGBB."""

    groups: Annotated[
        list[Annotated[list[Colour], Field(min_length=1)]],
        Field(min_length=1, max_length=protocol.GROUP_COUNT),
    ]


def chosen_groups(name: str, colours: NDArray[np.uint8]) -> Groups:
    """Return the groups (G, n, 3) of the sequence `name` for a ring of n LEDs that is lit in `colours` (n, 3).

    Raises InputError for a name that is neither a sequence nor a file, and for a file that holds none.
    """
    if name not in SEQUENCES:
        return _of_file(Path(name), len(colours))
    try:
        return SEQUENCES[name](colours)
    except ValueError as error:
        raise InputError(f"sequence {name}: {error}; give the light groups in a file") from None


def _of_file(path: Path, leds: int) -> Groups:
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"sequence {path} is neither rgb nor single, nor a file that can be read ({why})") from None
    with explained(lambda wrong: InputError(f"sequence {path}: {wrong}; {_remedy(leds)}")):
        groups = SequenceFile.model_validate_json(content).groups
    if wrong := [number for number, group in enumerate(groups) if len(group) != leds]:
        raise InputError(f"sequence {path}: groups.{wrong[0]}: {len(groups[wrong[0]])} colours; {_remedy(leds)}")
    values = np.array([[list(bytes.fromhex(colour)) for colour in group] for group in groups], np.uint8)
    if dark := [number for number, group in enumerate(values) if not group.any()]:
        raise InputError(f"sequence {path}: group {dark[0]} is dark; a frame without light shows nothing")
    return values


def _remedy(leds: int) -> str:
    return f'give {{"groups": [["ff0000", ...], ...]}}, 1 to {protocol.GROUP_COUNT} groups of {leds} colours'
