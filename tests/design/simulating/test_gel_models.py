"""The gel by finite elements behind the simulated sensor: kept by content, its force known, the impossible refused."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.picture import PictureSteps, PreparedCamera
from gellight.frames.view import View
from gellight.lab.simulator import stage
from gellight.lab.simulator.printed_dots import known_force
from gellight.lab.simulator.scene import Press, Scene
from gellight.lab.simulator.simulated_camera import open_simulated
from gellight.opening import open_camera
from gellight.reconstruction.force_file import FILE_NAME, ForceRecord
from gellight_design.simulating import gel_models
from gellight_design.simulating.gel_models import KeptPresses, check_memory, free_memory
from sim_reference.deformation import NotConverged, grid
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import AS_BUILT
from sim_reference.objects import object_height
from tests.helpers.fem_presses import NAMES, force_n, picture
from tests.helpers.small_bundles import SHAPE, ordinary, with_files

GEOMETRY = AS_BUILT
SPACING = 0.25
AT = grid(256, SPACING)
BALL = object_height("BALL", AT[None, :], AT[:, None])
COARSE = FemGel(resolution_mm=1.25, dense_radius_mm=3.0)


class Unused(FemGel):
    """Fails where a press is computed that was kept."""

    def press(self, *given, **options):  # type: ignore[no-untyped-def]
        raise AssertionError("computed again")


@pytest.fixture
def kept(tmp_path: Path) -> KeptPresses:
    return KeptPresses(COARSE, tmp_path / "presses")


def files(kept: KeptPresses) -> list[Path]:
    return sorted(kept.folder.glob("*"))


def test_a_press_is_computed_once_and_read_back(kept: KeptPresses) -> None:
    first = kept(BALL, SPACING, 0.4, GEOMETRY)
    assert first.depth_mm.max() == pytest.approx(0.4, abs=0.03)
    again = replace(kept, model=Unused(resolution_mm=1.25, dense_radius_mm=3.0))(BALL, SPACING, 0.4, GEOMETRY)
    np.testing.assert_allclose(again.depth_mm, first.depth_mm, rtol=0, atol=1e-6)
    assert (again.contact == first.contact).all()
    assert len(files(kept)) == 1


def test_what_a_press_depends_on_names_it(kept: KeptPresses) -> None:
    key = kept.key(BALL, SPACING, 0.4, GEOMETRY)
    assert key == kept.key(BALL.copy(), SPACING, 0.4, replace(GEOMETRY, camera_height_mm=50.0))
    others = [
        kept.key(BALL + 0.01, SPACING, 0.4, GEOMETRY),
        kept.key(BALL, 0.2, 0.4, GEOMETRY),
        kept.key(BALL, SPACING, 0.5, GEOMETRY),
        kept.key(BALL, SPACING, 0.4, replace(GEOMETRY, poisson_ratio=0.48)),
        replace(kept, model=replace(COARSE, friction=0.3)).key(BALL, SPACING, 0.4, GEOMETRY),
    ]
    assert len({key, *others}) == 6


@pytest.mark.parametrize("kept_bytes", [0, 100, 1000, -10])
def test_a_damaged_file_is_named(kept: KeptPresses, kept_bytes: int) -> None:
    kept(BALL, SPACING, 0.4, GEOMETRY)
    whole = files(kept)[0].read_bytes()
    files(kept)[0].write_bytes(whole[:kept_bytes])
    with pytest.raises(InputError, match="remove it"):
        kept(BALL, SPACING, 0.4, GEOMETRY)
    files(kept)[0].write_bytes(whole[:1000] + bytes(200) + whole[1200:])
    with pytest.raises(InputError, match="remove it"):
        kept(BALL, SPACING, 0.4, GEOMETRY)


def test_what_cannot_be_pressed_is_an_input_error(kept: KeptPresses) -> None:
    with pytest.raises(InputError, match="above 0 to 3 mm"):
        kept(BALL, SPACING, 4.0, GEOMETRY)
    assert not kept(BALL, SPACING, 0.0, GEOMETRY).depth_mm.any()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def test_the_programme_leaves_out_what_cannot_be_computed(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(Scene, "deformation", Mock(side_effect=NotConverged("100 steps were not enough")))
    monkeypatch.setattr(stage, "PROGRAMME", (Press("BALL", 0.5),))
    with open_camera("sim://?board=0&fps=1000") as camera:
        frames = [camera.read() for _ in range(250)]
    assert all(frame.truth is not None and not frame.truth.depth_mm.any() for frame in frames)
    told = [record.getMessage() for record in caplog.records if "leaves out" in record.getMessage()]
    assert 1 <= len(told) <= 5, "each of the five depths is tried once in two rounds of the programme"
    assert len(set(told)) == len(told)
    assert "BALL, 0." in told[0]
    assert "100 steps were not enough" in told[0]


@pytest.mark.nightly
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
        for files in (load_bundle("synthetic").files, known_force(AS_BUILT))
    )
    assert shipped == now


@pytest.mark.parametrize("view", [None, View.of_box((16, 12, 128, 96), SHAPE)])
def test_the_force_is_of_the_gel_whatever_the_size_of_its_pictures(view: View | None) -> None:
    geometry = {"image_width_px": SHAPE[1], "image_height_px": SHAPE[0], "pixel_size_mm": 0.2352, "gel_thickness_mm": 4}
    with open_simulated("sim://?board=0", geometry) as camera:
        seen = PreparedCamera(camera, PictureSteps.with_view(view)) if view else camera
        record = ForceRecord.in_bundle(with_files(ordinary(), "other", force__json=seen.bundle_files[FILE_NAME]))
    assert (record.gel_thickness_mm, record.error_share, record.side_error_share) == (4, 0.05, 0.05)
    assert (record.error_floor_n, record.lightest_n, record.heaviest_n, record.readings) == (0.005, 0.151, 11.757, 13)
    assert seen.bundle_files.keys() == ({FILE_NAME, "picture.json"} if view else {FILE_NAME})


def test_a_mesh_is_refused_that_the_memory_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gel_models, "free_memory", lambda: 10 * 10**9)
    check_memory(0.3, GEOMETRY)
    check_memory(0.1, GEOMETRY)
    with pytest.raises(InputError, match=r"0\.1 mm in each of 2 --workers needs about .* GB .*: 0\.1\d mm fits"):
        check_memory(0.1, GEOMETRY, 2)
    with pytest.raises(InputError, match="use fewer --workers"):
        check_memory(0.3, GEOMETRY, 100)
    monkeypatch.setattr(gel_models, "free_memory", lambda: 10**9)
    with pytest.raises(InputError, match=r"0\.3 mm needs about 1\.\d GB .*: 0\.\d+ mm fits"):
        check_memory(0.3, GEOMETRY)


def test_what_the_kernel_keeps_of_files_is_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:       16000000 kB\nMemFree:          200000 kB\nMemAvailable:   12000000 kB\n")
    monkeypatch.setattr(gel_models, "MEMINFO", meminfo)
    assert free_memory() == 12_000_000 * 1024
    monkeypatch.setattr(gel_models, "MEMINFO", tmp_path / "none")
    assert free_memory() > 10**8
