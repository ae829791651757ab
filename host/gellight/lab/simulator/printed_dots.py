"""Marker dots printed on the simulated gel: where they are seen when it is pressed and dragged, and how they look.

A dot lies at X on the gel at rest. The gel moves it to X + u along itself and d into the sensor, and a camera at the
height H above the gel at rest sees it at (X + u) H / (H - d): also where the surface is drawn along parallel rays.
"""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from gellight.reconstruction.force_file import ForceRecord
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from sim_reference.view import seen_height_mm

Array = NDArray[np.float64]
EDGE_PX = 1.0
"""over which the edge of a dot goes from full to none"""


@dataclass(frozen=True, kw_only=True)
class PrintedDots:
    """A lattice of dots around the middle of the gel."""

    columns: int
    rows: int
    pitch_mm: float = 2.0
    diameter_mm: float = 0.6
    albedo: float = 0.35
    """of the paint, as a share of the gel's"""
    missing: float = 0.0
    """share of the dots that have come off"""
    seed: int = 0
    """which of them"""

    @property
    def places_mm(self) -> Array:
        """(N, 2) x, y on the gel at rest, from the middle, row by row; those that came off as well."""
        x, y = ((np.arange(count) - (count - 1) / 2) * self.pitch_mm for count in (self.columns, self.rows))
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    @property
    def printed(self) -> NDArray[np.bool_]:
        """(N,) which have not come off."""
        count = self.columns * self.rows
        order = np.random.default_rng([self.seed, 3]).permutation(count)
        return np.asarray(order >= round(self.missing * count))


def seen_px(gel_mm: Array, depth_mm: Array, geometry: SensorGeometry) -> Array:
    """Return (N, 2) x, y px in the picture of (N, 2) points of the gel that are (N,) mm deep."""
    height, middle = dots_height_mm(geometry), (np.array(geometry.image_shape[::-1]) - 1) / 2
    return np.asarray(gel_mm * (height / (height - depth_mm))[:, None] / geometry.pixel_size_mm + middle)


def dots_height_mm(geometry: SensorGeometry) -> float:
    """Return H: how high the camera seems to stand, and as high as it stands where the surface has parallel rays."""
    return seen_height_mm(geometry) if geometry.perspective else geometry.camera_height_mm


def paint(pictures: NDArray[np.float32], places_px: Array, diameter_px: float, albedo: float) -> None:
    """Darken (L, H, W) pictures where dots are, in place."""
    reach = diameter_px / 2 + EDGE_PX
    for x, y in places_px.tolist():
        columns, rows = (slice(max(int(at - reach), 0), max(int(at + reach) + 2, 0)) for at in (x, y))
        part = pictures[:, rows, columns]
        across = np.arange(columns.start, columns.start + part.shape[2]) - x
        down = np.arange(rows.start, rows.start + part.shape[1]) - y
        inside = np.clip((diameter_px / 2 - np.hypot(across[None, :], down[:, None])) / EDGE_PX + 0.5, 0, 1)
        part *= (1 - (1 - albedo) * inside).astype(np.float32)


ERROR_SHARE = 0.05  # measured: 3.7 % rms on 13 presses whose force finite elements know
SIDE_ERROR_SHARE = 0.05
"""of forces along the gel, which the layer gives as it finds them"""
ERROR_FLOOR_N = 0.005
"""a gel at rest weighs 0; what presses it less than the threshold of a contact is not felt"""
JUDGED_N = (0.151, 11.757)
"""lightest and heaviest of those presses"""
JUDGED = 13
"""presses"""


def known_force(geometry: SensorGeometry) -> dict[str, bytes]:
    """Return `force.json`, by its name, for a bundle of the simulated sensor."""
    record = ForceRecord(
        gel_thickness_mm=geometry.gel_thickness_mm,
        poisson_ratio=geometry.poisson_ratio,
        youngs_modulus_mpa=FemGel.youngs_modulus_mpa,
        error_share=ERROR_SHARE,
        error_floor_n=ERROR_FLOOR_N,
        lightest_n=JUDGED_N[0],
        heaviest_n=JUDGED_N[1],
        side_error_share=SIDE_ERROR_SHARE,
        camera_height_mm=dots_height_mm(geometry),
        readings=JUDGED,
        source="the simulated gel",
        created=datetime.now(UTC).replace(microsecond=0),
    )
    return record.files()
