"""How the ring is read: all colours in one exposure, three LEDs in each of four, or every LED by itself.

With the light of equation 2, so that the schemes are compared at the paper's incident angle and nothing else differs.
A scheme is a matrix (pictures, K): which LED contributes how much to which picture. Photometric stereo then solves for
the normals from the pictures as they are mixed, crosstalk of the camera's colours included.
"""

from dataclasses import dataclass
from math import cos, tan

import numpy as np
from numpy.typing import NDArray

from sim_reference.optimizer.exposing import LightGroups
from sim_reference.optimizer.near_field import Ring, Scene, normal_error
from sim_reference.photometric_stereo import ring_directions
from sim_reference.refraction import VACUUM, Medium, refracted, transmittance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scheme:
    """A way of reading the ring."""

    name: str
    exposures: int
    pictures: Array
    """(pictures, K)"""


def directional_ring(number: int, angle_rad: float, points: int, medium: Medium = VACUUM) -> Ring:
    """Return parallel light of unit strength, `angle_rad` from the normal in air, as the gel sees it."""
    inside = refracted(angle_rad, medium)
    through = float(transmittance(np.array(angle_rad), np.array(inside), medium))
    strength = through * cos(angle_rad) / cos(inside)
    vectors = np.repeat(strength * ring_directions(number, inside)[:, None], points, axis=1)
    azimuth = np.repeat(2 * np.pi * np.arange(number)[:, None] / number, points, axis=1)
    return Ring(vectors, azimuth, np.full((number, points), 1 / tan(inside)))


def one_exposure(number: int, crosstalk: Array | None = None) -> Scheme:
    """Return the paper's RRRRGGGGBBBB: a third of the ring in each colour, all at once."""
    colour = np.arange(number) * 3 // number
    return Scheme("one exposure", 1, _mixed(np.eye(3), crosstalk) @ (colour == np.arange(3)[:, None]))


def single_leds(number: int, crosstalk: Array | None = None) -> Scheme:
    """Return the scheme of number / 3 exposures, in each of which three LEDs 120 degrees apart shine in R, G and B."""
    third = number // 3
    frames = [np.eye(number)[[frame, frame + third, frame + 2 * third]] for frame in range(third)]
    return Scheme(
        f"{third} exposures", third, np.concatenate([_mixed(np.eye(3), crosstalk) @ frame for frame in frames])
    )


def in_turn(number: int) -> Scheme:
    """Return the scheme of section 2.3.1: every LED by itself before a monochrome camera."""
    return Scheme(f"{number} exposures", number, np.eye(number))


def directional_error(
    scenes: list[Scene],
    scheme: Scheme,
    angle_rad: float,
    camera: LightGroups,
    *,
    drop_shadows: bool = False,
    medium: Medium = VACUUM,
    exposure_restored: bool = False,
) -> tuple[float, float, float]:
    """Return MAE, Top5, Top1 in rad, averaged over the scenes, under parallel light.

    Every picture has the full scale of one LED that faces the gel, as in the coarse study; with `exposure_restored`
    the exposure makes up for what the window takes.
    """
    points = len(scenes[0].normals)
    ring = directional_ring(scheme.pictures.shape[1], angle_rad, points, medium)
    strength = float(np.linalg.norm(ring.vectors[0, 0])) if exposure_restored else 1.0
    gain = 1 / (strength * float(scheme.pictures.sum(axis=1).max()))
    errors = [
        normal_error(seen, ring, scheme.pictures, camera, drop_shadows=drop_shadows, gain=gain) for seen in scenes
    ]
    mae, top5, top1 = np.mean(errors, axis=0).tolist()
    return mae, top5, top1


def _mixed(pictures: Array, crosstalk: Array | None) -> Array:
    return pictures if crosstalk is None else np.asarray(crosstalk @ pictures)
