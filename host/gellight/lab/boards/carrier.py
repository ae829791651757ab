"""The carrier of the controller: level shifter, fuse, load switch, triggers, status LED, and the socket of the strip.

Which pin does what comes from the presets of the firmware (`ring.boards`) and from `modules`. The circuit is that of
firmware/README.md; the capacitor at CT (2.2 nF) lets 5 V rise in 6 ms (TPS22918 data sheet, 8.3.3: 0.55 us per V and pF
and 30 us per V), so that 470 uF take 380 mA. R1 keeps the switch open while no pin drives it: an input of the RP2350
A2 sources some 120 uA up to 2.2 V, and 8.2 kohm or less hold it low (erratum RP2350-E9); 2.2 kohm leave 0.3 V, below
the 0.5 V at which the TPS22918 is surely off, and take 1.5 mA of the pin while it is closed.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import pi

from gellight.lab.boards import catalogue
from gellight.lab.boards.footprints import CHIP_0603, ELECTROLYTIC, FFC6, JST_XH4, POLYFUSE, SOIC14, SOT23, SOT23_6
from gellight.lab.boards.model import GROUND, Board, Footprint, Item, Part, Point, Rules, polygon
from gellight.lab.boards.modules import LOGIC, VBUS, Module, carrier_pins, find_module
from gellight.lab.boards.pour import ground_planes
from gellight.lab.boards.routing import Router
from gellight.lab.boards.strip import TAIL_NETS
from gellight.ring.boards import Board as Preset
from gellight.ring.boards import find_board

RULES = Rules(clearance_mm=0.2, edge_mm=0.3, thickness_mm=1.6)
FUSED, LEDS = "5V_FUSED", "5V"
WIDTHS = {VBUS: 0.5, FUSED: 0.5, LEDS: 0.5, GROUND: 0.4}
"""of tracks that carry the LEDs' current; all others are 0.25 mm"""
SIGNAL_MM = 0.25
MARGIN_MM = 2.0
PARTS_MM: Point = (42.0, 40.0)
"""width and least height of the field of parts beside the controller"""
SCREW_MM = 3.2


def pin_nets(preset: Preset) -> dict[int, str]:
    """Return which net of the carrier each GPIO drives, by the firmware's preset of the controller."""
    others = carrier_pins(preset)
    return {
        preset.data_pin: "DATA",
        preset.trigger_pin: "TRIGGER",
        preset.output_pin: "OUTPUT",
        others.switch: "SWITCH",
        others.status: "STATUS",
        others.thermistor: "NTC",
    }


def carrier_board(name: str) -> Board:
    """Return the carrier for a controller; InputError for one without a carrier."""
    controller, preset = find_module(name), find_board(name)
    left = controller.body[0] + 2 * MARGIN_MM
    width, height = left + PARTS_MM[0], max(PARTS_MM[1], controller.body[1] + 2 * MARGIN_MM)
    middle = (controller.body[0] / 2 + MARGIN_MM, height - controller.body[1] / 2 - MARGIN_MM)
    field = (left, height - PARTS_MM[1])
    parts = (_module(controller, preset, middle), *_parts(field))
    holes = tuple(((x, y), SCREW_MM) for x in (left + 2.5, width - 4.0) for y in (height - 4.0, field[1] + 4.0))
    pads = [pad for part in parts for pad in part.pads()]
    router = Router(width, height, RULES, pads, holes)
    nets = sorted({pad.net for pad in pads} - {""}, key=lambda net: (net == GROUND, -WIDTHS.get(net, 0), net))
    router.route_all({net: WIDTHS.get(net, SIGNAL_MM) for net in nets})
    board = Board(
        name=f"gellight-carrier-{name}",
        title=f"GelLight carrier for {controller.item.value}",
        outline=polygon((0, 0), (width, 0), (width, height), (0, height)),
        rules=RULES,
        parts=parts,
        tracks=tuple(router.tracks),
        vias=tuple(router.vias),
        holes=holes,
    )
    return replace(board, pours=ground_planes(board))


def _module(controller: Module, preset: Preset, middle: Point) -> Part:
    driven = pin_nets(preset)
    nets = {}
    for number, label in enumerate(controller.pins, start=1):
        net = driven.get(label, "") if isinstance(label, int) else label if label in (GROUND, LOGIC, VBUS) else ""
        nets[str(number)] = net
    return Part("U1", controller.item, controller.footprint, middle, 0.0, nets)


def _parts(field: Point) -> Iterator[Part]:
    def part(name: str, item: Item, footprint: Footprint, at: Point, quarters: int, *nets: str, **more: str) -> Part:
        numbered = {str(1 + n): net for n, net in enumerate(nets)}
        return Part(name, item, footprint, (field[0] + at[0], field[1] + at[1]), quarters * pi / 2, numbered | more)

    gates = (GROUND, "DATA", "SHIFTED", GROUND, GROUND, "", GROUND, "", GROUND, GROUND, "", GROUND, GROUND, LEDS)
    yield part("F1", catalogue.POLYFUSE_500MA, POLYFUSE, (11, 36), 0, VBUS, FUSED)
    yield part("C1", catalogue.CAPACITOR_1U, CHIP_0603, (16.5, 32), 3, FUSED, GROUND)
    yield part("U2", catalogue.LOAD_SWITCH, SOT23_6, (20.5, 35), 0, FUSED, GROUND, "SWITCH", "SLEW", "", LEDS)
    yield part("C2", catalogue.CAPACITOR_2N2, CHIP_0603, (23.5, 31.5), 3, "SLEW", GROUND)
    yield part("R1", catalogue.RESISTOR_2K2, CHIP_0603, (19, 31.5), 3, "SWITCH", GROUND)
    yield part("C3", catalogue.CAPACITOR_470U, ELECTROLYTIC, (31, 34.5), 0, LEDS, GROUND)
    yield part("U3", catalogue.LEVEL_SHIFTER, SOIC14, (14, 22), 0, *gates)
    yield part("C4", catalogue.CAPACITOR_100N, CHIP_0603, (20.5, 26), 3, LEDS, GROUND)
    yield part("R2", catalogue.RESISTOR_330, CHIP_0603, (22, 19), 0, "SHIFTED", "DIN")
    socket = tuple(reversed([{"5V": LEDS}.get(net, net) for net in TAIL_NETS]))
    yield part("J1", catalogue.SOCKET_FFC, FFC6, (37.5, 20), 1, *socket)
    yield part("R3", catalogue.RESISTOR_10K, CHIP_0603, (28, 25), 0, LOGIC, "NTC")
    yield part("C5", catalogue.CAPACITOR_100N, CHIP_0603, (28, 22.5), 2, GROUND, "NTC")
    yield part("D1", catalogue.STATUS_LED, CHIP_0603, (9.5, 11), 1, GROUND, "LIT")
    yield part("R4", catalogue.RESISTOR_1K, CHIP_0603, (6.5, 11), 1, "STATUS", "LIT")
    yield part("D2", catalogue.CLAMP, SOT23, (14.5, 10), 0, GROUND, LOGIC, "TRIGGER")
    yield part("R5", catalogue.RESISTOR_1K, CHIP_0603, (19.5, 12), 0, "TRIGGER", "TRIGGER_IN")
    yield part("R6", catalogue.RESISTOR_330, CHIP_0603, (19.5, 15), 0, "OUTPUT", "TRIGGER_OUT")
    yield part("J2", catalogue.PLUG_XH, JST_XH4, (22, 5), 0, "TRIGGER_IN", "TRIGGER_OUT", GROUND, LOGIC)
