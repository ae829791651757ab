"""Scale of the depth, ours beside two published recipes, on the same slopes: `python -m tests.benchmarks.integrators`.

Both recipes solve Poisson's equation by a cosine transform, as we do, and differ in two places (read in the sources of
gs_sdk 2359f03 and gsrobotics 321d6a2, written here anew): the transform's frequencies are counted from 1 instead of 0,
and the divergence is a difference over two pixels that is not halved (gs_sdk) or over one pixel, which halves what the
first makes of it (gsrobotics). Slopes are those of Gaussian bumps in the middle of the view, in closed form.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn

from gellight.lab.evaluation.analytic_surfaces import gaussian
from gellight.reconstruction.integration import integrate

Array = NDArray[np.float64]
SHAPES = ((240, 320), (480, 640))
SIGMAS_PX = (5, 10, 20, 40)


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
    print("height found / true height, Gaussian bumps")
    print(f"{'image':12}{'sigma px':>9}{'GelLight':>10}{'gs_sdk':>10}{'gsrobotics':>12}")
    for shape in SHAPES:
        for sigma in SIGMAS_PX:
            true = gaussian(shape, sigma, (0.0, 0.0))
            scales = [height(find(true.gradient_map)) / height(true.depth) for find in (ours, gs_sdk, gsrobotics)]
            print(f"{shape[1]} x {shape[0]:<6}{sigma:9}{scales[0]:10.3f}{scales[1]:10.2f}{scales[2]:12.2f}")


if __name__ == "__main__":
    main()
