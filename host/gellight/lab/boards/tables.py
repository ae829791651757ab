"""What an assembly house needs beside the Gerbers: the bill of materials and where each part goes."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Sequence
from math import ceil, degrees

from gellight.lab.boards.catalogue import OTHERS
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


def shopping_list(boards: Sequence[Board]) -> str:
    """Return all that is bought for one sensor and for ten, as CSV: what the boards carry, then the rest."""
    counted = Counter(part.item for board in boards for part in board.parts if part.item.number)
    wanted = [(item, count, 10.0 * count) for item, count in counted.items()]
    wanted += [(item, count, max(count, 10 * each)) for item, count, each in OTHERS]
    rows = [(item.value, item.maker, item.number, one, ceil(ten)) for item, one, ten in wanted]
    return _csv(("What", "Maker", "Order number", "For one", "For ten"), rows)


def _csv(columns: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([columns, *rows])
    return text.getvalue()
