"""Which constant turns depth into newtons best: `python -m tests.benchmarks.force`; docs/force.md has the figures.

Each is fitted to one press of a 4 mm ball, and judged on other objects of the finite-element gel: by their true depth,
and by the depth that the shipped network feels in pictures with noise.
"""

from collections.abc import Callable

import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.force import Layer, indenting
from tests.helpers.fem_presses import NAMES, SPACING_MM, depth_mm, force_n, picture

WEIGHED = "ball4_1.0"
Pixels = tuple[float, float]
Measure = Callable[[np.ndarray, Pixels], float]


def layer(thickness_mm: float, poisson_ratio: float) -> Measure:
    known = Layer(thickness_mm, poisson_ratio)
    return lambda depth, pixels: indenting(depth, pixels, known).integral_mm2


def patch_volume(depth: np.ndarray, pixels: Pixels) -> float:
    """Volume of the contact patch."""
    return float(depth[find_contact(depth, pixels).mask].sum()) * pixels[0] * pixels[1]


def pressed_volume(depth: np.ndarray, pixels: Pixels) -> float:
    """Volume of all that is pressed in."""
    return float(np.maximum(depth, 0).sum()) * pixels[0] * pixels[1]


MEASURES: dict[str, Measure] = {
    "layer 5 mm, 0.49": layer(5, 0.49),
    "layer 4 mm": layer(4, 0.49),
    "layer 6 mm": layer(6, 0.49),
    "layer, ratio 0.45": layer(5, 0.45),
    "layer, ratio 0.499": layer(5, 0.499),
    "volume pressed in": pressed_volume,
    "volume of the patch": patch_volume,
}


def judge(what: str, depths: dict[str, tuple[np.ndarray, Pixels]]) -> None:
    """Print the force of each object as a share of the true one, by each constant."""
    print(f"{what:22}" + "".join(f"{name:>13}" for name in depths) + "        worst")
    for title, measure in MEASURES.items():
        found = {name: measure(*given) for name, given in depths.items()}
        constant = force_n(WEIGHED) / found[WEIGHED]
        shares = [constant * value / force_n(name) for name, value in found.items()]
        worst = max(abs(share - 1) for share in shares)
        print(f"{title:22}" + "".join(f"{share:13.3f}" for share in shares) + f"{100 * worst:11.1f} %")


VIEW_MM, ZERO_MM = 12.0, 0.03
FINGER = [name for name in NAMES if not name.startswith("tstep")]
"""the presses whose load is in such a view"""


def on_a_finger(name: str, random: np.random.Generator) -> np.ndarray:
    """Return the depth in a small view, less a plane that nobody knows."""
    depth = depth_mm(name)
    cut = (len(depth) - round(VIEW_MM / SPACING_MM)) // 2
    seen = depth[cut:-cut, cut:-cut]
    rows, columns = np.meshgrid(*(np.linspace(-1, 1, size) for size in seen.shape), indexing="ij")
    level, down, across = ZERO_MM * random.choice((-1, 1), 3)
    return np.asarray(seen + level + down * rows + across * columns)


def main() -> None:
    judge("true depth", {name: (depth_mm(name), (SPACING_MM, SPACING_MM)) for name in NAMES})
    bundle = load_bundle("synthetic")
    reconstructor = Reconstructor(bundle)
    felt = {name: (reconstructor.reconstruct(picture(name)).depth_mm, bundle.pixel_size_mm) for name in NAMES}
    judge("felt depth", felt)


if __name__ == "__main__":
    main()
