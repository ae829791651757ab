"""The flexible strip: LEDs on the developed cone, supply rails at the back, data along the middle, a tail to plug in.

Places on the strip are (along, out) in mm: along the middle line from its beginning beside LED 0, and outwards from it.
The rails are two arcs at the back, 5 V inside and ground outside, with a via wherever a part needs one. In front the
data line runs along the middle and passes between the pads of each capacitor. The tail leaves along the first edge.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import asin, atan2, hypot, pi

from gellight.base.errors import InputError
from gellight.base.leds import MOST_LEDS
from gellight_design.boards import catalogue
from gellight_design.boards.catalogue import Lamp
from gellight_design.boards.footprints import CHIP_0603, contacts
from gellight_design.boards.model import (
    BACK,
    FRONT,
    GROUND,
    Arc,
    Board,
    Layer,
    Line,
    Part,
    Point,
    Rules,
    Track,
    Via,
    polygon,
    turned,
)
from gellight_design.parts import Strip
from gellight_design.parts import strip as flat_strip
from sim_reference.geometry import SensorGeometry

SUPPLY, DATA, WARM = "5V", "DIN", "NTC"
TAIL_NETS = (SUPPLY, SUPPLY, DATA, WARM, GROUND, GROUND)
"""of the contacts, from the side of the first edge of the strip"""
TAIL_PITCH_MM = 1.0
TAIL_WIDTH_MM = TAIL_PITCH_MM * (len(TAIL_NETS) + 1)
TAIL_MM = 60.0
STIFF_MM = 8.0
"""of the tail, behind the contacts"""
CONTACT: Point = (0.7, 4.0)
RULES = Rules(clearance_mm=0.15, edge_mm=0.2, thickness_mm=0.2)
GAP_MM = 0.1
"""that the strip is shorter at each end than the cone, so that the ends meet"""
RAIL_MM, RAIL_WIDTH_MM = 1.6, 2.8
"""from the middle line to the middle of a rail, and its width"""
DATA_WIDTH_MM, TAIL_TRACK_MM, TAIL_SUPPLY_MM, GROUND_MM = 0.15, 0.6, 1.0, 1.5
CROSSING_MM = 0.6, 0.9
"""least and greatest width of the track that takes 5 V along the first edge to the inner rail"""
CROSSING_EDGE_MM = 0.25
"""from that track to the edge, at its inner end, INNER_MM from the middle line, where the strip is shortest"""
INNER_MM = 2.5
LEAST_RADIUS_MM = 10.0
"""of the flat middle line: parts lie beside each other on a bend"""
DATA_IN_MM = 0.05
"""from the middle line to the data: pads are straight, the line is bent"""
DATA_OUT_MM = 2.75
"""where the data of the tail passes the parts"""
CAPACITOR_HALF_MM = 0.475
APART_MM = 0.01


@dataclass(frozen=True)
class Bed:
    """The flat strip with the places on it."""

    flat: Strip

    @cached_property
    def first_rad(self) -> float:
        """Angle of the edge beside LED 0."""
        return self.flat.sector_rad - GAP_MM / self.flat.middle_radius_mm

    @cached_property
    def length_mm(self) -> float:
        """Length of the middle line."""
        return (self.first_rad - self.last_rad) * self.flat.middle_radius_mm

    @property
    def last_rad(self) -> float:
        """Angle of the other edge."""
        return GAP_MM / self.flat.middle_radius_mm

    def turn(self, along: float) -> float:
        """Return the angle of a place."""
        return self.first_rad - along / self.flat.middle_radius_mm

    def at(self, along: float, out: float) -> Point:
        """Return a place on the strip."""
        return turned((self.flat.middle_radius_mm + out, 0.0), self.turn(along))

    def arc(self, start: float, end: float, out: float) -> Arc:
        """Return the arc between two places at one distance from the middle line."""
        return Arc(self.flat.middle_radius_mm + out, self.turn(start), self.turn(end))

    def tail(self, across: float, out: float) -> Point:
        """Return a place on the tail: across from the first edge, and out from the outer edge of the strip."""
        return turned((self.flat.outer_radius_mm + out, -across), self.first_rad)

    @cached_property
    def widening(self) -> float:
        """How much longer the middle line is than the inner end of the crossing."""
        return self.flat.middle_radius_mm / (self.flat.middle_radius_mm - INNER_MM)

    def crossing_mm(self, lamp: Lamp) -> float:
        """Return how wide 5 V may cross between the first edge and the data and pads of LED 0."""
        data = self.led(0) - _leg_mm(lamp) - DATA_WIDTH_MM / 2 - RULES.clearance_mm - CROSSING_EDGE_MM * self.widening
        pads = self.led(0) / self.widening - lamp.half_mm - RULES.clearance_mm - CROSSING_EDGE_MM
        return min(CROSSING_MM[1], data / (self.widening + 1) * 2, pads)

    def capacitor_mm(self, lamp: Lamp) -> float:
        """Return how far from the middle of an LED its capacitor is: their rooms all but touch at the inner corner."""
        (long, wide), radius = CHIP_0603.room, self.flat.middle_radius_mm
        inner, half = radius - long / 2, wide / 2
        return radius * (asin(lamp.footprint.room[0] / 2 / hypot(inner, half)) + atan2(half, inner)) + APART_MM

    def needed_mm(self, lamp: Lamp) -> float:
        """Return what an LED needs of the strip at each side: before the first, behind the last with its capacitor."""
        least, edge, clearance = CROSSING_MM[0], CROSSING_EDGE_MM, RULES.clearance_mm
        data = _leg_mm(lamp) + DATA_WIDTH_MM / 2 + clearance + edge * self.widening + least * (self.widening + 1) / 2
        pads = (lamp.half_mm + clearance + edge + least) * self.widening
        radius = self.flat.middle_radius_mm
        behind = self.capacitor_mm(lamp) + (CAPACITOR_HALF_MM + RULES.edge_mm) * radius / (
            radius - CHIP_0603.room[0] / 2
        )
        return GAP_MM + max(data, pads, behind)

    def led(self, number: int) -> float:
        """Return how far along the middle of an LED is."""
        return (number + 0.5) * self.flat.pitch_rad * self.flat.middle_radius_mm - GAP_MM


def strip_board(geometry: SensorGeometry, package: str = "5050") -> Board:
    """Return the strip of a sensor.

    Raises ConfigError or InputError for a ring that cannot be built, more LEDs than the firmware drives, LEDs too close
    for their package, or a package that is not listed.
    """
    count, lamp = len(geometry.led_colours), catalogue.find_lamp(package)
    if count > MOST_LEDS:
        raise InputError(f"{count} LEDs: the firmware drives {MOST_LEDS}, give led_colours 3 to {MOST_LEDS} letters")
    bed = Bed(flat_strip(geometry))
    _check_room(bed, lamp, geometry)
    parts = [*_lamps(bed, lamp), *_capacitors(bed, lamp), *_tail_parts(bed)]
    copper = [*_rails(bed), *_data(bed, lamp), *_drops(bed, lamp), *_tail_copper(bed, lamp)]
    tip = TAIL_MM - STIFF_MM
    stiff = [bed.tail(0, tip), bed.tail(0, TAIL_MM), bed.tail(TAIL_WIDTH_MM, TAIL_MM), bed.tail(TAIL_WIDTH_MM, tip)]
    return Board(
        name="gellight-strip",
        title=f"GelLight strip, {bed.flat.count} x {lamp.item.value}",
        outline=_outline(bed),
        rules=RULES,
        parts=tuple(parts),
        tracks=tuple(one for one in copper if isinstance(one, Track) and one.path.length_mm > 0.01),
        vias=tuple(one for one in copper if isinstance(one, Via)),
        notes={"STIFFENER": polygon(*stiff)},
    )


def _check_room(bed: Bed, lamp: Lamp, geometry: SensorGeometry) -> None:
    count = bed.flat.count
    radius, half = bed.flat.middle_radius_mm, bed.flat.pitch_rad * bed.flat.middle_radius_mm / 2
    if radius < LEAST_RADIUS_MM:
        raise InputError(
            f"the flat strip would have a radius of {radius:.1f} mm, too tight for its parts: choose ring_radius_mm at "
            f"least {LEAST_RADIUS_MM / radius * geometry.ring_radius_mm:.1f}"
        )
    needed = bed.needed_mm(lamp)
    if half < needed:
        most = int(pi * geometry.ring_radius_mm / needed)
        raise InputError(
            f"{count} LEDs of {lamp.item.number} are {2 * half:.2f} mm apart on a ring of {geometry.ring_radius_mm:g} "
            f"mm and need {2 * needed:.2f} mm: use at most {most} of them, the smaller package, or a wider ring"
        )


def _outline(bed: Bed) -> tuple[Line | Arc, ...]:
    """Return the edge, anticlockwise; a chamfer of 2 mm keeps the corner between tail and strip from tearing."""
    flat, width = bed.flat, TAIL_WIDTH_MM
    corner = bed.first_rad - asin((width + 2) / flat.outer_radius_mm)
    outer, inner = (
        Arc(flat.outer_radius_mm, bed.last_rad, corner),
        Arc(flat.inner_radius_mm, bed.first_rad, bed.last_rad),
    )
    way = [outer.end, bed.tail(width, 1.0), bed.tail(width, TAIL_MM), bed.tail(0, TAIL_MM), inner.start]
    return (Line(inner.end, outer.start), outer, *(Line(start, end) for start, end in pairwise(way)), inner)


def _lamps(bed: Bed, lamp: Lamp) -> Iterator[Part]:
    last = bed.flat.count - 1
    for led in range(bed.flat.count):
        nets = {lamp.pins["VDD"]: SUPPLY, lamp.pins["GND"]: GROUND, lamp.pins["DIN"]: _data_net(led)}
        if led < last:
            nets[lamp.pins["DOUT"]] = _data_net(led + 1)
        yield Part(f"D{led + 1}", lamp.item, lamp.footprint, bed.flat.led_centre(led), _turn(bed, bed.led(led)), nets)


def _data_net(led: int) -> str:
    return f"DATA{led}" if led else DATA


def _turn(bed: Bed, along: float) -> float:
    """Return how parts are turned: data runs from their right to their left, their upper side is inside."""
    return bed.turn(along) + pi / 2


def _capacitors(bed: Bed, lamp: Lamp) -> Iterator[Part]:
    for led in range(bed.flat.count):
        along = bed.led(led) + bed.capacitor_mm(lamp)
        nets = {"1": SUPPLY, "2": GROUND}
        turn = _turn(bed, along) - pi / 2
        yield Part(f"C{led + 1}", catalogue.CAPACITOR_100N, CHIP_0603, bed.at(along, 0), turn, nets)


def _tail_parts(bed: Bed) -> Iterator[Part]:
    across = bed.first_rad - pi / 2
    first = bed.tail(TAIL_PITCH_MM, TAIL_MM - 0.3 - CONTACT[1] / 2)
    nets = {str(1 + n): net for n, net in enumerate(TAIL_NETS)}
    yield Part("J1", catalogue.TAIL, contacts(len(TAIL_NETS), TAIL_PITCH_MM, CONTACT), first, across, nets)
    yield Part("TH1", catalogue.THERMISTOR, CHIP_0603, bed.tail(4.8, 5.0), across, {"1": WARM, "2": GROUND})


def _rails(bed: Bed) -> Iterator[Track]:
    """Yield the rails; their ends are round, so they stop short of the edges."""
    end = RAIL_WIDTH_MM / 2 + RULES.edge_mm + 0.3
    for out, net in ((-RAIL_MM, SUPPLY), (RAIL_MM, GROUND)):
        yield Track(bed.arc(end, bed.length_mm - end, out), RAIL_WIDTH_MM, BACK, net)


def _data(bed: Bed, lamp: Lamp) -> Iterator[Track]:
    for led in range(bed.flat.count - 1):
        leaves, enters = bed.led(led) + lamp.node_mm, bed.led(led + 1) - lamp.node_mm
        net = _data_net(led + 1)
        yield Track(Line(_pad(bed, lamp, led, "DOUT"), bed.at(leaves, DATA_IN_MM)), DATA_WIDTH_MM, FRONT, net)
        yield Track(bed.arc(leaves, enters, DATA_IN_MM), DATA_WIDTH_MM, FRONT, net)
        yield Track(Line(bed.at(enters, DATA_IN_MM), _pad(bed, lamp, led + 1, "DIN")), DATA_WIDTH_MM, FRONT, net)


def _pad(bed: Bed, lamp: Lamp, led: int, name: str) -> Point:
    at = next(pad.at for pad in lamp.footprint.pads if pad.number == lamp.pins[name])
    return turned(at, _turn(bed, bed.led(led)), bed.flat.led_centre(led))


def _drops(bed: Bed, lamp: Lamp) -> Iterator[Track | Via]:
    """Yield the vias from the parts to the rails."""
    for led in range(bed.flat.count):
        for name, net, out in (("VDD", SUPPLY, -RAIL_MM), ("GND", GROUND, RAIL_MM)):
            x = next(pad.at[0] for pad in lamp.footprint.pads if pad.number == lamp.pins[name])
            beside = bed.led(led) - (x if abs(x) < 1.5 else x / 2)  # beneath a large package: not in its pad
            yield from _drop(_pad(bed, lamp, led, name), bed.at(beside, out), net)
            along = bed.led(led) + bed.capacitor_mm(lamp)
            yield from _drop(bed.at(along, out / 2), bed.at(along, out), net)


def _drop(pad: Point, via: Point, net: str) -> Iterator[Track | Via]:
    yield Via(via, net)
    yield Track(Line(pad, via), TAIL_TRACK_MM, FRONT, net)


def _tail_copper(bed: Bed, lamp: Lamp) -> Iterator[Track | Via]:
    tip = TAIL_MM - 0.3 - CONTACT[1] / 2
    joint = bed.tail(5.6, 5.0)  # ground: of the thermistor, and both contacts
    for across, net, inwards in ((1.0, SUPPLY, 2.0), (2.0, SUPPLY, 3.0), (5.0, GROUND, 6.2), (6.0, GROUND, 6.2)):
        yield from _way(net, [bed.tail(across, tip), bed.tail(across, tip - 3)])
        yield from _way(net, [bed.tail(across, tip - 3), bed.tail(across, inwards)], TAIL_SUPPLY_MM)
    yield from _way(SUPPLY, [bed.tail(2, 3), bed.tail(1, 2)], TAIL_SUPPLY_MM)
    wide = bed.crossing_mm(lamp)
    along = (CROSSING_EDGE_MM + wide / 2) * bed.widening
    outer, *inner = (bed.at(along, out) for out in (3.6, -1.0, -2.2))
    yield from _way(SUPPLY, [bed.tail(1, 2), outer, *inner], wide)
    yield from (Via(at, SUPPLY) for at in inner)
    yield from _way(WARM, [bed.tail(4, tip), bed.tail(4, 5)])
    for across in (5.0, 6.0):
        yield from _way(GROUND, [bed.tail(across, 6.2), joint])
    vias = [bed.tail(5.6, 3.0), bed.tail(4.6, 3.0)]
    yield from (Via(at, GROUND) for at in vias)
    yield from _way(GROUND, [joint, *vias])
    yield from _way(GROUND, [vias[1], vias[0], bed.at(5.2, RAIL_MM)], GROUND_MM, BACK)
    yield from _data_in(bed, lamp, bed.tail(3, tip))


def _data_in(bed: Bed, lamp: Lamp, contact: Point) -> Iterator[Track]:
    leg, node, start = bed.led(0) - _leg_mm(lamp), bed.led(0) - lamp.node_mm, 2.8
    yield from _way(DATA, [contact, bed.tail(3, 0.8), bed.at(start, DATA_OUT_MM)], DATA_WIDTH_MM)
    yield Track(bed.arc(start, leg, DATA_OUT_MM), DATA_WIDTH_MM, FRONT, DATA)
    way = [bed.at(leg, DATA_OUT_MM), bed.at(leg, DATA_IN_MM), bed.at(node, DATA_IN_MM), _pad(bed, lamp, 0, "DIN")]
    yield from _way(DATA, way, DATA_WIDTH_MM)


def _leg_mm(lamp: Lamp) -> float:
    """Return how far from LED 0 its data comes down to the middle line: clear of its pads."""
    return max(lamp.node_mm, lamp.half_mm + RULES.clearance_mm + DATA_WIDTH_MM / 2 + APART_MM)


def _way(net: str, points: list[Point], width: float = TAIL_TRACK_MM, layer: Layer = FRONT) -> Iterator[Track]:
    for start, end in pairwise(points):
        yield Track(Line(start, end), width, layer, net)
