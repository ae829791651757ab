"""Light groups: which LEDs of the ring shine together during one exposure of photometric stereo.

A set of groups is an array (n, leds, 3) uint8: RGB of every LED for each of n exposures. A colour camera tells the
three colours apart, so that one exposure can hold three lights at once.
"""

import re
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from gellight.base.allowed import StrictModel, in_words
from gellight.base.errors import InputError
from gellight.ring import protocol

Groups = NDArray[np.uint8]


def single_leds(colours: NDArray[np.uint8]) -> Groups:
    """Return one group for each LED of a ring that is lit in (n, 3) `colours`: (n, n, 3)."""
    return np.asarray(np.eye(len(colours), dtype=np.uint8)[:, :, None] * colours, np.uint8)


def colour_triples(colours: NDArray[np.uint8]) -> Groups:
    """Return groups of one red, one green and one blue LED, as many as the most frequent colour has LEDs: (k, n, 3).

    On the paper's ring (RRRRGGGGBBBB) the three LEDs of a group are 120 degrees apart, and each is used once. Where the
    colours are not equally many, LEDs of the rarer ones are used again. Raises ValueError unless every LED has exactly
    one colour and each colour is there.
    """
    hue, lit = np.argmax(colours, axis=1), colours > 0
    members = [np.flatnonzero(hue == channel) for channel in range(3)]
    if (lit.sum(axis=1) != 1).any() or not all(len(leds) for leds in members):
        raise ValueError("the ring needs LEDs of one pure colour each, and at least one of red, green and blue")
    groups = np.zeros((max(map(len, members)), len(colours), 3), np.uint8)
    for index, group in enumerate(groups):
        leds = [own[index * len(own) // len(groups)] for own in members]
        group[leds] = colours[leds]
    return groups


SEQUENCES = {"rgb": colour_triples, "single": single_leds}
"""rgb: a red, a green and a blue LED in each group; single: one LED"""
MOST_BYTES = 100_000
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
    try:
        groups = SequenceFile.model_validate_json(content).groups
    except ValidationError as error:
        raise InputError(f"sequence {path}: {in_words(error)}; {_remedy(leds)}") from None
    if wrong := [number for number, group in enumerate(groups) if len(group) != leds]:
        raise InputError(f"sequence {path}: groups.{wrong[0]}: {len(groups[wrong[0]])} colours; {_remedy(leds)}")
    values = np.array([[list(bytes.fromhex(colour)) for colour in group] for group in groups], np.uint8)
    if dark := [number for number, group in enumerate(values) if not group.any()]:
        raise InputError(f"sequence {path}: group {dark[0]} is dark; a frame without light shows nothing")
    return values


def _remedy(leds: int) -> str:
    return f'give {{"groups": [["ff0000", ...], ...]}}, 1 to {protocol.GROUP_COUNT} groups of {leds} colours'
