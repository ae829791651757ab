"""The circuit of a board as a KiCad 6 schematic: a box a part, and at each pin the name of its net.

The format: https://dev-docs.kicad.org/en/file-formats/sexpr-schematic/.
"""

from collections.abc import Iterator
from itertools import groupby

from gellight.lab.boards.kicad import identifier, quoted
from gellight.lab.boards.model import Board, Part, Point

STEP_MM = 2.54
PIN_MM = 2.54
HALF_MM = 12.7
"""of the width of a box"""
COLUMN_MM, TOP_MM, LOWEST_MM = 76.2, 25.4, 190.0
PAPER = ("A4", "A3", "A2", "A1", "A0")
PAPER_WIDTH = (297, 420, 594, 841, 1189)
FONT = "(effects (font (size 1.27 1.27)))"
HIDDEN = "(effects (font (size 1.27 1.27)) hide)"


def schematic_file(board: Board) -> str:
    """Return the .kicad_sch file."""
    places = dict(_places(board.parts))
    width = max(x for x, _ in places.values()) + COLUMN_MM / 2
    paper = next((name for name, most in zip(PAPER, PAPER_WIDTH, strict=True) if most >= width), PAPER[-1])
    sheet = identifier(board.name, "sheet")
    symbols = {_symbol_name(part): part for part in board.parts}
    lines = [
        "(kicad_sch (version 20211123) (generator gellight)",
        f'(uuid {sheet}) (paper "{paper}")',
        "(lib_symbols",
        *(_symbol(part) for part in symbols.values()),
        ")",
        *(line for part in board.parts for line in _placed(board, part, places[part.reference])),
        '(sheet_instances (path "/" (page "1")))',
        "(symbol_instances",
        *(
            f'(path "/{identifier(board.name, "symbol", part.reference)}" (reference {quoted(part.reference)}) '
            f"(unit 1) (value {quoted(part.item.value)}) (footprint {quoted('gellight:' + part.footprint.name)}))"
            for part in board.parts
        ),
        "))",
    ]
    return "\n".join(lines) + "\n"


def _numbers(part: Part) -> list[str]:
    """Return the numbers of the pads, each once."""
    return [number for number, _ in groupby(pad.number for pad in part.footprint.pads)]


def _symbol_name(part: Part) -> str:
    return f"gellight:{part.footprint.name}-{len(_numbers(part))}"


def _height(part: Part) -> float:
    return ((len(_numbers(part)) + 1) // 2 + 1) * STEP_MM


def _places(parts: tuple[Part, ...]) -> Iterator[tuple[str, Point]]:
    """Yield where the box of each part is: columns, filled from the top; on the grid of 1.27 mm."""
    x, y = TOP_MM + HALF_MM, TOP_MM
    for part in parts:
        if y + _height(part) > LOWEST_MM:
            x, y = x + COLUMN_MM, TOP_MM
        yield part.reference, (x, y + STEP_MM)
        y += _height(part) + 3 * STEP_MM


def _pins(part: Part) -> Iterator[tuple[str, Point, bool]]:
    """Yield number, place (y up, from the upper middle of the box) and side of each pin, as on the package."""
    numbers = _numbers(part)
    left = (len(numbers) + 1) // 2
    for n, number in enumerate(numbers):
        at_left = n < left
        row = n if at_left else len(numbers) - 1 - n
        yield number, ((-1 if at_left else 1) * (HALF_MM + PIN_MM), -(row + 1) * STEP_MM), at_left


def _symbol(part: Part) -> str:
    name = _symbol_name(part)
    plain = name.removeprefix("gellight:")
    pins = [
        f'(pin passive line (at {x:.2f} {y:.2f} {0 if left else 180}) (length {PIN_MM}) (name "~" {FONT}) '
        f"(number {quoted(number)} {FONT}))"
        for number, (x, y), left in _pins(part)
    ]
    return "\n  ".join(
        [
            f"(symbol {quoted(name)} (in_bom yes) (on_board yes)",
            f'(property "Reference" "U" (id 0) (at 0 2.54 0) {FONT})',
            f'(property "Value" {quoted(plain)} (id 1) (at 0 0 0) {HIDDEN})',
            f'(property "Footprint" "" (id 2) (at 0 0 0) {HIDDEN})',
            f'(property "Datasheet" "" (id 3) (at 0 0 0) {HIDDEN})',
            f"(symbol {quoted(plain + '_0_1')} (rectangle (start {-HALF_MM} 0) (end {HALF_MM} {-_height(part):.2f}) "
            "(stroke (width 0.2) (type default) (color 0 0 0 0)) (fill (type background))))",
            f"(symbol {quoted(plain + '_1_1')}",
            *pins,
            "))",
        ]
    )


def _placed(board: Board, part: Part, at: Point) -> Iterator[str]:
    x, y = at
    me = identifier(board.name, "symbol", part.reference)
    yield (
        f"(symbol (lib_id {quoted(_symbol_name(part))}) (at {x:.2f} {y:.2f} 0) (unit 1) (in_bom yes) (on_board yes) "
        f"(uuid {me})\n"
        f'  (property "Reference" {quoted(part.reference)} (id 0) (at {x - 10:.2f} {y - 1.5:.2f} 0) {FONT})\n'
        f'  (property "Value" {quoted(part.item.value)} (id 1) (at {x + 5:.2f} {y - 1.5:.2f} 0) {FONT})\n'
        f'  (property "Footprint" {quoted("gellight:" + part.footprint.name)} (id 2) (at {x:.2f} {y:.2f} 0) {HIDDEN})\n'
        f'  (property "Datasheet" "" (id 3) (at {x:.2f} {y:.2f} 0) {HIDDEN})\n'
        f'  (property "MPN" {quoted(part.item.number)} (id 4) (at {x:.2f} {y:.2f} 0) {HIDDEN}))'
    )
    for number, (dx, dy), left in _pins(part):
        net, end = part.nets.get(number, ""), f"{x + dx:.2f} {y - dy:.2f}"
        if net:
            turn, side = (180, "right") if left else (0, "left")
            yield (
                f"(global_label {quoted(net)} (shape passive) (at {end} {turn}) "
                f"(effects (font (size 1.27 1.27)) (justify {side})) (uuid {identifier(me, number)}))"
            )
        else:
            yield f"(no_connect (at {end}) (uuid {identifier(me, number)}))"
