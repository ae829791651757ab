"""The mesh of the gel: conforming, nested, of good shape, as fine as asked for."""

from dataclasses import replace

import numpy as np
import pytest

from sim_reference.fem.mesh import EDGES, Mesh, divisions, gel_mesh
from sim_reference.geometry import SensorGeometry

GEOMETRY = SensorGeometry()
MESH = gel_mesh(GEOMETRY, 0.6, 6.0)


def volumes(mesh: Mesh) -> np.ndarray:
    return np.linalg.det(mesh.vertices[mesh.tets[:, 1:]] - mesh.vertices[mesh.tets[:, :1]]) / 6


def test_every_inner_face_is_shared_by_two_and_every_outer_face_lies_on_the_border() -> None:
    faces = np.sort(np.concatenate([np.delete(MESH.tets, corner, axis=1) for corner in range(4)]), axis=1)
    unique, uses = np.unique(faces, axis=0, return_counts=True)
    assert uses.max() == 2
    corners = MESH.vertices[unique[uses == 1]]
    flat = (corners[..., 2] == 0).all(axis=1) | (corners[..., 2] == MESH.thickness_mm).all(axis=1)
    # Rim: cubes of 2.5 mm whose middle is inside the disc.
    at_rim = np.hypot(corners[..., 0], corners[..., 1]).min(axis=1) > GEOMETRY.gel_diameter_mm / 2 - 3
    assert (flat | at_rim).all()


def test_the_mesh_fills_the_disc_with_good_tetrahedra() -> None:
    volume = volumes(MESH)
    assert volume.sum() == pytest.approx(np.pi * 25**2 * 5, rel=0.01)
    assert MESH.surface_area.sum() == pytest.approx(np.pi * 25**2, rel=0.01)
    edges = np.stack([MESH.vertices[MESH.tets[:, a]] - MESH.vertices[MESH.tets[:, b]] for a, b in EDGES], axis=1)
    # 1 for a regular tetrahedron, 0 for a flat one.
    quality = 6 * np.sqrt(2) * volume / np.sqrt((edges**2).sum(axis=2).mean(axis=1)) ** 3
    assert quality.min() > 0.6


def test_the_surface_is_as_fine_as_asked_for_where_objects_are_pressed() -> None:
    assert MESH.spacing_mm == 0.625
    at = MESH.vertices[MESH.surface]
    dense = at[np.hypot(at[:, 0], at[:, 1]) < 6.0]
    expected = np.unique(np.round(dense[:, :2] / 0.625, 6), axis=0)
    assert np.abs(expected - np.rint(expected)).max() == 0
    assert len(dense) == pytest.approx(np.pi * 6**2 / 0.625**2, rel=0.05)


def test_a_coarser_mesh_is_the_beginning_of_a_finer_one() -> None:
    coarse = gel_mesh(GEOMETRY, 1.25, 6.0)
    assert MESH.levels[:-1] == coarse.levels
    assert (MESH.vertices[: coarse.levels[-1]] == coarse.vertices).all()


def test_the_prolongation_keeps_linear_functions() -> None:
    for prolongation, coarse, fine in zip(MESH.prolongations, MESH.levels, MESH.levels[1:], strict=False):
        assert prolongation @ MESH.vertices[:coarse] == pytest.approx(MESH.vertices[:fine], abs=1e-12)


def test_a_patch_is_one_tetrahedron_of_three_halvings_ago_or_a_cube() -> None:
    sizes = np.bincount(MESH.patch)
    assert sizes.max() == 8
    assert sizes.min() >= 1
    fine = np.flatnonzero(sizes == 8)[:50]
    for patch in fine:
        assert len(np.unique(MESH.tets[MESH.patch == patch])) == 10


@pytest.mark.parametrize(("wanted_mm", "spacing_mm"), [(0.3, 5 / 16), (0.2, 5 / 24), (0.15, 5 / 32), (0.1, 5 / 48)])
def test_the_nearest_resolution_is_taken_that_divides_the_thickness(wanted_mm: float, spacing_mm: float) -> None:
    layers, halvings = divisions(5 / wanted_mm)
    assert 5 / (layers * 2**halvings) == pytest.approx(spacing_mm)


@pytest.mark.parametrize("resolution", [0.0, 0.001, 3.0, float("nan")])
def test_an_impossible_resolution_is_refused_with_what_works(resolution: float) -> None:
    with pytest.raises(ValueError, match=r"give 0\.005 to 2\.5 mm"):
        gel_mesh(GEOMETRY, resolution)


def test_other_gels_can_be_meshed() -> None:
    mesh = gel_mesh(replace(GEOMETRY, gel_thickness_mm=4.0, gel_diameter_mm=30.0), 0.5, 4.0)
    assert volumes(mesh).min() > 0
    assert volumes(mesh).sum() == pytest.approx(np.pi * 15**2 * 4, rel=0.05)
