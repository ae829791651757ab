"""All files of both boards, as `gellight optimize make boards` writes them, and the tables for an assembly house.

The strip follows the sensor. The carrier of a controller does not: its KiCad project lies in `carriers/` with what
KiCad plots of it, and `python -m tests.helpers.kicad` makes those archives anew after a change.
"""

import csv
import io
from collections import Counter
from importlib.resources import files as resources
from math import ceil, degrees

from gellight.base.csv_file import csv_text
from gellight.base.errors import InputError
from gellight.ring.boards import find_board
from gellight_design.boards.catalogue import CARRIERS, OTHERS, find_lamp
from gellight_design.boards.currents import drop_v, full_ma
from gellight_design.boards.gerbers import gerber_archive
from gellight_design.boards.kicad import board_file, project_file
from gellight_design.boards.model import Board, Item, Part
from gellight_design.boards.strip import strip_board
from gellight_design.parts import led_table
from sim_reference.geometry import SensorGeometry

Files = dict[str, bytes | str]
BOM_COLUMNS = ("Comment", "Designator", "Footprint", "Quantity", "Manufacturer", "Manufacturer Part Number", "Mounted")
PLACEMENT_COLUMNS = ("Designator", "Val", "Package", "Mid X", "Mid Y", "Rotation", "Layer")


def board_files(geometry: SensorGeometry, controller: str, package: str) -> Files:
    """Return the files of the strip and of the carrier; raises as `strip_board` and `carrier_files` do."""
    strip, carrier = strip_board(geometry, package), carrier_files(controller)
    return {
        f"{strip.name}.kicad_pro": project_file(strip),
        f"{strip.name}.kicad_pcb": board_file(strip),
        f"{strip.name}-gerbers.zip": gerber_archive(strip),
        f"{strip.name}-bom.csv": bill_of_materials(strip),
        f"{strip.name}-placement.csv": placement(strip),
        **carrier,
        "shopping.csv": shopping_list(strip, carrier[f"gellight-carrier-{controller}-bom.csv"].decode()),
        "leds.csv": led_table(geometry),
        "order.txt": _order(geometry, controller, package, strip),
    }


def carrier_files(controller: str) -> dict[str, bytes]:
    """Return the files of a controller's carrier as they are kept; InputError for one without a carrier."""
    if controller not in CARRIERS:
        raise InputError(f"there is no carrier for a board {controller!r}: choose {', '.join(CARRIERS)}")
    folder = resources("gellight_design.boards") / "carriers" / controller
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir(), key=lambda path: path.name)}


def bill_of_materials(board: Board) -> str:
    """Return a line for each thing that is bought, as CSV; `Mounted` says whether the house or you solder it."""
    bought: dict[tuple[str, ...], list[Part]] = {}
    for part in board.parts:
        if part.item.number:
            key = (part.item.value, part.footprint.name, part.item.maker, part.item.number)
            bought.setdefault(key, []).append(part)
    rows = [
        (value, ",".join(part.reference for part in parts), package, len(parts), maker, number, "house")
        for (value, package, maker, number), parts in bought.items()
    ]
    return csv_text(BOM_COLUMNS, rows)


def placement(board: Board) -> str:
    """Return the middle (mm, y up) and the turn (degrees, anticlockwise) of each part that the house mounts, as CSV."""
    rows = [
        (part.reference, part.item.value, part.footprint.name, f"{part.at[0]:.4f}", f"{part.at[1]:.4f}",
         f"{degrees(part.turn_rad) % 360:.3f}", "top")
        for part in board.parts if part.item.number
    ]  # fmt: skip
    return csv_text(PLACEMENT_COLUMNS, rows)


def shopping_list(strip: Board, carrier_bom: str) -> str:
    """Return all that is bought for one sensor and for ten, as CSV: what the boards carry, then the rest."""
    counted = Counter(part.item for part in strip.parts if part.item.number)
    for row in csv.DictReader(io.StringIO(carrier_bom)):
        item = Item(row["Comment"], row["Manufacturer"], row["Manufacturer Part Number"])
        counted[item] += int(row["Quantity"])
    wanted = [(item, count, 10.0 * count) for item, count in counted.items()]
    wanted += [(item, count, max(count, 10 * each)) for item, count, each in OTHERS]
    rows = [(item.value, item.maker, item.number, one, ceil(ten)) for item, one, ten in wanted]
    return csv_text(("What", "Maker", "Order number", "For one", "For ten"), rows)


def _order(geometry: SensorGeometry, controller: str, package: str, strip: Board) -> str:
    """Return what the order forms ask, and how to tell the firmware."""
    lamp, count, drop = find_lamp(package), len(geometry.led_colours), drop_v(geometry, strip, package)
    pins = find_board(controller).carrier
    assert pins is not None, "a controller with a carrier has its pins in board.toml"
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
        f"gellight ring configure --board {controller} --leds {count} --led {lamp.kind} --pin switch={pins.switch} "
        f"--pin status={pins.status}",
    ]
    return "\n".join(lines) + "\n"
