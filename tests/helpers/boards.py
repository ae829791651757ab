"""Rings of other numbers of LEDs, boards as files, and the flat strip rolled up again."""

import csv
import io
import re
import warnings
import zipfile
from dataclasses import dataclass, replace
from functools import cache
from math import cos, pi, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight_design.boards.kicad import board_file, project_file
from gellight_design.boards.model import Board, turned
from gellight_design.parts import led_table
from sim_reference.geometry import SensorGeometry
from tests.helpers.places import CHECKOUT

Array = NDArray[np.float64]


def ring_of(count: int, **changes: float) -> SensorGeometry:
    """A sensor with this many LEDs in thirds of red, green and blue."""
    colours = "".join("RGB"[3 * n // count] for n in range(count))
    return replace(SensorGeometry(), led_colours=colours, **changes)  # type: ignore[arg-type]


def write_files(folder: Path, files: dict[str, bytes | str]) -> None:
    """Write files as the verb does, and unpack their archives."""
    for name, content in files.items():
        data = content.encode() if isinstance(content, str) else content
        (folder / name).write_bytes(data)
        if name.endswith(".zip"):
            zipfile.ZipFile(io.BytesIO(data)).extractall(folder)


def write_project(folder: Path, board: Board) -> None:
    """Write what KiCad needs to judge a board."""
    write_files(folder, {f"{board.name}.kicad_pcb": board_file(board), f"{board.name}.kicad_pro": project_file(board)})


def table(geometry: SensorGeometry) -> tuple[Array, Array]:
    """Places and axes of the LEDs as leds.csv has them, (N, 3) each, y down."""
    rows = list(csv.DictReader(io.StringIO(led_table(geometry))))
    places = [[float(row[f"{name}_mm"]) for name in "xyz"] for row in rows]
    return np.array(places), np.array([[float(row[f"axis_{name}"]) for name in "xyz"] for row in rows])


def rolled_up(flat: Array, geometry: SensorGeometry) -> Array:
    """Where points of the flat strip, (..., 2), lie once it is rolled to a cone with LED 0 at azimuth 0, y down.

    Lengths from the apex stay as they are; angles widen by 1 / cos(tilt). Seen from the LEDs the strip runs clockwise.
    """
    tilt, count = geometry.incident_angle_rad, len(geometry.led_colours)
    sector = 2 * pi * cos(tilt)
    rho = np.hypot(flat[..., 0], flat[..., 1])
    turn = np.arctan2(flat[..., 1], flat[..., 0]) % (2 * pi)
    azimuth = (sector - sector / count / 2 - turn) / cos(tilt)
    height = geometry.camera_height_mm - geometry.mounting_height_mm
    z = height - (rho - geometry.ring_radius_mm / cos(tilt)) * sin(tilt)
    return np.stack([rho * cos(tilt) * np.cos(azimuth), -rho * cos(tilt) * np.sin(azimuth), z], axis=-1)


def axes_at(flat: Array, geometry: SensorGeometry) -> Array:
    """The direction in which something on the flat strip looks once it is rolled up, from three points beside it."""
    right, up = (rolled_up(flat + step, geometry) - rolled_up(flat, geometry) for step in ([1e-4, 0], [0, 1e-4]))
    mirror = np.array([1, -1, 1])  # y down, z to the camera: left-handed; the cross product is taken with y up
    axis = np.cross(right * mirror, up * mirror) * mirror
    unit: Array = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
    return unit


def objects(path: Path) -> list[Any]:
    """Return the flashes, lines and arcs of a Gerber, as another library reads them."""
    from gerbonara.rs274x import GerberFile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return list(GerberFile.open(path).objects)


def spot(x: float, y: float) -> str:
    return f"{x + 0:.2f} {y + 0:.2f}".replace("-0.00", "0.00")


Sexp = list[Any]
CARRIERS = CHECKOUT / "host/gellight_design/gellight_design/boards/carriers"


def sexp(text: str) -> Sexp:
    """Return an S-expression, as KiCad writes its files, as nested lists of words."""
    stack: list[Sexp] = [[]]
    for word in re.findall(r'"(?:\\.|[^"\\])*"|[()]|[^\s()"]+', text):
        if word == "(":
            stack.append([])
        elif word == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(word.strip('"'))
    return stack[0][0]


def within(node: Sexp, name: str) -> list[Sexp]:
    """Return the lists of a name in a list."""
    return [one for one in node if isinstance(one, list) and one[0] == name]


@dataclass(frozen=True)
class CarrierPad:
    """A pad of a carrier, mm, y up."""

    part: str
    number: str
    at: tuple[float, float]
    size: tuple[float, float]
    net: str


@dataclass(frozen=True)
class Carrier:
    """A carrier as its KiCad file has it."""

    name: str
    values: dict[str, str]
    """by reference"""
    places: dict[str, tuple[float, float, float]]
    """x, y in mm and turn in degrees, by reference"""
    printed: dict[str, list[str]]
    """texts on the silkscreen, by reference"""
    pads: list[CarrierPad]
    holes: list[tuple[float, float]]
    copper: list[tuple[Array, float]]
    """tracks and vias: both ends (2, 2), half a width"""

    def nets(self) -> dict[str, set[tuple[str, str]]]:
        """Return the pads of each net: reference of the part and number of the pad."""
        found: dict[str, set[tuple[str, str]]] = {}
        for pad in self.pads:
            if pad.net:
                found.setdefault(pad.net, set()).add((pad.part, pad.number))
        return found


def _numbers(node: Sexp, name: str) -> tuple[float, ...]:
    return tuple(map(float, within(node, name)[0][1:]))


def _point(node: Sexp, name: str = "at") -> tuple[float, float]:
    x, y = _numbers(node, name)[:2]
    return x, -y


@cache
def read_carrier(name: str) -> Carrier:
    board = sexp((CARRIERS / name / f"gellight-carrier-{name}.kicad_pcb").read_text())
    carrier = Carrier(name, {}, {}, {}, [], [], [])
    for part in within(board, "footprint"):
        texts = {text[1]: text[2] for text in within(part, "fp_text")}
        x, y, turn = (*_numbers(part, "at"), 0.0)[:3]
        if texts["reference"].startswith("H"):
            carrier.holes.append((x, -y))
            continue
        me = texts["reference"]
        carrier.values[me], carrier.places[me] = texts["value"], (x, -y, turn)
        words = within(part, "fp_text")
        carrier.printed[me] = [word[2] for word in words if within(word, "layer")[0][1] == "F.SilkS"]
        for pad in within(part, "pad"):
            across = turned(_point(pad), radians(turn), (x, -y))
            width, height = _numbers(pad, "size")
            size = (height, width) if round(turn / 90) % 2 else (width, height)
            net = within(pad, "net")
            carrier.pads.append(CarrierPad(me, pad[1], across, size, net[0][2] if net else ""))
    for track in within(board, "segment"):
        ends = np.array([_point(track, "start"), _point(track, "end")])
        carrier.copper.append((ends, _numbers(track, "width")[0] / 2))
    for via in within(board, "via"):
        carrier.copper.append((np.array([_point(via)] * 2), _numbers(via, "size")[0] / 2))
    return carrier
