"""The gel by finite elements behind the simulated sensor: kept by content, read back, and refused where impossible."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.simulator import stage
from gellight.lab.simulator.gel_models import KeptPresses
from gellight.lab.simulator.scene import Press
from gellight.opening import open_camera
from sim_reference.deformation import NotConverged, grid
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry
from sim_reference.objects import object_height

GEOMETRY = SensorGeometry()
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
    assert kept.folder is not None
    return sorted(kept.folder.glob("*"))


def test_a_press_is_computed_once_and_read_back(kept: KeptPresses) -> None:
    first = kept(BALL, SPACING, 0.4, GEOMETRY)
    assert first.depth_mm.max() == pytest.approx(0.4, abs=0.03)
    again = replace(kept, model=Unused(resolution_mm=1.25, dense_radius_mm=3.0))(BALL, SPACING, 0.4, GEOMETRY)
    assert again.depth_mm == pytest.approx(first.depth_mm, abs=1e-6)
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


def test_a_url_chooses_the_model(cache: Path) -> None:
    url = "sim://?board=0&object=BALL&depth=0.6&noise=0"
    with open_camera(url) as camera:
        layer = camera.read()
    with open_camera(url + "&gel=fem&resolution=1.2") as camera:
        fem = camera.read()
    assert len(list(cache.glob("gellight/presses/*.npz"))) == 1
    assert layer.truth is not None
    assert fem.truth is not None
    difference = np.abs(layer.truth.depth_mm - fem.truth.depth_mm)
    assert 1e-4 < difference.max() < 0.1
    assert (layer.image != fem.image).any()


def test_the_programme_leaves_out_what_cannot_be_computed(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def failing(*given, **options):  # type: ignore[no-untyped-def]
        raise NotConverged("100 steps were not enough")

    monkeypatch.setattr(FemGel, "press", failing)
    monkeypatch.setattr(stage, "PROGRAMME", (Press("BALL", 0.5),))
    with open_camera("sim://?board=0&gel=fem&fps=1000") as camera:
        frames = [camera.read() for _ in range(250)]
    assert all(frame.truth is not None and not frame.truth.depth_mm.any() for frame in frames)
    told = [record.getMessage() for record in caplog.records if "leaves out" in record.getMessage()]
    assert 1 <= len(told) <= 5, "each of the five depths is tried once in two rounds of the programme"
    assert len(set(told)) == len(told)
    assert "BALL, 0." in told[0]
    assert "100 steps were not enough" in told[0]


def test_an_unknown_model_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="one of layer, fem"):
        open_camera("sim://?board=0&gel=jelly")
