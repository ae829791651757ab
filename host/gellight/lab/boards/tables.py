"""What an assembly house needs beside the Gerbers: the bill of materials and where each part goes."""

import csv
import io
from collections.abc import Iterable
from math import degrees

from gellight.lab.boards.model import Board, Part

BOM_COLUMNS = ("Comment", "Designator", "Footprint", "Quantity", "Manufacturer", "Manufacturer Part Number", "Mounted")
PLACEMENT_COLUMNS = ("Designator", "Val", "Package", "Mid X", "Mid Y", "Rotation", "Layer")


def bill_of_materials(board: Board) -> str:
    """Return a line for each thing that is bought, as CSV; `Mounted` says whether the house or you solder it."""
    bought: dict[tuple[str, ...], list[Part]] = {}
    for part in board.parts:
        if part.item.number:
            key = (part.item.value, part.footprint.name, part.item.maker, part.item.number)
            bought.setdefault(key, []).append(part)
    rows = [
        (value, ",".join(part.reference for part in parts), package, len(parts), maker, number,
         "house" if parts[0].item.mounted else "by hand")
        for (value, package, maker, number), parts in bought.items()
    ]  # fmt: skip
    return _csv(BOM_COLUMNS, rows)


def placement(board: Board) -> str:
    """Return the middle (mm, y up) and the turn (degrees, anticlockwise) of each part that the house mounts, as CSV."""
    rows = [
        (part.reference, part.item.value, part.footprint.name, f"{part.at[0]:.4f}", f"{part.at[1]:.4f}",
         f"{degrees(part.turn_rad) % 360:.3f}", "top")
        for part in board.parts if part.item.number and part.item.mounted
    ]  # fmt: skip
    return _csv(PLACEMENT_COLUMNS, rows)


def _csv(columns: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([columns, *rows])
    return text.getvalue()
