"""The carrier: each pin of each controller does what the firmware's table says, and the circuit is sound.

KiCad 6 checks circuits in its window alone, so SKiDL checks the electrical rules here, in a folder of its own, where it
leaves its logs; it is used here alone, never by what ships. What a pin is, it is told here.
"""

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.boards.carrier import pin_nets
from gellight.lab.boards.files import board_files
from gellight.lab.boards.model import Board
from gellight.lab.boards.modules import MODULES
from gellight.lab.boards.strip import strip_board
from gellight.ring.boards import BOARDS
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import carrier_of
from tests.helpers.command_line import invoke

# From the makers' drawings: number of the pin on the module, down the left row and up the right one, by GPIO.
PINS = {
    "pico": {2: 4, 3: 5, 4: 6, 6: 9, 7: 10, 26: 31, "VBUS": 40, "3V3": 36, "GND": (3, 8, 13, 18, 23, 28, 33, 38)},
    "pico2": {2: 4, 3: 5, 4: 6, 6: 9, 7: 10, 26: 31, "VBUS": 40, "3V3": 36, "GND": (3, 8, 13, 18, 23, 28, 33, 38)},
    "xiao": {2: 9, 3: 11, 4: 10, 6: 5, 7: 6, 26: 1, "VBUS": 14, "3V3": 12, "GND": (13,)},
    "rp2040-zero": {2: 16, 3: 15, 4: 14, 6: 12, 7: 11, 26: 7, "VBUS": 1, "3V3": 3, "GND": (2,)},
}
ROWS_MM = {"pico": (17.78, 20), "pico2": (17.78, 20), "xiao": (15.24, 7), "rp2040-zero": (15.24, 9)}
KINDS = {
    "U2": {"1": "PWRIN", "2": "PWRIN", "3": "INPUT", "6": "PWROUT"},
    "U3": {
        **dict.fromkeys(("1", "2", "4", "5", "9", "10", "12", "13"), "INPUT"),
        **dict.fromkeys(("3", "6", "8", "11"), "OUTPUT"),
        "7": "PWRIN",
        "14": "PWRIN",
    },
    "F1": {"2": "PWROUT"},
}
"""what pins are that are not passive, by the data sheets; the fuse passes on what feeds it"""
DRIVES = {"VBUS": "PWROUT", "3V3": "PWROUT", "NTC": "INPUT", "TRIGGER": "INPUT", "GND": "PASSIVE", "": "BIDIR"}
"""what the controller's pins are by their net; the others are outputs"""
Circuit = dict[str, dict[str, tuple[str, str]]]
"""by part and pin: what the pin is (a name of SKiDL's `pin_types`), and its net, "" for none"""
CLEAN = "No errors or warnings found while running ERC"
NEXT = "----"
JUDGE = f"""
import json, sys
from skidl import SKIDL, Circuit, Net, Part, Pin
from skidl.pin import pin_types
for told in json.load(open(sys.argv[1])):
    print("{NEXT}", file=sys.stderr, flush=True)
    circuit, nets = Circuit(), {{}}
    for reference, pins in told.items():
        kinds = [Pin(num=number, name=number, func=pin_types[kind]) for number, (kind, _) in pins.items()]
        part = Part(name=reference, ref=reference, tool=SKIDL, pins=kinds, circuit=circuit)
        for number, (_, net) in pins.items():
            if net not in nets:
                nets[net] = Net(net, circuit=circuit) if net else circuit.NC
            nets[net] += part[number]
    circuit.ERC()
"""


@pytest.fixture(params=list(MODULES), scope="module")
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def board(name: str) -> Board:
    return carrier_of(name)


def net_at(board: Board, part: str, pad: str) -> str:
    return next((net for net, pads in board.nets().items() if (part, pad) in pads), "")


def test_the_pins_are_those_of_the_firmware(name: str, board: Board) -> None:
    preset, pins = BOARDS[name], PINS[name]
    wanted = {"DATA": preset.data_pin, "TRIGGER": preset.trigger_pin, "OUTPUT": preset.output_pin}
    wanted |= {"SWITCH": 6, "STATUS": 7, "NTC": 26}
    assert pin_nets(preset) == {gpio: net for net, gpio in wanted.items()}
    found = {pad: net for net, pads in board.nets().items() for part, pad in pads if part == "U1"}
    expected = {str(pins[gpio]): net for net, gpio in wanted.items()}
    expected |= {str(pins[net]): net for net in ("VBUS", "3V3")} | {str(pin): "GND" for pin in pins["GND"]}
    assert found == expected


def test_the_firmware_takes_the_configuration_that_order_txt_names(name: str, board: Board) -> None:
    order = str(board_files(SensorGeometry(), name, "2020")["order.txt"])
    done = invoke(*order.splitlines()[-1].split()[1:], "--url", "sim://")
    assert done.exit_code == 0, done.output
    said = re.search(
        r"saved: 12 LEDs .* at GPIO (\d+), trigger at GPIO (\d+), .* LED at GPIO (\d+), .* at GPIO (\d+)", done.output
    )
    assert said is not None, done.output
    for gpio, net in zip(map(int, said.groups()), ("DATA", "TRIGGER", "STATUS", "SWITCH"), strict=True):
        assert ("U1", str(PINS[name][gpio])) in board.nets()[net]


def test_the_holes_take_the_module(name: str, board: Board) -> None:
    rows, count = ROWS_MM[name]
    holes = np.array([pad.at for pad in board.pads() if pad.part == "U1"])
    assert len(holes) == 2 * count
    assert np.ptp(holes[:, 0]) == pytest.approx(rows)
    assert np.diff(sorted(set(holes[:, 1].round(6)))) == pytest.approx(2.54)
    assert holes[0] == pytest.approx([holes[:, 0].min(), holes[:, 1].max()]), "pin 1 is at the upper left"


def circuit_of(board: Board) -> Circuit:
    """The netlist with what each pin is; the first ground of the controller feeds the others."""
    circuit: Circuit = {}
    for part in board.parts:
        kinds = KINDS.get(part.reference, {})
        nets = {pad.number: part.nets.get(pad.number, "") for pad in part.footprint.pads}
        if part.reference == "U1":
            kinds = {pad: DRIVES.get(net, "OUTPUT") for pad, net in nets.items()}
            kinds[next(pad for pad, net in nets.items() if net == "GND")] = "PWROUT"
        circuit[part.reference] = {pad: (kinds.get(pad, "PASSIVE"), net) for pad, net in nets.items()}
    return circuit


@pytest.mark.nightly
def test_the_electrical_rules_hold(tmp_path: Path) -> None:
    circuits = [circuit_of(carrier_of(name)) for name in MODULES]
    for circuit in circuits:
        pins = [(f"{part}.{pad}", *pin) for part, pads in circuit.items() for pad, pin in pads.items()]
        floating = [pin for pin, kind, net in pins if not net and kind in ("INPUT", "PWRIN")]
        assert floating == [], "SKiDL takes a pin without a net for one that is meant to have none"
    assert complaints(circuits, tmp_path) == [[]] * len(MODULES)


@pytest.mark.nightly
def test_faults_of_the_circuit_are_found(tmp_path: Path) -> None:
    """Two outputs on a net, a supply that nothing feeds, a switch short to ground, pins that hang in the air."""
    faults = [("U3", "6", "SHIFTED"), ("U3", "14", "A"), ("U2", "6", "GND"), ("R3", "2", "A"), ("U2", "3", "A")]
    circuits = [circuit_of(carrier_of("pico")) for _ in faults]
    for circuit, (part, pad, net) in zip(circuits, faults, strict=True):
        circuit[part][pad] = (circuit[part][pad][0], net)
    assert all(complaints(circuits, tmp_path))


def test_the_circuit_is_that_of_the_firmwares_page(board: Board) -> None:
    nets = board.nets()
    values = {part.reference: part.item.value for part in board.parts}
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


def test_the_tail_meets_the_socket_net_by_net(board: Board) -> None:
    """Turn the strip over, contacts to the carrier, tip to the left: contact for contact the nets are the socket's."""
    strip = strip_board(SensorGeometry())
    tail = [(pad.at, pad.net) for pad in strip.pads() if pad.part == "J1"]
    socket = [(pad.at, pad.net) for pad in board.pads() if pad.part == "J1" and pad.pad.number != "MP"]
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
    mounts = [pad.at[0] for pad in board.pads() if pad.part == "J1" and pad.pad.number == "MP"]
    assert min(mounts) > x, "it opens to the right: the contacts lie behind its mouth"


def test_a_controller_without_a_carrier_is_refused() -> None:
    with pytest.raises(InputError, match="no carrier for a board 'pico-w': choose pico, pico2, xiao, rp2040-zero"):
        carrier_of("pico-w")


def test_degrees_of_parts_are_quarters(board: Board) -> None:
    assert all(abs(part.turn_rad / radians(90) % 1) < 1e-9 for part in board.parts)


def complaints(circuits: Sequence[Circuit], folder: Path) -> list[list[str]]:
    """Return the errors and warnings that SKiDL has for each circuit."""
    told = folder / "circuits.json"
    told.write_text(json.dumps(circuits))
    command = [sys.executable, "-c", JUDGE, told]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    verdicts = done.stderr.split(NEXT)[1:]
    found = [re.findall(r"^ERC (?:ERROR|WARNING): (.*)$", verdict, re.M) for verdict in verdicts]
    assert [CLEAN in verdict for verdict in verdicts] == [not those for those in found], done.stderr
    assert len(found) == len(circuits)
    return found
