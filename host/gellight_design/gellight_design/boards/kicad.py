"""A board as a KiCad 6 project: the board and its rules, written as the S-expressions that its file format defines.

The format: https://dev-docs.kicad.org/en/file-formats/sexpr-pcb/. KiCad's y points down, so y changes its sign here.
"""

import json
import uuid
from collections.abc import Iterator
from math import degrees

from gellight_design.boards.model import FRONT, Arc, Board, Part, Path, Point, Track, Via

LAYERS = (
    '(0 "F.Cu" signal) (31 "B.Cu" signal) (34 "B.Paste" user) (35 "F.Paste" user) (36 "B.SilkS" user) '
    '(37 "F.SilkS" user) (38 "B.Mask" user) (39 "F.Mask" user) (40 "Dwgs.User" user) (44 "Edge.Cuts" user) '
    '(46 "B.CrtYd" user) (47 "F.CrtYd" user) (48 "B.Fab" user) (49 "F.Fab" user)'
)
SPACE = uuid.UUID("5d0a5a67-4f0b-4f35-9a3b-6d1f3e0f9f10")
"""of the identifiers: the same board gives the same file"""


def identifier(*names: object) -> str:
    """Return a UUID that depends on the names alone."""
    return str(uuid.uuid5(SPACE, "/".join(map(str, names))))


def quoted(text: str) -> str:
    """Return a string as the format writes it."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def board_file(board: Board) -> str:
    """Return the .kicad_pcb file."""
    numbers = {net: 1 + n for n, net in enumerate(board.nets())}
    lines = [
        "(kicad_pcb (version 20211014) (generator gellight)",
        f'(general (thickness {board.rules.thickness_mm:g})) (paper "A4") (title_block (title {quoted(board.title)}))',
        f"(layers {LAYERS})",
        "(setup (pad_to_mask_clearance 0.05))",
        '(net 0 "")',
        *(f"(net {number} {quoted(net)})" for net, number in numbers.items()),
        *(_footprint(board, part, numbers) for part in board.parts),
        *(_drawn(path, "Edge.Cuts", 0.1) for path in board.outline),
        *(_drawn(path, "Dwgs.User", 0.1) for paths in board.notes.values() for path in paths),
        *(_text(name, paths[0].start, "Dwgs.User") for name, paths in board.notes.items()),
        *(_track(track, numbers) for track in board.tracks),
        *(_via(via, numbers) for via in board.vias),
        ")",
    ]
    return "\n".join(lines) + "\n"


def project_file(board: Board) -> str:
    """Return the .kicad_pro file: the rules that KiCad checks the board by."""
    rules = {
        "min_clearance": board.rules.clearance_mm,
        "min_copper_edge_clearance": board.rules.edge_mm,
        "min_hole_clearance": 0.2,
        "min_hole_to_hole": 0.25,
        "min_through_hole_diameter": 0.3,
        "min_track_width": min(track.width_mm for track in board.tracks),
        "min_via_annular_width": 0.13,
        "min_via_diameter": 0.5,
    }
    net_class = {
        "name": "Default", "clearance": board.rules.clearance_mm, "track_width": 0.25, "via_diameter": 0.6,
        "via_drill": 0.3,
    }  # fmt: skip
    content = {
        "board": {"design_settings": {"rules": rules}},
        "meta": {"filename": f"{board.name}.kicad_pro", "version": 1},
        "net_settings": {"classes": [net_class], "meta": {"version": 2}},
        "sheets": [[identifier(board.name, "sheet"), ""]],
    }
    return json.dumps(content, indent=2) + "\n"


def _at(point: Point) -> str:
    return f"{point[0]:.6f} {-point[1]:.6f}"


def _footprint(board: Board, part: Part, numbers: dict[str, int]) -> str:
    turn = degrees(part.turn_rad) % 360
    bought = "" if part.item.number else " exclude_from_pos_files exclude_from_bom"
    lines = [
        f"(footprint {quoted('gellight:' + part.footprint.name)} (layer {quoted(FRONT)})",
        f"(tstamp {identifier(board.name, part.reference)}) (at {_at(part.at)} {turn:.6f}) (attr smd{bought})",
        f'(property "Manufacturer" {quoted(part.item.maker)}) (property "MPN" {quoted(part.item.number)})',
        _label("reference", part.reference, "F.Fab", turn),
        _label("value", part.item.value, "F.Fab", turn),
        *_courtyard(part),
        *_pads(part, turn, numbers),
        ")",
    ]
    return "\n  ".join(lines)


def _label(kind: str, text: str, layer: str, turn: float) -> str:
    font = "(effects (font (size 0.6 0.6) (thickness 0.1)))"
    return f"(fp_text {kind} {quoted(text)} (at 0 0 {turn:.6f}) (layer {quoted(layer)}) {font})"


def _courtyard(part: Part) -> Iterator[str]:
    (width, height), (x, y) = part.footprint.room, part.footprint.middle
    left, right, top, bottom = x - width / 2, x + width / 2, y + height / 2, y - height / 2
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        yield f'(fp_line (start {_at(start)}) (end {_at(end)}) (layer "F.CrtYd") (width 0.05))'


def _pads(part: Part, turn: float, numbers: dict[str, int]) -> Iterator[str]:
    for pad in part.footprint.pads:
        net = part.nets.get(pad.number, "")
        size = f"(size {pad.size[0]:.4f} {pad.size[1]:.4f})"
        layers = '(layers "F.Cu" "F.Mask"' + (' "F.Paste")' if pad.paste else ")")
        joined = f" (net {numbers[net]} {quoted(net)})" if net else ""
        yield f"(pad {quoted(pad.number)} smd rect (at {_at(pad.at)} {turn:.6f}) {size} {layers}{joined})"


def _drawn(path: Path, layer: str, width: float) -> str:
    kind, places = _places(path)
    return f"({'gr_' + kind} {places} (layer {quoted(layer)}) (width {width:g}))"


def _places(path: Path) -> tuple[str, str]:
    if isinstance(path, Arc):
        return "arc", f"(start {_at(path.start)}) (mid {_at(path.at(0.5))}) (end {_at(path.end)})"
    return "line", f"(start {_at(path.start)}) (end {_at(path.end)})"


def _text(text: str, at: Point, layer: str) -> str:
    return (
        f"(gr_text {quoted(text)} (at {_at(at)}) (layer {quoted(layer)}) (effects (font (size 1 1) (thickness 0.15))))"
    )


def _track(track: Track, numbers: dict[str, int]) -> str:
    kind, places = _places(track.path)
    return (
        f"({'arc' if kind == 'arc' else 'segment'} {places} (width {track.width_mm:g}) "
        f"(layer {quoted(track.layer)}) (net {numbers[track.net]}))"
    )


def _via(via: Via, numbers: dict[str, int]) -> str:
    return (
        f'(via (at {_at(via.at)}) (size {via.size_mm:g}) (drill {via.drill_mm:g}) (layers "F.Cu" "B.Cu") '
        f"(net {numbers[via.net]}))"
    )
