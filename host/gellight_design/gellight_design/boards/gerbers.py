"""Gerber and drill files of a board, in one archive as board houses take it.

Gerber: Ucamco, "The Gerber Layer Format Specification", 2023.03: millimetres, six decimals, the layer named by its
attribute FileFunction. Drill files: Excellon in the form of IPC-NC-349.
"""

import io
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import degrees

from gellight_design.boards.model import BACK, FRONT, Arc, Board, Layer, Path, PlacedPad, Point

LINE_MM = 0.1
"""of drawn outlines"""
MASK_MM = 0.05
"""that the solder mask, or the coverlay, stays back from a pad"""
LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""in the archive: the same board gives the same bytes"""


def gerber_archive(board: Board) -> bytes:
    """Return all layers and the drill files of a board as a zip archive."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in gerber_files(board).items():
            archive.writestr(zipfile.ZipInfo(f"{board.name}-{name}", LONG_AGO), text, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def gerber_files(board: Board) -> dict[str, str]:
    """Return the files by their names: copper, mask, paste and outline, and the holes."""
    pads = list(board.pads())
    paste = [pad for pad in pads if pad.pad.paste]
    plated = [(via.at, via.drill_mm) for via in board.vias]
    files = {
        "F_Cu.gbr": _copper(board, FRONT, "Copper,L1,Top"),
        "B_Cu.gbr": _copper(board, BACK, "Copper,L2,Bot"),
        "F_Mask.gbr": _flashes("Soldermask,Top", pads, MASK_MM),
        "B_Mask.gbr": _flashes("Soldermask,Bot", [], MASK_MM),
        "F_Paste.gbr": _flashes("Paste,Top", paste, 0.0),
        "Edge_Cuts.gbr": _drawing("Profile,NP", board.outline),
        "PTH.drl": _drill(plated, "Plated,1,2,PTH"),
    }
    return files | {f"{name.capitalize()}.gbr": _drawing(f"Other,{name}", way) for name, way in board.notes.items()}


@dataclass
class _Gerber:
    """A layer that is being written; apertures are numbered as they are first used."""

    function: str
    apertures: dict[str, int] = field(default_factory=dict)
    body: list[str] = field(default_factory=list)

    def text(self) -> str:
        head = [
            "%TF.GenerationSoftware,GelLight,gellight*%",
            f"%TF.FileFunction,{self.function}*%",
            "%FSLAX46Y46*%",
            "%MOMM*%",
            "%AMTURNED*21,1,$1,$2,0,0,$3*%",
            *(f"%ADD{number}{shape}*%" for shape, number in self.apertures.items()),
            "%LPD*%",
            "G75*",
        ]
        return "\n".join([*head, *self.body, "M02*"]) + "\n"

    def select(self, shape: str) -> None:
        self.body.append(f"D{self.apertures.setdefault(shape, 10 + len(self.apertures))}*")

    def flash(self, shape: str, at: Point) -> None:
        self.select(shape)
        self.body.append(f"{_xy(at)}D03*")

    def draw(self, path: Path, width: float) -> None:
        self.select(f"C,{width:.4f}")
        self.body.append(f"{_xy(path.start)}D02*")
        if isinstance(path, Arc):
            way, (x, y) = "G03" if path.to_rad > path.from_rad else "G02", path.start
            self.body += [f"{way}*", f"{_xy(path.end)}I{_number(-x)}J{_number(-y)}D01*", "G01*"]
        else:
            self.body += ["G01*", f"{_xy(path.end)}D01*"]


def _copper(board: Board, layer: Layer, function: str) -> str:
    gerber = _Gerber(function)
    for pad in board.pads() if layer == FRONT else ():
        gerber.flash(_shape(pad, 0.0), pad.at)
    for via in board.vias:
        gerber.flash(f"C,{via.size_mm:.4f}", via.at)
    for track in board.tracks:
        if track.layer == layer:
            gerber.draw(track.path, track.width_mm)
    return gerber.text()


def _flashes(function: str, pads: Iterable[PlacedPad], larger: float) -> str:
    gerber = _Gerber(function)
    for pad in pads:
        gerber.flash(_shape(pad, larger), pad.at)
    return gerber.text()


def _drawing(function: str, paths: Iterable[Path]) -> str:
    gerber = _Gerber(function)
    for path in paths:
        gerber.draw(path, LINE_MM)
    return gerber.text()


def _shape(pad: PlacedPad, larger: float) -> str:
    """Return the aperture of a pad, larger by a margin at each side."""
    width, height, turn = pad.pad.size[0] + 2 * larger, pad.pad.size[1] + 2 * larger, degrees(pad.turn_rad)
    return f"TURNED,{width:.4f}X{height:.4f}X{turn % 180:.5f}"


def _drill(holes: Iterable[tuple[Point, float]], function: str) -> str:
    by_size: dict[float, list[Point]] = {}
    for at, diameter in holes:
        by_size.setdefault(round(diameter, 3), []).append(at)
    sizes = sorted(by_size)
    lines = ["M48", f"; #@! TF.FileFunction,{function}", "METRIC,TZ"]
    lines += [f"T{1 + n}C{size:.3f}" for n, size in enumerate(sizes)]
    lines += ["%", "G05"]
    for n, size in enumerate(sizes):
        lines += [f"T{1 + n}", *(f"X{x:.4f}Y{y:.4f}" for x, y in by_size[size])]
    return "\n".join([*lines, "M30"]) + "\n"


def _xy(at: Point) -> str:
    return f"X{_number(at[0])}Y{_number(at[1])}"


def _number(value: float) -> str:
    return str(round(value * 1e6))
