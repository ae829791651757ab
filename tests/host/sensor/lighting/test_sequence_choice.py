"""Which light groups a sequence shows, and what is said of a file that holds none."""

import json
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BoardError, InputError
from gellight.ring.light_groups import colour_triples, single_leds
from gellight.ring.light_ring import connect
from gellight.sensor.lighting.sequence_choice import chosen_groups
from tests.helpers.virtual_sensor import RING

RED, DARK = ["ff0000"] * 12, ["000000"] * 12


def test_rgb_and_single_are_made_of_the_light_of_the_calibration() -> None:
    assert np.array_equal(chosen_groups("rgb", RING), colour_triples(RING))
    assert np.array_equal(chosen_groups("single", RING), single_leds(RING))
    with pytest.raises(InputError, match=r"sequence rgb: the ring needs LEDs of one pure colour.*in a file"):
        chosen_groups("rgb", np.full((12, 3), 9, np.uint8))


def test_a_file_names_the_colours_of_every_led_of_the_ring(tmp_path: Path) -> None:
    path = tmp_path / "sequence.json"
    path.write_text(json.dumps({"groups": [RED, ["0000ff", *RED[1:]]]}))
    groups = chosen_groups(str(path), RING)
    assert groups.shape == (2, 12, 3)
    assert groups.dtype == np.uint8
    assert groups[0, 0].tolist() == [255, 0, 0]
    assert groups[1, 0].tolist() == [0, 0, 255]
    path.write_text(json.dumps({"groups": [["ff0000"] * 8, ["00ff00"] * 8]}))
    groups = chosen_groups(str(path), np.full((8, 3), 9, np.uint8))
    assert groups.shape == (2, 8, 3)
    with connect("sim://?leds=8") as ring, pytest.raises(BoardError, match="drives 8 LEDs, this light has 12"):
        ring.load_sequence(np.full((2, 12, 3), 9, np.uint8), [])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is no JSON"),
        ("{}", "groups is missing"),
        ('{"groups": []}', "groups = .* is not allowed: give a list of at least 1 entry"),
        (json.dumps({"groups": [RED] * 40}), "groups = .* is not allowed: give a list of at most 16 entries"),
        (json.dumps({"groups": [RED[:11]]}), r"groups.0: 11 colours; .* of 12 colours"),
        (json.dumps({"groups": [["red", *RED[1:]]]}), r"groups.0.0 = 'red' is not allowed: give text like"),
        (json.dumps({"groups": [RED, DARK]}), "group 1 is dark"),
        (json.dumps({"groups": [RED], "dwell": 3}), "dwell is unknown"),
        ("\x00" * 200_000, "is no JSON"),
    ],
)
def test_a_file_that_holds_no_groups_is_refused_with_the_reason(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "sequence.json"
    path.write_text(content)
    with pytest.raises(InputError, match=said):
        chosen_groups(str(path), RING)


@pytest.mark.parametrize("name", ["magic", ".", "a\0b"])
def test_what_is_neither_a_sequence_nor_a_file_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="neither rgb nor single, nor a file"):
        chosen_groups(name, RING)
