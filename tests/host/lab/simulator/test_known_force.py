"""The simulated sensor knows its force: what finite elements weighed it tells within its error."""

import numpy as np
import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.picture import PictureSteps, PreparedCamera
from gellight.frames.view import View
from gellight.lab.simulator.known_force import ERROR_SHARE, known_force
from gellight.lab.simulator.simulated_camera import open_simulated
from gellight.reconstruction.force_file import FILE_NAME, ForceRecord, read_force
from sim_reference.geometry import SensorGeometry
from tests.helpers.fem_presses import NAMES, force_n, picture
from tests.helpers.small_bundles import SHAPE, ordinary, with_files


def test_every_press_of_the_finite_elements_is_weighed_within_the_error() -> None:
    """Pictures with noise, of a gel that is no ideal layer; none of it was fitted."""
    reconstructor = Reconstructor(load_bundle("synthetic"))
    forces = {name: reconstructor.reconstruct(picture(name)).force for name in NAMES}
    off = np.array([force.normal_n - force_n(name) for name, force in forces.items() if force])
    said = np.array([force.error_n for force in forces.values() if force])
    assert len(off) == len(NAMES)
    assert np.abs(off / said).max() < 2, "errors: no press is two of them off,"
    assert np.sqrt(np.mean((off / said) ** 2)) < 1, "and they are one standard deviation at most"


def test_the_shipped_bundle_knows_what_the_simulator_says() -> None:
    shipped, now = (
        ForceRecord.model_validate_json(files[FILE_NAME]).model_dump(exclude={"created"})
        for files in (load_bundle("synthetic").files, known_force(SensorGeometry()))
    )
    assert shipped == now


@pytest.mark.parametrize("view", [None, View.of_box((16, 12, 128, 96), SHAPE)])
def test_the_force_is_of_the_gel_whatever_the_size_of_its_pictures(view: View | None) -> None:
    geometry = {"image_width_px": SHAPE[1], "image_height_px": SHAPE[0], "pixel_size_mm": 0.2352, "gel_thickness_mm": 4}
    with open_simulated("sim://?board=0", geometry) as camera:
        seen = PreparedCamera(camera, PictureSteps.with_view(view)) if view else camera
        record = read_force(with_files(ordinary(), "other", force__json=seen.bundle_files[FILE_NAME]))
    assert record is not None
    assert (record.gel_thickness_mm, record.error_share) == (4, ERROR_SHARE)
    assert seen.bundle_files.keys() == ({FILE_NAME, "picture.json"} if view else {FILE_NAME})
