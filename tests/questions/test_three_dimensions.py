"""What is reported of a stage in three dimensions, and what its bands are worth."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import flexfem
from flexfem.fem.elements import layered
from flexfem.fem.export import write_vtu
from flexfem.paper import solutions
from flexfem.paper import stiffness as solid
from flexfem.paper.answers import solid_levels
from flexfem.paper.warnings import held_faces
from flexfem.questions.bands import solid_bands

from ..tolerances import SOLVED
from ..validation.vibration import third


def test_wedges_of_a_file_have_their_nodes_where_vtk_expects_them_and_their_fields_with_them(
    tmp_path,
):
    """Of two layers, 2.2 and 1 mm high."""
    mesh = third(3, 6, 0.7).mesh
    heights = np.array([0.0, 1.1, 2.2, 2.7, 3.2])
    field = np.array([[[2 * x - y, 3 * z, x + 0.1 * z] for z in heights] for x, y in mesh.nodes])
    write_vtu(mesh, tmp_path / "part.vtu", {"field": field}, heights)
    grid = meshio.read(tmp_path / "part.vtu")
    x, y, z = grid.points.T
    np.testing.assert_allclose(
        grid.point_data["field"], np.column_stack([2 * x - y, 3 * z, x + 0.1 * z]), atol=1e-12
    )
    far = np.hypot(x, y)
    np.testing.assert_array_equal(grid.point_data["hub"], far < far.min() + 1e-9)
    np.testing.assert_array_equal(grid.point_data["ground"], far > far.max() - 1e-9)
    at = grid.points[grid.cells_dict["wedge18"]]
    assert len(at) == 2 * len(mesh.triangles)
    assert np.unique(np.round(at[:, [0, 3], 2], 9), axis=0).tolist() == [[0.0, 2.2], [2.2, 3.2]]
    pairs = [
        (0, 1),
        (1, 2),
        (2, 0),
        (3, 4),
        (4, 5),
        (5, 3),
        (0, 3),
        (1, 4),
        (2, 5),
    ]  # VTK's quadratic wedge
    for middle, (a, b) in enumerate(pairs, start=6):
        between = np.linalg.norm(at[:, middle] - (at[:, a] + at[:, b]) / 2, axis=1)
        assert np.all(between < 0.15 * np.linalg.norm(at[:, a] - at[:, b], axis=1))
    for middle, (a, b) in zip((15, 16, 17), ((6, 9), (7, 10), (8, 11)), strict=True):
        np.testing.assert_allclose(at[:, middle], (at[:, a] + at[:, b]) / 2, atol=1e-12)
    assert np.all(np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])[:, 2] > 0)


@pytest.mark.slow
@pytest.mark.parametrize("graded", [True, False])
def test_the_band_of_the_layers_covers_what_they_leave_out(graded, make_stage, monkeypatch):
    """Also where they are not graded, which the band must see."""
    stage = make_stage()
    many = solutions.solve_solid(stage, 2, 6).compliance
    if not graded:
        monkeypatch.setattr(
            solutions,
            "layers_of",
            lambda of, n: layered(np.linspace(0, of.thickness / 2, n + 1), (0,), 2),
        )
        stage = make_stage()
    left = np.abs(np.diag(many - solutions.solve_solid(stage, 2, 3).compliance))
    band = np.diag(solid_bands(solid_levels(stage, 4, 3), 4)[1])
    relative = band / np.diag(many)
    assert np.all(band > left)
    assert np.all((relative < 2e-3) if graded else (relative > 2e-3))


def test_a_stage_that_holds_its_faces_has_them_free_here(make_stage):
    held = make_stage({"model": "plane_strain"})
    free = make_stage()
    clamped, loose = (solutions.solve_solid(each, 2, 1).compliance for each in (held, free))
    np.testing.assert_allclose(clamped, loose, rtol=SOLVED, atol=1e-12)
    assert held_faces(free) == []
    (said,) = held_faces(held)
    assert "they are free" in said


def test_plane_problems_that_bound_it_are_on_the_same_mesh(make_stage):
    stage = make_stage({"material.poissons_ratio": 0.0})
    found = solutions.solve_solid(stage, 2, 1)
    for each in solid.bounding(stage, found):  # three points of quadrature, not six
        np.testing.assert_allclose(np.diag(each), np.diag(found.compliance), rtol=5e-4)


def test_too_many_unknowns_are_refused_before_anything_is_factorised(make_stage, monkeypatch):
    monkeypatch.setattr("flexfem.fem.structure.MOST_UNKNOWNS", 10_000)
    with pytest.raises(
        flexfem.ComputationFailed, match="unknowns in three dimensions, expected at most 1e"
    ):
        solutions.solve_solid(make_stage(), 2, 1)
