"""Errors on balls pressed into the simulated sensor: `python -m tests.benchmarks.presses [BUNDLE]`.

The 4 mm ball .5, 1, 1.5 and 2 mm deep at 20 random places, with noise of 1 grey level; a line a figure, a column a
depth. Of a bundle that tells its errors, also what its calibration said of normals held out, and which share of the
pixels in contact lies within the bounds that promise nine in ten.
"""

import sys
from dataclasses import asdict

import numpy as np

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.opening import open_camera
from gellight.reconstruction.error_bounds import FILE_NAME
from gellight.reconstruction.integration import angle_deg, normals
from sim_reference.geometry import AS_BUILT
from tests.helpers.simulated_bundle import TEST_SEED, ball_presses, evaluate_simulated

DEPTHS_MM = (0.5, 1.0, 1.5, 2.0)


def main(source: str = "synthetic", presses: int = 20) -> None:
    bundle = load_bundle(source)
    columns = [of_bundle(bundle, presses, depth) for depth in DEPTHS_MM]
    for name in columns[0]:
        print(f"{name:26}" + "".join(f"{column[name]:10.4g}" for column in columns))
    if "held_out" in bundle.metrics:
        print(f"the calibration says: {bundle.metrics['held_out']}")


def of_bundle(bundle: Bundle, presses: int, depth_mm: float) -> dict[str, float]:
    if FILE_NAME in bundle.files:
        return with_bounds(bundle, presses, depth_mm)
    return asdict(evaluate_simulated(bundle, presses=presses, depth_mm=depth_mm))


def with_bounds(bundle: Bundle, presses: int, depth_mm: float) -> dict[str, float]:
    """Return mean errors in contact of a sensor that is set as its bundle says, and the shares within its bounds."""
    random, kept = np.random.default_rng(TEST_SEED), []
    with open_camera("sim://?programme=0&fps=1000", bundle=bundle) as camera:
        reconstructor = Reconstructor(bundle)
        for press in ball_presses(AS_BUILT, presses, random, depth_mm):
            camera.stage.press("BALL", depth_mm, press.x_mm, press.y_mm)
            frame = reconstructor.reconstruct(camera.read())
            true, bounds = frame.camera_frame.truth, frame.error_bounds
            off_mm, angle = frame.depth_mm - true.depth_mm, angle_deg(frame.normal_map, normals(true.gradient_map))
            shape_mm, at = np.abs(off_mm - off_mm[true.contact].mean()), true.contact
            within = (angle <= bounds.normal_deg)[at].mean(), (shape_mm <= bounds.shape_mm)[at].mean()
            kept.append([angle[at].mean(), np.abs(off_mm)[at].mean(), *within])
    names = "contact_normal_mae_deg", "contact_depth_mae_mm", "normals_within_bounds", "shape_within_bounds"
    return dict(zip(names, np.mean(kept, axis=0).tolist(), strict=True))


if __name__ == "__main__":
    main(*sys.argv[1:2])
