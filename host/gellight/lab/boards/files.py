"""All files of both boards, as `gellight optimize boards` writes them."""

from gellight.lab.boards.carrier import carrier_board
from gellight.lab.boards.catalogue import find_lamp
from gellight.lab.boards.currents import drop_v, full_ma
from gellight.lab.boards.gerbers import gerber_archive
from gellight.lab.boards.kicad import board_file, project_file
from gellight.lab.boards.model import Board
from gellight.lab.boards.modules import carrier_pins
from gellight.lab.boards.picture import wiring_svg
from gellight.lab.boards.schematic import schematic_file
from gellight.lab.boards.strip import strip_board
from gellight.lab.boards.tables import bill_of_materials, placement, shopping_list
from gellight.ring.boards import find_board
from sim_reference.geometry import SensorGeometry

Files = dict[str, bytes | str]


def board_files(geometry: SensorGeometry, controller: str, package: str) -> Files:
    """Return the files of the strip and of the carrier; raises as `strip_board` and `carrier_board` do."""
    strip, carrier = strip_board(geometry, package), carrier_board(controller)
    return {
        **_files(strip),
        **_files(carrier),
        "shopping.csv": shopping_list([strip, carrier]),
        "wiring.svg": wiring_svg(strip, carrier),
        "order.txt": _order(geometry, controller, package, strip),
    }


def _files(board: Board) -> Files:
    return {
        f"{board.name}.kicad_pro": project_file(board),
        f"{board.name}.kicad_sch": schematic_file(board),
        f"{board.name}.kicad_pcb": board_file(board),
        f"{board.name}-gerbers.zip": gerber_archive(board),
        f"{board.name}-bom.csv": bill_of_materials(board),
        f"{board.name}-placement.csv": placement(board),
    }


def _order(geometry: SensorGeometry, controller: str, package: str, strip: Board) -> str:
    """Return what the order forms ask, and how to tell the firmware."""
    lamp, count, drop = find_lamp(package), len(geometry.led_colours), drop_v(geometry, strip, package)
    pins = carrier_pins(find_board(controller))
    lines = [
        "Nobody has ordered or built these boards yet.",
        "",
        "gellight-strip: flexible, polyimide, 2 layers, 0.2 mm with coverlay, copper 35 um, ENIG, parts on one side.",
        "Stiffener of polyimide at the back of the tail's end (layer Stiffener): 0.3 mm in all, for the FFC socket.",
        f"gellight-carrier-{controller}: FR-4, 2 layers, 1.6 mm, copper 35 um, parts on one side.",
        "Assembly: compare the preview of the house with wiring.svg; houses turn some packages otherwise.",
        "",
        f"All {count} LEDs white draw {full_ma(geometry, package):.0f} mA; the last then gets {1000 * drop:.0f} mV",
        "less than the contacts of the tail (copper at 60 degrees C, computed). The firmware allows 450 mA from USB.",
        "",
        "Tell the board, once it is flashed:",
        f"gellight ring configure --board {controller} --leds {count} --led {lamp.kind} --switch-pin {pins.switch} "
        f"--status-pin {pins.status}",
    ]
    return "\n".join(lines) + "\n"
