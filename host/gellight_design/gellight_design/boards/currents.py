"""What the LEDs lose on their way through the copper."""

from math import pi

from gellight_design.boards.catalogue import Lamp, find_lamp
from gellight_design.boards.model import Board
from gellight_design.boards.strip import CROSSING_MM, RAIL_MM, RAIL_WIDTH_MM, SUPPLY, TAIL_MM, TAIL_NETS, TAIL_SUPPLY_MM
from sim_reference.geometry import SensorGeometry

HOT_COPPER_OHM_MM = 1.72e-5 * (1 + 0.00393 * (60 - 20))
"""ohm mm, at 60 °C"""


def full_ma(geometry: SensorGeometry, package: str) -> float:
    """Return what all LEDs draw when they are white."""
    return len(geometry.led_colours) * find_lamp(package).white_ma


def drop_v(geometry: SensorGeometry, board: Board, package: str) -> float:
    """Return what the last LED has less than the contacts of the tail get, all LEDs white: supply and ground together.

    Tail: one conductor a contact. Rails: the current falls by that of an LED at each of them.
    """
    lamp, count, square = find_lamp(package), len(geometry.led_colours), HOT_COPPER_OHM_MM / board.rules.copper_mm
    total_a = count * lamp.white_ma / 1000
    way_mm = TAIL_MM + 2 * RAIL_MM + 2.0  # past the thermistor and over the data to the inner rail
    conductors = TAIL_NETS.count(SUPPLY)
    tail = total_a * square * way_mm / (TAIL_SUPPLY_MM * conductors)
    crossing = total_a * square * 2 * RAIL_MM / CROSSING_MM[0]
    return 2 * tail + crossing + 2 * _rail_v(geometry, lamp, square)


def _rail_v(geometry: SensorGeometry, lamp: Lamp, square: float) -> float:
    """Return the loss along one rail: pitch by pitch, each with the current of the LEDs behind it."""
    count, pitch = len(geometry.led_colours), 2 * pi * geometry.ring_radius_mm / len(geometry.led_colours)
    current = lamp.white_ma / 1000 * (count * 0.5 + sum(range(count)))  # half a pitch lies before LED 0
    return current * square * pitch / RAIL_WIDTH_MM
