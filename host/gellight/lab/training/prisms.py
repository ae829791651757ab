"""Labelled presses of a prism: the gel that lies on its faces has a known slope.

A prism of known angle, or a cube on its edge (45 degrees), is pressed more or less upright. It shows two normals only,
so it goes beside balls: into the table that GelNet learns from, and as a judge. The angle between its faces is known;
how far it leans to one side is not. For a label the widths of its faces tell it, for a judge the normals that are felt.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.csv_file import number_in, read_rows
from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.dots import Dots
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.image_files import read_image
from gellight.lab.training.label_file import REFUSED, check_image
from gellight.lab.training.table import RIM, PressTable, TableOptions
from gellight.reconstruction.light_drift import difference_of

Floats = NDArray[np.float32]
PRISM_COLUMNS = ("image", "edge_x1_px", "edge_y1_px", "edge_x2_px", "edge_y2_px", "face_px", "angle_deg")
ROUNDING = "rounding_px"
"""optional column: how the edge is rounded, standard deviation of a Gaussian"""
LEAN, LEAN_ERROR = "lean_deg", "lean_error_deg"
"""optional columns: how far the prism leans to one side, and its standard error"""
_SURE = 3.0
"""in standard errors: a smaller lean is not taken for one"""
_ROUNDING_PX = 2.0
"""where the column is missing"""
_ROUNDED = 2.0
"""times the rounding: nearer to the edge the gel is less steep than the faces"""
FLATTEST_DEG, STEEPEST_DEG, MOST_LEAN_DEG = 1.0, 75.0, 15.0
_PARTS = 8
"""of the edge, whose angles are compared"""
_RIM_SHARE = 0.25
"""of the pixels beyond `RIM` of a face, how many are trained on"""


@dataclass(frozen=True, kw_only=True)
class PrismPress:
    """One press of a prism: its image, its edge, and how wide the gel lies on its faces."""

    image: Path
    edge_px: tuple[float, float, float, float]
    """x and y of both ends"""
    face_px: float
    """from the edge to where the gel leaves the face"""
    angle_rad: float
    """between each face and the gel at rest, where the prism stands upright"""
    lean_rad: float = 0.0
    """by which the face behind the edge, as `across` points, is less steep and the other one steeper"""
    rounding_px: float = _ROUNDING_PX
    dots: Dots | None = None
    """the marker dots of the gel, where it has some"""

    @property
    def across(self) -> tuple[float, float]:
        """Unit vector across the edge, x and y."""
        x1, y1, x2, y2 = self.edge_px
        length = math.hypot(x2 - x1, y2 - y1)
        return (y1 - y2) / length, (x2 - x1) / length

    def frame(self) -> CameraFrame:
        """Read its image as a camera frame, dots filled; InputError where it cannot be read."""
        image = read_image(self.image)
        image = self.dots.filled(image) if self.dots else image
        return CameraFrame(image=image, time_s=0.0, sequence=0, source=str(self.image))

    def distances(self, image_shape: tuple[int, int]) -> tuple[Floats, Floats]:
        """Return how far each pixel lies along the edge from its first end, and across it, (H, W) px."""
        rows, columns = np.indices(image_shape, dtype=np.float32)
        dx, dy = columns - self.edge_px[0], rows - self.edge_px[1]
        x, y = self.across
        return np.asarray(y * dx - x * dy, np.float32), np.asarray(x * dx + y * dy, np.float32)

    def faces(self, image_shape: tuple[int, int], inset_px: float = 1.0) -> NDArray[np.int8]:
        """Mark the (H, W) pixels of the two faces -1 and 1, 0 elsewhere; the rounded edge and the rim are left out."""
        along, across = self.distances(image_shape)
        x1, y1, x2, y2 = self.edge_px
        wide = np.abs(across)
        inside = (along > 0) & (along < math.hypot(x2 - x1, y2 - y1))
        inside &= (wide > _ROUNDED * self.rounding_px) & (wide < self.face_px - inset_px)
        return np.asarray(np.where(inside, np.sign(across), 0), np.int8)

    def gradient(self, side: int) -> tuple[float, float]:
        """Return d(depth)/dx, d(depth)/dy on one face: the gel is deepest at the edge."""
        x, y = self.across
        fall = -side * math.tan(self.angle_rad - side * self.lean_rad)
        return fall * x, fall * y


@dataclass(frozen=True, kw_only=True)
class PrismError:
    """The angle of a prism as it is felt."""

    image: str
    angle_deg: float
    """known, of each face"""
    felt_deg: float
    """mean of both faces: half of 180 degrees less the angle between them"""
    lean_deg: float
    """half the difference of both faces"""
    error_deg: float
    """standard error of both, by how parts of the edge differ; what a calibration has wrong everywhere comes on top"""
    normal_deg: float
    """mean angle between the normals felt and those of the faces, of a prism that leans as it is felt to"""
    depth_mm: float
    """mean absolute depth error on the faces, its mean taken off: nothing says how deep the edge lies"""
    pixels: int


def read_prisms(path: Path, *, image_shape: tuple[int, int], dots: Dots | None = None) -> list[PrismPress]:
    """Read and check a csv with the columns of `PRISM_COLUMNS`; the images are beside it, image_shape is (H, W).

    Raises InputError naming file, row and value. A row with a text in the column `refused` is passed over.
    """
    presses = []
    for line, row in read_rows(path, "presses", PRISM_COLUMNS):
        if (row.get(REFUSED) or "").strip():
            continue
        where = f"{path}, line {line}"
        x1, y1, x2, y2, face, angle = (number_in(row, column, where) for column in PRISM_COLUMNS[1:])
        rounding, lean, error = (
            number_in(row, column, where) if (row.get(column) or "").strip() else default
            for column, default in ((ROUNDING, _ROUNDING_PX), (LEAN, 0.0), (LEAN_ERROR, 0.0))
        )
        image = path.parent / (row["image"] or "").strip()
        press = PrismPress(
            image=image,
            edge_px=(x1, y1, x2, y2),
            face_px=face,
            angle_rad=prism_angle_rad(angle, where),
            lean_rad=sure_lean_rad(lean, error),
            rounding_px=rounding,
            dots=dots,
        )
        _check(press, image_shape, where)
        presses.append(press)
    if not presses:
        raise InputError(f"{path} has no prisms: add a line for each image with the columns {', '.join(PRISM_COLUMNS)}")
    return presses


def prism_angle_rad(angle_deg: float, where: str) -> float:
    """Return the angle in rad; InputError for one that no gel can follow."""
    if not FLATTEST_DEG <= angle_deg <= STEEPEST_DEG:
        raise InputError(
            f"{where}: the angle of the prism is {angle_deg:g} degrees: give that between a face and the gel at rest, "
            f"{FLATTEST_DEG:g} to {STEEPEST_DEG:g}; a cube on its edge has 45"
        )
    return math.radians(angle_deg)


def sure_lean_rad(lean_deg: float, error_deg: float) -> float:
    """Return the lean that a label takes, rad: none where it may be an error, since most prisms are held upright."""
    return math.radians(lean_deg) if abs(lean_deg) > _SURE * error_deg else 0.0


def most_lean_deg(angle_deg: float) -> float:
    """Return how far a prism of this angle may lean: both faces stay such as a gel can follow."""
    return min(MOST_LEAN_DEG, angle_deg - FLATTEST_DEG, STEEPEST_DEG - angle_deg)


def _check(press: PrismPress, image_shape: tuple[int, int], where: str) -> None:
    height, width = image_shape
    x1, y1, x2, y2 = press.edge_px
    if not (min(x1, x2) >= 0 and max(x1, x2) <= width - 1 and min(y1, y2) >= 0 and max(y1, y2) <= height - 1):
        raise InputError(
            f"{where}: the edge from ({x1:g}, {y1:g}) to ({x2:g}, {y2:g}) px leaves the image of {width} x {height} "
            "px: correct it or remove the line"
        )
    if math.hypot(x2 - x1, y2 - y1) < 1 or press.face_px <= 0 or press.rounding_px < 0:
        raise InputError(f"{where}: edge, face_px or {ROUNDING} is no length: correct it or remove the line")
    lean, most = math.degrees(press.lean_rad), most_lean_deg(math.degrees(press.angle_rad))
    if abs(lean) > most:
        raise InputError(
            f"{where}: {LEAN} is {lean:g}, at most {most:g} degrees may be: press the prism upright, or remove the line"
        )
    check_image(press.image, image_shape, where)
    if len(np.unique(press.faces(image_shape))) < 3:
        raise InputError(f"{where}: no pixel is left of a face {press.face_px:g} px wide: press deeper")


def with_prisms(
    table: PressTable, prisms: Sequence[PrismPress], reference: Floats, options: TableOptions, *, follow_light: bool
) -> PressTable:
    """Return a table of ball presses with the faces of prisms added, whose depth nobody knows.

    reference: (H, W, 3), grey levels.
    Of the pixels beyond 0.9 of a face a quarter is trained on, as the gel may have left it there already.
    """
    if not prisms:
        return table
    random = np.random.default_rng(options.seed)
    parts = [_rows(press, reference, options, follow_light, random) for press in prisms]
    numbers = np.arange(len(prisms), dtype=np.int32) + table.image.max() + 1
    return replace(
        table,
        rows=np.concatenate([table.rows, *parts]),
        image=np.concatenate([table.image, np.repeat(numbers, [len(part) for part in parts])]),
        depth_mm=None,
    )


def _rows(
    press: PrismPress, reference: Floats, options: TableOptions, follow_light: bool, random: np.random.Generator
) -> Floats:
    shape = (reference.shape[0], reference.shape[1])
    difference = difference_of(press.frame().image, reference, follow_light=follow_light)
    faces = seen_faces(press, shape, options.inset_px)
    rim = np.abs(press.distances(shape)[1]) > RIM * press.face_px
    y, x = np.nonzero((faces != 0) & (~rim | (random.random(shape) < _RIM_SHARE)))
    slopes = np.array([press.gradient(side) for side in (-1, 1)])[(faces[y, x] + 1) // 2]
    return np.column_stack([difference[y, x], x, y, slopes]).astype(np.float32)


def seen_faces(press: PrismPress, shape: tuple[int, int], inset_px: float = 1.0) -> NDArray[np.int8]:
    """Return the faces, (H, W) as `PrismPress.faces`, without what dots hide: what is filled in was not seen."""
    faces = press.faces(shape, inset_px)
    return np.where(press.dots.mask(read_image(press.image)), 0, faces).astype(np.int8) if press.dots else faces


def prism_errors(bundle: Bundle, prisms: Sequence[PrismPress]) -> list[PrismError]:
    """Reconstruct each press and compare the angle of its faces with the known one; InputError for other sizes."""
    reconstructor = Reconstructor(bundle, masked=False, undistorted=False)
    return [prism_error(press, reconstructor.reconstruct(press.frame()), bundle.pixel_size_mm) for press in prisms]


def prism_error(press: PrismPress, felt: TactileFrame, pixel_size_mm: tuple[float, float]) -> PrismError:
    """Compare the faces as they are felt with the known ones; how the prism leans is taken from the faces felt."""
    shape = (felt.depth_mm.shape[0], felt.depth_mm.shape[1])
    faces = seen_faces(press, shape)
    half, lean, error = _felt_angles(press, felt.normal_map, faces)
    press = replace(press, lean_rad=lean)
    off, fall_mm = [], np.zeros(shape)
    for side in (-1, 1):
        x, y = press.gradient(side)
        true = np.array([-x, -y, 1]) / math.sqrt(1 + x * x + y * y)
        off.append(np.degrees(np.arccos(np.clip(felt.normal_map[faces == side] @ true, -1, 1))))
        fall_mm[faces == side] = math.hypot(x, y) * math.sqrt(math.prod(pixel_size_mm))
    depth_error = (felt.depth_mm + fall_mm * np.abs(press.distances(shape)[1]))[faces != 0]
    return PrismError(
        image=press.image.name,
        angle_deg=math.degrees(press.angle_rad),
        felt_deg=math.degrees(half),
        lean_deg=math.degrees(lean),
        error_deg=math.degrees(error),
        normal_deg=float(np.concatenate(off).mean()),
        depth_mm=float(np.abs(depth_error - depth_error.mean()).mean()),
        pixels=int((faces != 0).sum()),
    )


def _felt_angles(press: PrismPress, normal_map: Floats, faces: NDArray[np.int8]) -> tuple[float, float, float]:
    """Return half the sum and half the difference of the angles of both faces, and the standard error of each, rad."""
    along, _ = press.distances((faces.shape[0], faces.shape[1]))
    part = np.minimum((_PARTS * along / along[faces != 0].max()).astype(np.intp), _PARTS - 1)
    angles = np.full((_PARTS, 2), np.nan)
    for number in range(_PARTS):
        for column, side in enumerate((-1, 1)):
            seen = normal_map[(faces == side) & (part == number)].astype(np.float64)
            if len(seen):
                x, y, z = seen.mean(axis=0)
                angles[number, column] = math.atan2(side * (x * press.across[0] + y * press.across[1]), z)
    angles = angles[np.isfinite(angles).all(axis=1)]
    both = angles @ np.array([[1, 1], [1, -1]]) / 2
    half, lean = both.mean(axis=0).tolist()
    return half, lean, float(both.std(axis=0).max()) / math.sqrt(max(len(both) - 1, 1))
