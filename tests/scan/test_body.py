"""Touches as one mesh: exact where they are exact, open where nothing touched, and no mirror image."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gellight.base.errors import InputError
from gellight_scan.body import Mesh, fused, step_for
from gellight_scan.contact_view import ContactView
from gellight_scan.pictures import mesh_picture
from gellight_scan.tracking.rigid import inverse, pose_of
from tests.helpers.ply import open_edges, read_ply, read_stl

PIXEL_MM = 0.06
SHAPE = (120, 160)
X, Y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * PIXEL_MM for n in SHAPE[::-1]))
RADIUS_MM, DEEP_MM = 5.0, 0.5


def ball(x_mm: float = 0.0, y_mm: float = 0.0) -> ContactView:
    """A ball whose top is in the gel: what is beside it the gel does not reach."""
    square = RADIUS_MM**2 - (X - x_mm) ** 2 - (Y - y_mm) ** 2
    depth = np.sqrt(np.maximum(square, 0)) - (RADIUS_MM - DEEP_MM)
    return ContactView(np.maximum(depth, 0).astype(np.float32), (PIXEL_MM,) * 2, "a")


def rolled(angles_rad: list[float], *, moved_mm: float = 0.0) -> list[tuple[ContactView, np.ndarray]]:
    """Touches of a ball that rolls about y, and where they lie: about the middle of the ball."""
    touches = []
    for angle in angles_rad:
        x = RADIUS_MM * angle
        body_to_gel = pose_of(np.array([x, 0, moved_mm - (RADIUS_MM - DEEP_MM), 0, angle, 0]))
        touches.append((ball(x), inverse(body_to_gel)))
    return touches


def sides_of(mesh: Mesh) -> list[np.ndarray]:
    """Both ends (T, 2, 3) of each side of the triangles."""
    return [mesh.points_mm[mesh.triangles[:, [corner, (corner + 1) % 3]]] for corner in range(3)]


@pytest.mark.parametrize("size_mm", [(10, 10, 1), (100, 100, 100), (900, 900, 0.1), (9000, 0.1, 0.1)])
def test_no_box_takes_more_points_than_the_memory_has(size_mm: tuple[float, float, float]) -> None:
    """A flat or a long one has more in its margins than in itself."""
    step = step_for(np.array(size_mm))
    grid = [len(np.arange(-4 * step, size + 4 * step, step)) for size in size_mm]
    assert np.prod(grid, dtype=float) <= 28e6
    assert step == pytest.approx(0.1) or np.prod(grid, dtype=float) > 24e6


def test_touches_metres_apart_are_refused_before_their_memory_is_asked_for() -> None:
    with pytest.raises(InputError, match=r"over 2000 x 2000 x 300 mm, too much for a mesh: scan the body in parts"):
        step_for(np.array((2000.0, 2000.0, 300.0)))


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return fused(rolled([-0.4, -0.2, 0.0, 0.2, 0.4]))


def test_every_point_lies_on_the_ball(mesh: Mesh) -> None:
    off = np.linalg.norm(mesh.points_mm, axis=1) - RADIUS_MM
    assert np.abs(off).max() < 0.005
    assert np.sqrt((off**2).mean()) < 1e-3
    assert mesh.seam_mm < 2e-3
    assert (mesh.error_mm > 0.002).all(), "as a single touch states: what is shared does not average out"


def test_it_covers_what_was_touched_and_is_open_beside_it(mesh: Mesh) -> None:
    """The cap that is pressed in has a half angle of arccos(1 - d / r); the gel is not taken to reach its rim."""
    half = np.arccos(1 - DEEP_MM / RADIUS_MM)
    along = np.arctan2(mesh.points_mm[:, 0], mesh.points_mm[:, 2])
    assert 0.55 * half + 0.4 < np.abs(along).max() < half + 0.4
    assert np.abs(mesh.points_mm[:, 1]).max() < RADIUS_MM * np.sin(half)
    assert open_edges(mesh.triangles) > 0
    a, b, c = (np.linalg.norm(np.diff(corner, axis=1), axis=2)[:, 0] for corner in sides_of(mesh))
    s = (a + b + c) / 2
    assert mesh.area_mm2 == pytest.approx(np.sqrt(s * (s - a) * (s - b) * (s - c)).sum(), rel=1e-6), "by Heron"
    assert mesh.area_mm2 > 0.5 * 2 * RADIUS_MM * np.sin(half) * RADIUS_MM * 0.8


def test_what_nothing_touched_between_two_touches_stays_open() -> None:
    apart = fused(rolled([-0.6, 0.6]))
    joined = coo_array((np.ones(len(apart.triangles)), apart.triangles[:, :2].T), shape=(len(apart.points_mm),) * 2)
    joined += coo_array((np.ones(len(apart.triangles)), apart.triangles[:, 1:].T), shape=joined.shape)
    assert connected_components(joined, directed=False, return_labels=False) == 2


def test_its_files_face_outwards_and_have_y_up(mesh: Mesh, tmp_path: Path) -> None:
    (tmp_path / "mesh.ply").write_bytes(mesh.ply())
    vertices, triangles, _ = read_ply(tmp_path / "mesh.ply")
    points = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(points, mesh.points_mm * [1, -1, 1], atol=1e-6)
    for corners in (points[triangles], read_stl(mesh.stl())):
        assert (np.linalg.det(corners.astype(float)) > 0).all()
    np.testing.assert_allclose(vertices["error_mm"], mesh.error_mm, rtol=1e-6)


def test_touches_that_lie_apart_show_as_a_seam_and_in_the_errors() -> None:
    """Two touches of one place, 40 um apart: each is 20 um off their mean."""
    apart = fused(rolled([0.0]) + rolled([0.0], moved_mm=0.04))
    assert apart.seam_mm == pytest.approx(0.02, rel=0.15)
    assert np.median(apart.error_mm) == pytest.approx(0.02, rel=0.3)


def test_a_body_too_large_for_the_grid_gets_a_coarser_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gellight_scan.body.MOST_POINTS", 20_000)
    coarse = fused(rolled([-0.4, -0.2, 0.0, 0.2, 0.4]))
    assert coarse.step_mm > 0.1
    assert np.abs(np.linalg.norm(coarse.points_mm, axis=1) - RADIUS_MM).max() < 0.02


def test_it_is_seen_from_above_and_not_from_below(mesh: Mesh) -> None:
    above, below = np.hsplit(mesh_picture(mesh.points_mm, mesh.triangles, 200), 2)
    assert (above < 255).mean() > 0.05
    assert (below == 255).all(), "from below one looks into the shell"
    rows, columns = np.nonzero(above[..., 0] < 255)
    left = above[rows, columns, 0][columns < 70].mean()
    assert left > above[rows, columns, 0][columns > 130].mean() + 20, "the light comes from the left"


def test_one_touch_has_no_seam_and_none_that_reached_nothing_is_fused() -> None:
    alone = fused(rolled([0.0]))
    assert np.isnan(alone.seam_mm)
    assert np.isfinite(alone.error_mm).all()
    empty = ContactView(np.zeros(SHAPE, np.float32), (PIXEL_MM,) * 2, "a")
    with pytest.raises(InputError, match="too little of the body for a surface: press it deeper"):
        fused([(empty, np.eye(4))])
