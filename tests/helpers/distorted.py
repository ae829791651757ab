"""Pictures through a lens whose distortion is known by formula; nothing here is shared with what measures it."""

from dataclasses import dataclass

import numpy as np

from tests.helpers.linear_sensor import GREY_PER_SLOPE

SHAPE = (480, 640)
PIXEL_MM = 0.0588


@dataclass(frozen=True, kw_only=True)
class TrueLens:
    """Brown's radial model in the direction from the gel to the picture; r is 1 in the corner of the picture."""

    k1: float = 0.0
    k2: float = 0.0
    centre_px: tuple[float, float] = (319.5, 239.5)
    pixel_mm: tuple[float, float] = (PIXEL_MM, PIXEL_MM)
    shape: tuple[int, int] = SHAPE

    @property
    def radius(self) -> float:
        return float(np.hypot(*self.shape)) / 2

    def to_picture(self, gel_mm: np.ndarray) -> np.ndarray:
        ideal = gel_mm / self.pixel_mm
        r2 = (ideal**2).sum(axis=-1, keepdims=True) / self.radius**2
        return ideal * (1 + self.k1 * r2 + self.k2 * r2**2) + self.centre_px

    def to_gel(self, picture_px: np.ndarray) -> np.ndarray:
        seen = picture_px - np.array(self.centre_px)
        ideal = seen
        for _ in range(25):
            r2 = (ideal**2).sum(axis=-1, keepdims=True) / self.radius**2
            ideal = seen / (1 + self.k1 * r2 + self.k2 * r2**2)
        return ideal * self.pixel_mm

    def gel_of_pixels(self) -> np.ndarray:
        """(H, W, 2) mm."""
        rows, columns = np.indices(self.shape)
        return self.to_gel(np.stack([columns, rows], axis=-1).astype(float))


class DivisionLens(TrueLens):
    """Another family of lenses (Fitzgibbon 2001), that no polynomial is equal to: ideal = seen / (1 + k1 r^2)."""

    def to_gel(self, picture_px: np.ndarray) -> np.ndarray:
        seen = picture_px - np.array(self.centre_px)
        r2 = (seen**2).sum(axis=-1, keepdims=True) / self.radius**2
        return seen / (1 + self.k1 * r2) * self.pixel_mm


def pin_picture(
    lens: TrueLens,
    *,
    pitch_mm: float = 2.0,
    angle_deg: float = 4.0,
    shift_mm: tuple[float, float] = (0.3, -0.4),
    pin_mm: float = 0.35,
    missing: float = 0.0,
    jitter_mm: float = 0.0,
    noise: float = 0.0,
    depth: float = -60.0,
    only: tuple[float, float] = (-np.inf, np.inf),
    seed: int = 0,
) -> np.ndarray:
    """(H, W, 3) uint8: soft round spots of `pin_mm` radius on light that falls off, some missing, only x in `only`."""
    rng = np.random.default_rng(seed)
    gel = lens.gel_of_pixels()
    turn = np.deg2rad(angle_deg)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    on_grid = (gel - shift_mm) @ axes.T / pitch_mm
    nearest = np.rint(on_grid)
    count = 80
    there = rng.random((count, count)) >= missing
    moved = rng.normal(0, jitter_mm / pitch_mm, (count, count, 2)) if jitter_mm else np.zeros((count, count, 2))
    index = nearest.astype(int) + count // 2
    place = nearest + moved[index[..., 0], index[..., 1]]
    distance = np.linalg.norm(on_grid - place, axis=-1) * pitch_mm
    spots = 1 / (1 + np.exp((distance - pin_mm) / 0.04)) * there[index[..., 0], index[..., 1]]
    spots *= (gel[..., 0] > only[0]) & (gel[..., 0] < only[1])
    image = untouched(lens.shape) + depth * spots[..., None]
    return np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)


def untouched(shape: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) light that falls off towards the corners, another one in each colour."""
    y, x = np.indices(shape) / np.array(shape)[:, None, None] - 0.5
    return np.stack([150 - 80 * (x**2 + y**2) + tilt * x for tilt in (30, -10, -25)], axis=-1)


def map_error_px(found: np.ndarray, true: np.ndarray) -> float:
    """Return how far (H, W, 2) gel points lie from the true ones, rms, px.

    Where the grid was put on the gel, and how it was turned, tells nothing of the lens: that motion is taken out.
    """
    a, b = found.reshape(-1, 2), true.reshape(-1, 2)
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    return float(np.sqrt(np.mean(np.sum((a @ (u @ v) - b) ** 2, axis=1)))) / PIXEL_MM


def dimple_picture(lens: TrueLens, *, pitch_mm: float = 2.0, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """(H, W, 3) uint8: pins press Gaussian dimples, 0.15 mm deep, into a gel that is lit from three sides."""
    gel = lens.gel_of_pixels()
    offset = gel - np.rint(gel / pitch_mm) * pitch_mm
    depth = 0.15 * np.exp(-(offset**2).sum(axis=-1) / (2 * 0.25**2))
    slopes = -offset / 0.25**2 * depth[..., None]
    image = untouched(lens.shape) + slopes @ GREY_PER_SLOPE.T
    image = image + np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)
