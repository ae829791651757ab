"""Scale of the depth of surfaces that are known by a formula: `python -m tests.benchmarks.integrators`.

First Gaussian bumps, smooth and sharp caps and a plane, in the middle of the view and at its border; then the bumps,
ours beside two published recipes on the same slopes. Both recipes solve Poisson's equation by a cosine transform, as we
do, and differ in two places (read in the sources of gs_sdk 2359f03 and gsrobotics 321d6a2, written here anew): the
transform's frequencies are counted from 1 instead of 0, and the divergence is a difference over two pixels that is not
halved (gs_sdk) or over one pixel, which halves what the first makes of it (gsrobotics). Slopes are those of Gaussian
bumps in the middle of the view, in closed form.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn

from gellight.reconstruction.integration import integrate
from tests.helpers.analytic_surfaces import Surface, fitted_scale, gaussian, plane, sharp_cap, smooth_cap

Array = NDArray[np.float64]
SHAPES = ((240, 320), (480, 640))
SIGMAS_PX = (5, 10, 20, 40)
SIZES_PX = (5, 10, 20, 40, 60)
"""of a bump its width at half height, of a cap its diameter"""
POSITIONS = 16
Maker = Callable[[tuple[int, int], float, tuple[float, float]], Surface]
SURFACES: dict[str, Maker] = {
    "gaussian": lambda shape, size, centre: gaussian(shape, size / np.sqrt(8 * np.log(2)), centre),
    "smooth cap": smooth_cap,
    "sharp cap": sharp_cap,
}


@dataclass(frozen=True)
class DepthScale:
    """What becomes of the height of one surface under `integrate`, float32."""

    surface: str
    size_px: float
    place: str
    shape: tuple[int, int]
    scale: float
    """best-fitting factor, 1 is right; the mean over the positions"""
    scale_spread: float
    """standard deviation over sub-pixel positions"""
    largest_error: float
    """of any pixel, relative to the height of the surface"""


def depth_scales() -> list[DepthScale]:
    found = []
    for shape in SHAPES:
        for size in SIZES_PX:
            for place in ("middle", "border"):
                found += [depth_scale(name, size, place, shape) for name in SURFACES]
        found.append(compared("plane", max(shape), "everywhere", shape, [plane(shape, 0.3, -0.2)]))
    return found


def depth_scale(name: str, size: float, place: str, shape: tuple[int, int]) -> DepthScale:
    """Average over sub-pixel positions: many for the sharp rim, which falls between other samples at each."""
    rng = np.random.default_rng(0)
    middle = 0.0 if place == "middle" else shape[1] / 2 - 0.2 * size
    count = POSITIONS if name == "sharp cap" else 4
    made = [SURFACES[name](shape, size, (middle + x, y)) for x, y in rng.uniform(-0.5, 0.5, (count, 2))]
    return compared(name, size, place, shape, made)


def compared(name: str, size: float, place: str, shape: tuple[int, int], surfaces: list[Surface]) -> DepthScale:
    scales, errors = [], []
    for surface in surfaces:
        depth = integrate(surface.gradient_map.astype(np.float32), 1.0)
        scales.append(fitted_scale(depth, surface.depth))
        error = depth - (surface.depth - np.median(surface.depth))
        errors.append(float(np.abs(error).max() / np.ptp(surface.depth)))
    return DepthScale(name, size, place, shape, float(np.mean(scales)), float(np.std(scales)), max(errors))


def gs_sdk(gradient_map: Array) -> Array:
    """Return the depth (H, W) in pixels of gradient_map (H, W, 2) after the recipe of gs_sdk."""
    return counted_from_one(two_pixels(gradient_map[..., 0], 1) + two_pixels(gradient_map[..., 1], 0))


def gsrobotics(gradient_map: Array) -> Array:
    """Return the depth (H, W) in pixels of gradient_map (H, W, 2) after the recipe of gsrobotics."""
    return counted_from_one(one_pixel(gradient_map[..., 0], 1) + one_pixel(gradient_map[..., 1], 0))


def two_pixels(slope: Array, axis: int) -> Array:
    """Return slope[i + 1] - slope[i - 1]; numpy's gradient is half of it."""
    return 2 * np.gradient(slope, axis=axis)


def one_pixel(slope: Array, axis: int) -> Array:
    """Return slope[i + 1] - slope[i]."""
    return np.diff(slope, axis=axis, append=slope.take([-1], axis))


def counted_from_one(divergence: Array) -> Array:
    """Solve Poisson's equation with the frequencies 1 to N of the cosine transform."""
    along = [2 * np.cos(np.pi * np.arange(1, n + 1) / n) - 2 for n in divergence.shape]
    return idctn(dctn(divergence, norm="ortho") / (along[0][:, None] + along[1]), norm="ortho")


def ours(gradient_map: Array) -> Array:
    """Return the depth as the frame path finds it."""
    return integrate(gradient_map, 1.0)


def height(depth: Array) -> float:
    """Return the height of the bump in the middle above the view's border."""
    rows, columns = depth.shape
    return float(depth[rows // 2, columns // 2] - np.median(depth[0]))


def main() -> None:
    print("image        surface      size px  place       scale   +-      largest error")
    for s in depth_scales():
        size = f"{s.shape[1]} x {s.shape[0]}"
        figures = f"{s.scale:.4f}  {s.scale_spread:.4f}  {s.largest_error:.2%}"
        print(f"{size:11}  {s.surface:11}  {s.size_px:7g}  {s.place:10}  {figures}")
    print("\nheight found / true height, Gaussian bumps")
    print(f"{'image':12}{'sigma px':>9}{'GelLight':>10}{'gs_sdk':>10}{'gsrobotics':>12}")
    for shape in SHAPES:
        for sigma in SIGMAS_PX:
            true = gaussian(shape, sigma, (0.0, 0.0))
            scales = [height(find(true.gradient_map)) / height(true.depth) for find in (ours, gs_sdk, gsrobotics)]
            print(f"{shape[1]} x {shape[0]:<6}{sigma:9}{scales[0]:10.3f}{scales[1]:10.2f}{scales[2]:12.2f}")


if __name__ == "__main__":
    main()
