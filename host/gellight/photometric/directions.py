"""Photometric stereo under any lights: a vector for each, which may change over the view, found on balls.

Where the untouched gel showed R_k under light k, a surface with the unit normal n shows

    I_k = rho R_k (v_k . n)        v_k = (v_x, v_y, v_z), linear in the place (x, y)

with a factor rho common to all lights. A distant light has the same v everywhere (its direction over its z); one that
is near changes over the view. Nothing is assumed about where lights stand, how many there are, or their colours.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError, first_line
from gellight.bundle.contents import UNZIPPING, arrays_of, npz
from gellight.photometric.solver import LEAST_LIGHTS, slopes, solve_robustly

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
FILE_NAME = "directions.npz"
"""in a bundle"""
_REMEDY = "make it with `gellight calibrate channels`"
_BLOCK = 65536  # chosen: pixels solved at once, so that memory does not grow with the picture
_SHADOW = 0.15
"""of what the untouched gel shows: a darker pixel is taken for shadowed"""


def _recorded() -> NDArray[np.uint8]:
    return np.zeros((0, 0, 3), np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class LightDirections:
    """K lights of one sensor."""

    vectors: Array
    """(K, 3, 3) v_k = vectors[k] @ (1, x, y), x and y from -1 to 1 over the view"""
    untouched: Floats
    """(K, H, W) what the untouched gel shows under each light, grey levels"""
    noise_grey: float
    """of one pixel"""
    pixel_size_mm: float
    groups: NDArray[np.uint8] = field(default_factory=_recorded)
    """(G, n, 3) colours of a ring of n LEDs, shown in turn; none where the pictures come from elsewhere.

    A light is then what one colour of the camera sees of one group: see `lights_of`"""
    camera_height_mm: float = 0.0
    """above the gel at rest, as it seems from within the gel; 0 where nobody told"""

    @property
    def image_shape(self) -> tuple[int, int]:
        """(H, W)"""
        return self.untouched.shape[1], self.untouched.shape[2]

    def rows(self, pixels: NDArray[np.intp]) -> Floats:
        """(K, 3, N) R_k v_k at pixels, which are counted row by row."""
        places = view_places(self.image_shape, pixels)
        vectors = np.einsum("kij,jn->kin", self.vectors, places)
        return np.asarray(vectors * self.untouched.reshape(len(self.vectors), 1, -1)[:, :, pixels], np.float32)

    def gradient_map(self, levels: Floats) -> tuple[Floats, NDArray[np.uint8]]:
        """Solve (K, H, W) grey levels: (H, W, 2) slopes, and how many lights each pixel was solved with."""
        if levels.shape != self.untouched.shape:
            raise InputError(
                f"the pictures are {levels.shape} (lights, rows, columns), the lights are of {self.untouched.shape}: "
                "give a picture of this camera for each light, in the same order"
            )
        flat, signals = np.arange(levels[0].size), levels.reshape(len(levels), -1)
        result, used = np.zeros((2, flat.size), np.float32), np.zeros(flat.size, np.uint8)
        deviation = np.full(len(levels), self.noise_grey, np.float32)
        dark = _SHADOW * self.untouched.reshape(len(levels), -1)
        for start in range(0, flat.size, _BLOCK):
            chosen = flat[start : start + _BLOCK]
            lit = signals[:, chosen] > dark[:, chosen]
            scaled, seen = solve_robustly(signals[:, chosen], self.rows(chosen), lit, deviation)
            result[:, chosen], used[chosen] = slopes(scaled), seen.sum(axis=0)
        shape = self.image_shape
        return np.moveaxis(result.reshape(2, *shape), 0, 2), used.reshape(shape)

    def content(self) -> bytes:
        """Return them as the content of an .npz file."""
        return npz(vars(self))

    @classmethod
    def of_content(cls, content: bytes, source: str) -> Self:
        """Read them from the content of a file that came from `source`; InputError for what is no such file."""
        try:
            stored = arrays_of(content)
            given = {name: stored[name] for name in ("vectors", "untouched", "noise_grey", "pixel_size_mm")}
            groups = stored["groups"] if "groups" in stored else _recorded()
            height = stored["camera_height_mm"] if "camera_height_mm" in stored else np.zeros(())
        except (*UNZIPPING, KeyError) as error:
            raise InputError(f"{source} holds no lights ({first_line(error)}): {_REMEDY}") from error
        vectors, untouched = given["vectors"], given["untouched"]
        every = (*given.values(), groups, height)
        numbers = all(array.dtype.kind in "fiu" and np.isfinite(array).all() for array in every)
        sized = untouched.ndim == 3 and untouched.size and len(untouched) >= LEAST_LIGHTS
        right = numbers and sized and vectors.shape == (len(untouched), 3, 3)
        right = right and all(given[name].ndim == 0 and given[name] > 0 for name in ("noise_grey", "pixel_size_mm"))
        right = right and groups.ndim == 3 and groups.shape[2] == 3 and height.ndim == 0 and bool(height >= 0)
        if not right or (len(groups) and len(lights_of(groups)) != len(untouched)):
            raise InputError(f"{source} holds no lights of one sensor: {_REMEDY}")
        return cls(
            vectors=vectors.astype(np.float64),
            untouched=untouched.astype(np.float32),
            groups=groups.astype(np.uint8),
            noise_grey=float(given["noise_grey"]),
            pixel_size_mm=float(given["pixel_size_mm"]),
            camera_height_mm=float(height),
        )


def lights_of(groups: NDArray[np.uint8]) -> list[tuple[int, int]]:
    """Return the lights of groups (G, n, 3): number of the group and colour of the camera, for each colour it lights.

    Nothing need be unmixed: what a colour sees of LEDs of other colours too is a sum of lights, which is a light.
    """
    return [
        (number, int(colour)) for number, group in enumerate(groups) for colour in np.flatnonzero(group.any(axis=0))
    ]


def levels_of(pictures: Sequence[Sequence[NDArray[np.uint8]]], groups: NDArray[np.uint8]) -> Floats:
    """(K, H, W) grey levels of the lights of `groups`, from pictures (H, W, 3) of each group, which are averaged."""
    means = [np.stack(taken).mean(axis=0, dtype=np.float32) for taken in pictures]
    return np.stack([means[group][..., colour] for group, colour in lights_of(groups)])


def view_places(image_shape: tuple[int, int], pixels: NDArray[np.intp]) -> Array:
    """(3, N) 1, x, y of pixels that are counted row by row, x and y from -1 to 1 over the view."""
    height, width = image_shape
    x, y = 2 * (pixels % width) / (width - 1) - 1, 2 * (pixels // width) / (height - 1) - 1
    return np.stack([np.ones(len(pixels)), x, y])
