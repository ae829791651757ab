"""The carrier: each pin of each controller does what the firmware's table says, and the circuit is the firmware page's.

The board is read from its KiCad file; KiCad judges it at night.
"""

import csv
import io
import re
from math import cos, hypot, pi, sin

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.ring.boards import BOARDS
from gellight_design.boards.catalogue import CARRIERS
from gellight_design.boards.files import board_files, carrier_files
from gellight_design.boards.strip import strip_board
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import Carrier, read_carrier
from tests.helpers.command_line import invoke

# From the makers' drawings: number of the pin on the module, down the left row and up the right one, by GPIO.
PINS = {
    "pico": {2: 4, 3: 5, 4: 6, 6: 9, 7: 10, 26: 31, "VBUS": 40, "3V3": 36, "GND": (3, 8, 13, 18, 23, 28, 33, 38)},
    "pico2": {2: 4, 3: 5, 4: 6, 6: 9, 7: 10, 26: 31, "VBUS": 40, "3V3": 36, "GND": (3, 8, 13, 18, 23, 28, 33, 38)},
    "xiao": {2: 9, 3: 11, 4: 10, 6: 5, 7: 6, 26: 1, "VBUS": 14, "3V3": 12, "GND": (13,)},
    "rp2040-zero": {2: 16, 3: 15, 4: 14, 6: 12, 7: 11, 26: 7, "VBUS": 1, "3V3": 3, "GND": (2,)},
}
ROWS_MM = {"pico": (17.78, 20), "pico2": (17.78, 20), "xiao": (15.24, 7), "rp2040-zero": (15.24, 9)}


@pytest.fixture(params=CARRIERS, scope="module")
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def board(name: str) -> Carrier:
    return read_carrier(name)


def net_at(board: Carrier, part: str, pad: str) -> str:
    return next((net for net, pads in board.nets().items() if (part, pad) in pads), "")


def test_the_pins_are_those_of_the_firmware(name: str, board: Carrier) -> None:
    preset, pins = BOARDS[name], PINS[name]
    wanted = {"DATA": preset.data_pin, "TRIGGER": preset.trigger_pin, "OUTPUT": preset.output_pin}
    wanted |= {"SWITCH": 6, "STATUS": 7, "NTC": 26}
    assert preset.carrier is not None
    assert (preset.carrier.switch, preset.carrier.status, preset.carrier.thermistor) == (6, 7, 26)
    found = {pad: net for net, pads in board.nets().items() for part, pad in pads if part == "U1"}
    expected = {str(pins[gpio]): net for net, gpio in wanted.items()}
    expected |= {str(pins[net]): net for net in ("VBUS", "3V3")} | {str(pin): "GND" for pin in pins["GND"]}
    assert found == expected


def test_the_firmware_takes_the_configuration_that_order_txt_names(name: str, board: Carrier) -> None:
    order = str(board_files(SensorGeometry(), name, "2020")["order.txt"])
    done = invoke(*order.splitlines()[-1].split()[1:], "--url", "sim://")
    assert done.exit_code == 0, done.output
    said = re.search(
        r"saved: 12 LEDs .* at GPIO (\d+), trigger at GPIO (\d+), .* LED at GPIO (\d+), .* at GPIO (\d+)", done.output
    )
    assert said is not None, done.output
    for gpio, net in zip(map(int, said.groups()), ("DATA", "TRIGGER", "STATUS", "SWITCH"), strict=True):
        assert ("U1", str(PINS[name][gpio])) in board.nets()[net]


def test_the_holes_take_the_module(name: str, board: Carrier) -> None:
    rows, count = ROWS_MM[name]
    holes = np.array([pad.at for pad in board.pads if pad.part == "U1"])
    assert len(holes) == 2 * count
    assert np.ptp(holes[:, 0]) == pytest.approx(rows)
    assert np.diff(sorted(set(holes[:, 1].round(6)))) == pytest.approx(2.54)
    assert holes[0] == pytest.approx([holes[:, 0].min(), holes[:, 1].max()]), "pin 1 is at the upper left"


def test_the_circuit_is_that_of_the_firmwares_page(board: Carrier) -> None:
    nets = board.nets()
    values = board.values
    through = {frozenset((net_at(board, part, "1"), net_at(board, part, "2"))): values[part]
               for part in values if part[0] in "RCF"}  # fmt: skip
    assert through[frozenset(("VBUS", "5V_FUSED"))] == "polyfuse 500 mA"
    assert through[frozenset(("SHIFTED", "DIN"))] == "330"
    assert through[frozenset(("SWITCH", "GND"))] == "2.2 k", "open while the controller starts"
    assert through[frozenset(("SLEW", "GND"))] == "2.2 nF 50 V X7R"
    assert through[frozenset(("3V3", "NTC"))] == "10 k"
    assert through[frozenset(("TRIGGER", "TRIGGER_IN"))] == "1 k"
    assert through[frozenset(("OUTPUT", "TRIGGER_OUT"))] == "330"
    across = [values[part] for part in values if part[0] == "C" and {part} <= {one for one, _ in nets["5V"]}]
    assert sorted(across) == ["100 nF 50 V X7R", "470 uF 10 V"]
    assert net_at(board, "U3", "1") == "GND", "the enable of the level shifter"
    assert (net_at(board, "U3", "2"), net_at(board, "U3", "3")) == ("DATA", "SHIFTED")
    assert [net_at(board, "D2", pad) for pad in "123"] == ["GND", "3V3", "TRIGGER"], "clamp of the trigger"


def test_the_tail_meets_the_socket_net_by_net(board: Carrier) -> None:
    """Turn the strip over, contacts to the carrier, tip to the left: contact for contact the nets are the socket's."""
    strip = strip_board(SensorGeometry())
    tail = [(pad.at, pad.net) for pad in strip.pads() if pad.part == "J1"]
    socket = [(pad.at, pad.net) for pad in board.pads if pad.part == "J1" and pad.number != "MP"]
    ends = np.array([at for at, _ in tail])
    row = ends[-1] - ends[0]
    outwards = np.arctan2(row[0], -row[1])  # across the row; seen from the LEDs the first contact is at the right
    assert cos(outwards) * ends[0][0] + sin(outwards) * ends[0][1] > 0, "away from the ring"
    turn = pi - outwards
    laid = ends @ np.array([[cos(turn), sin(turn)], [-sin(turn), cos(turn)]])  # the tip to the left, from its contacts
    laid[:, 1] *= -1  # turned over
    up = sorted(zip(laid[:, 1], (net for _, net in tail), strict=True))
    there = sorted((at[1], net) for at, net in socket)
    assert [net for _, net in up] == [net for _, net in there]
    assert np.diff([y for y, _ in up]) == pytest.approx(np.diff([y for y, _ in there]), abs=1e-6)
    x = np.mean([at[0] for at, _ in socket])
    mounts = [pad.at[0] for pad in board.pads if pad.part == "J1" and pad.number == "MP"]
    assert min(mounts) > x, "it opens to the right: the contacts lie behind its mouth"


def test_a_controller_without_a_carrier_is_refused() -> None:
    with pytest.raises(InputError, match="no carrier for a board 'pico-w': choose pico, pico2, xiao, rp2040-zero"):
        carrier_files("pico-w")


HEAD_MM = 3.5
"""around the middle of a hole: the head of a screw M3 is 5.5 mm across"""


def test_no_copper_lies_beneath_the_head_of_a_screw(board: Carrier) -> None:
    assert len(board.holes) == 4
    for x, y in board.holes:
        for pad in board.pads:
            beside = [
                max(abs(at - hole) - side / 2, 0) for at, hole, side in zip(pad.at, (x, y), pad.size, strict=True)
            ]
            assert hypot(*beside) >= HEAD_MM, pad
        for (start, end), half in board.copper:
            along = end - start
            share = np.clip((np.array([x, y]) - start) @ along / max(along @ along, 1e-12), 0, 1)
            assert np.hypot(*(start + share * along - (x, y))) - half >= HEAD_MM - 1e-3, (start, end)


def test_references_first_pins_and_polarity_are_printed(board: Carrier) -> None:
    assert all(part in words for part, words in board.printed.items())
    marks = {part: [word for word in words if word != part] for part, words in board.printed.items()}
    marked = {part: word for part, words in marks.items() for word in words}
    assert marked == {"C3": "+", "D1": "K"} | dict.fromkeys(("U1", "U2", "U3", "D2", "J1", "J2"), "1")
    nets = board.nets()
    assert ("C3", "1") in nets["5V"], "the mark is at pad 1"
    assert ("D1", "1") in nets["GND"], "the cathode"


def test_bill_and_placement_are_those_of_the_board(name: str, board: Carrier) -> None:
    files = carrier_files(name)
    bill = list(csv.DictReader(io.StringIO(files[f"gellight-carrier-{name}-bom.csv"].decode())))
    placed = list(csv.DictReader(io.StringIO(files[f"gellight-carrier-{name}-placement.csv"].decode())))
    assert {one: row["Comment"] for row in bill for one in row["Designator"].split(",")} == board.values
    assert all(row["Manufacturer"] and row["Manufacturer Part Number"] for row in bill)
    mounted = {one for row in bill if row["Mounted"] == "house" for one in row["Designator"].split(",")}
    assert mounted == {row["Designator"] for row in placed}
    for row in placed:
        x, y, turn = board.places[row["Designator"]]
        told = [float(row[column]) for column in ("Mid X", "Mid Y", "Rotation")]
        assert told == pytest.approx([x, y, turn % 360], abs=1e-4)
