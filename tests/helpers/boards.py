"""Rings of other numbers of LEDs, boards as files, and the flat strip rolled up again."""

import csv
import functools
import io
import warnings
import zipfile
from dataclasses import replace
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.lab.boards.carrier import carrier_board
from gellight.lab.boards.kicad import board_file, project_file
from gellight.lab.boards.model import Board
from gellight.lab.design.parts import led_table
from sim_reference.geometry import SensorGeometry

Array = NDArray[np.float64]
carrier_of = functools.cache(carrier_board)
"""routed once a session"""


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
