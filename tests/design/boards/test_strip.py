"""The flexible strip: its LEDs are those of leds.csv, its copper is enough, and what cannot be made is refused."""

from itertools import pairwise
from math import radians
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gellight.base.errors import ConfigError, InputError
from gellight_design.boards.currents import drop_v, full_ma
from gellight_design.boards.model import BACK, GROUND, Arc, Board, Point
from gellight_design.boards.strip import SUPPLY, TAIL_NETS, strip_board
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import axes_at, ring_of, rolled_up, table
from tests.helpers.children import gellight

IPC_OUTER, IPC_COVERED = 0.048, 0.024
"""of the formula below: for copper in air, and for copper that insulation covers, as coverlay does"""
RINGS = [
    pytest.param(ring_of(12), "5050", id="default"),
    *[pytest.param(ring_of(count), "2020", id=f"{count}-2020") for count in (3, 4, 7, 12, 19, 24)],
    *[pytest.param(ring_of(count), "5050", id=f"{count}-5050") for count in (3, 13)],
    pytest.param(
        ring_of(24, gel_diameter_mm=90.0, ring_radius_mm=40.0, camera_height_mm=60.0), "5050", id="24-5050-wide"
    ),
    pytest.param(ring_of(8, incident_angle_rad=radians(55)), "2020", id="steep"),
]


@pytest.mark.parametrize(("geometry", "package"), RINGS)
def test_rolled_up_each_led_is_at_its_place_of_the_table_and_looks_along_its_axis(
    geometry: SensorGeometry, package: str
) -> None:
    leds = [part for part in strip_board(geometry, package).parts if part.reference.startswith("D")]
    flat = np.array([np.mean([pad.at for pad in led.pads()], axis=0) for led in leds])
    places, axes = table(geometry)
    assert np.linalg.norm(rolled_up(flat, geometry) - places, axis=1).max() < 0.05
    # 0.05 mm at the distance of the gel
    assert np.linalg.norm(axes_at(flat, geometry) - axes, axis=1).max() < 1e-3


@pytest.mark.parametrize(("geometry", "package"), RINGS)
def test_data_runs_from_the_tail_through_every_led(geometry: SensorGeometry, package: str) -> None:
    nets = strip_board(geometry, package).nets()
    into, out_of = ("4", "2") if package == "5050" else ("3", "1")
    assert nets["DIN"] == {("J1", "3"), ("D1", into)}
    for led in range(1, len(geometry.led_colours)):
        assert nets[f"DATA{led}"] == {(f"D{led}", out_of), (f"D{led + 1}", into)}
    supply, ground = ("1", "3") if package == "5050" else ("4", "2")
    leds = range(1, 1 + len(geometry.led_colours))
    assert nets["5V"] == {("J1", "1"), ("J1", "2")} | {(f"D{n}", supply) for n in leds} | {(f"C{n}", "1") for n in leds}
    assert {(f"D{n}", ground) for n in leds} | {(f"C{n}", "2") for n in leds} | {("TH1", "2")} <= nets["GND"]
    assert nets["NTC"] == {("J1", "4"), ("TH1", "1")}


def least_width_mm(current_ma: float, copper_mm: float, warmer_k: float = 20.0, factor: float = IPC_COVERED) -> float:
    """Return how wide a track has to be: IPC-2221A, 6.2, I = factor warmer^0.44 area^0.725 in A, K and square mils."""
    area = (current_ma / 1000 / (factor * warmer_k**0.44)) ** (1 / 0.725)
    return float(area * 0.0254**2 / copper_mm)


def test_the_formula_gives_what_is_known_of_it() -> None:
    """IPC-2221 for 1 A, 10 K and copper of 35 um: 0.30 mm in air and 0.78 mm inside, as its calculators say."""
    assert least_width_mm(1000, 0.035, 10, IPC_OUTER) == pytest.approx(0.30, abs=0.005)
    assert least_width_mm(1000, 0.035, 10) == pytest.approx(0.78, abs=0.005)


@pytest.mark.parametrize(("geometry", "package"), RINGS)
def test_copper_carries_all_leds_white_at_20_k(geometry: SensorGeometry, package: str) -> None:
    board = strip_board(geometry, package)
    needed = least_width_mm(full_ma(geometry, package), board.rules.copper_mm)
    for net in (SUPPLY, GROUND):
        rail = max(track.width_mm for track in board.tracks if track.net == net and track.layer == BACK)
        contact = min(t.width_mm for t in board.tracks if t.net == net and t.layer != BACK)
        vias = sum(2 * via.drill_mm for via in board.vias if via.net == net)  # plated 20 um: more than 1.8 x drill
        assert rail > needed
        assert contact * TAIL_NETS.count(net) > needed
        assert vias > needed
    crossing = max(t.width_mm for t in board.tracks if t.net == SUPPLY and t.layer != BACK)
    assert crossing > needed, "of 5 V along the first edge"


@pytest.mark.parametrize(("geometry", "package"), RINGS)
def test_the_last_led_loses_less_than_150_mv(geometry: SensorGeometry, package: str) -> None:
    board = strip_board(geometry, package)
    said = drop_v(geometry, board, package)
    assert said < 0.15
    # Judged by the copper as it is laid: a network of all tracks, solved.
    solved = sum(network_drop_v(board, net, full_ma(geometry, package) / 1000) for net in (SUPPLY, GROUND))
    assert solved < 0.15
    assert said == pytest.approx(solved, rel=0.15)


def network_drop_v(board: Board, net: str, total_a: float, hot: float = 1 + 0.00393 * 40) -> float:
    """Solve the resistors that the tracks of a net are, each LED drawing its share."""
    square = 1.72e-5 * hot / 0.035
    nodes: list[Point] = []

    def node(at: Point) -> int:
        for number, other in enumerate(nodes):
            if np.hypot(other[0] - at[0], other[1] - at[1]) < 0.02:
                return number
        nodes.append(at)
        return len(nodes) - 1

    resistors: list[tuple[int, int, float]] = []
    for track in (one for one in board.tracks if one.net == net):
        points: list[Point] = [track.path.start, track.path.end]
        if isinstance(track.path, Arc):  # broken where vias drop onto it
            ends = [via.at for via in board.vias if via.net == net]
            ends += [one.path.end for one in board.tracks if one.net == net and one.layer == BACK and one is not track]
            ends = [end for end in ends if abs(np.hypot(*end) - track.path.radius) < track.width_mm / 2]
            points = sorted(ends, key=lambda at: float(np.arctan2(at[1], at[0]) % (2 * np.pi)))
        for start, end in pairwise(points):
            length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
            if length > 0.02:
                resistors.append((node(start), node(end), square * length / track.width_mm))
    leds = [node(pad.at) for pad in board.pads() if pad.part.startswith("D") and pad.net == net]
    contacts = [node(pad.at) for pad in board.pads() if pad.part == "J1" and pad.net == net]
    conductance: NDArray[np.float64] = np.zeros((len(nodes), len(nodes)))
    for a, b, ohm in resistors:
        conductance[[a, b], [a, b]] += 1 / ohm
        conductance[[a, b], [b, a]] -= 1 / ohm
    drawn = np.zeros(len(nodes))
    np.add.at(drawn, leds, total_a / len(leds))
    free = np.setdiff1d(np.arange(len(nodes)), contacts)
    reached = free[np.diag(conductance)[free] > 0]
    volts = np.zeros(len(nodes))
    volts[reached] = np.linalg.solve(conductance[np.ix_(reached, reached)], drawn[reached])
    return float(volts[leds].max())


@pytest.mark.parametrize(
    ("geometry", "package", "reason"),
    [
        (ring_of(25), "2020", "the firmware drives 24"),
        (ring_of(14), "5050", "at most 13 of them"),
        (ring_of(12), "3535", "choose 2020 or 5050"),
    ],
)
def test_a_strip_that_cannot_be_made_is_refused_in_one_sentence(
    geometry: SensorGeometry, package: str, reason: str
) -> None:
    with pytest.raises((ConfigError, InputError), match=reason) as refused:
        strip_board(geometry, package)
    assert "\n" not in str(refused.value)


def test_the_verb_refuses_and_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(f'[geometry]\nled_colours = "{"RGB" * 9}"\n')
    done = gellight("optimize", "make", "boards", "--out", tmp_path / "boards", "--geometry", tmp_path / "mine.toml")
    assert done.returncode == 2
    assert "the firmware drives 24" in " ".join(done.stderr.split())
    assert not (tmp_path / "boards").exists()
