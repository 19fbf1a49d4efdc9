"""The quick mesh of a study: the same stage, the same mesh every time, and fine enough for a tenth
of a per cent.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexfem.paper.stage_mesh
from flexfem.fem.mesh import jacobians, scaled_jacobians
from flexfem.fem.response import unit_response
from flexfem.mechanism.outlines import Face
from flexfem.meshing.faces import mesh_faces
from flexfem.meshing.process import end_processes, run_mesher
from flexfem.paper.stage import load_stage
from flexfem.paper.stage_mesh import mesh_sectors, plate_of, sector_drawing
from flexfem.questions.bands import grid_convergence
from flexfem.refused import ComputationFailed

from ..conftest import with_changes
from .conftest import GEOMETRY, solved

ON_ARC = 1e-9  # mm; gmsh places the ends, we the middles
ACCURACY = 1e-3  # of the platform stiffness, what studies promise at their default resolution
RESOLUTION = 4  # default of studies
TWO_ACROSS = (
    0.01  # of the platform compliance with two triangles across the necks; half of it is seen
)


def same(one, other):
    """Bit by bit."""
    return one.keys() == other.keys() and all(
        np.array_equal(one[key], other[key], equal_nan=one[key].dtype.kind in "fc") for key in one
    )


@pytest.fixture(scope="module")
def stages(alike, unlike):
    """Designs of different sizes, so that one could leave something behind for the next."""
    small = with_changes({"hinges.elbow.neck_mm": 0.11, "platform.hub_radius_mm": 4.1})
    return [alike.stage, unlike.stage, small]


def test_the_nth_mesh_of_a_process_is_that_of_a_fresh_process(stages):
    jobs = [
        sector_drawing(stage, chain, RESOLUTION, RESOLUTION)
        for chain, stage in enumerate(stages, start=1)
    ]
    fresh = []
    for job in jobs:
        end_processes()
        fresh.append(run_mesher(job, 60.0))
    for order in (range(len(jobs)), reversed(range(len(jobs))), [1, 1, 0, 2, 0]):
        for index in order:
            assert same(mesh_faces(jobs[index]), fresh[index]), index


def test_a_stubby_neck_has_more_edges_and_a_slender_one_is_no_coarser():
    """t/R of 1.25 at the elbow and 0.003 at the platform hinge."""
    stage = with_changes({"hinges.elbow.neck_mm": 2.0, "hinges.platform.neck_mm": 0.004})
    (sector,) = mesh_sectors(stage, RESOLUTION)
    assert len(sector.mesh.edges["neck elbow"]) == 10
    assert len(sector.mesh.edges["neck platform"]) == RESOLUTION


@pytest.mark.slow
@pytest.mark.parametrize("neck", [0.003, 0.05, 2.0])
def test_slender_and_stubby_hinges_are_as_accurate(neck):
    stage = with_changes({"hinges.elbow.neck_mm": neck})
    fine = np.diag(solved(stage, 8).response.compliance)
    found = np.diag(unit_response(mesh_sectors(stage, RESOLUTION), plate_of(stage)).compliance)
    np.testing.assert_allclose(found, fine, rtol=ACCURACY)


def test_thirds_that_do_not_fit_are_refused(unlike, monkeypatch):
    def finer(stage, chain, *resolutions):
        job = sector_drawing(stage, chain, *resolutions)
        return job if chain != 2 else job._replace(divisions={**job.divisions, "cut ahead": 9})

    monkeypatch.setattr(flexfem.paper.stage_mesh, "sector_drawing", finer)
    with pytest.raises(ComputationFailed, match="cut"):
        mesh_sectors(unlike.stage, 2)


def test_what_gmsh_says_becomes_one_line(alike):
    job = sector_drawing(alike.stage, 1, 2, 2)
    with pytest.raises(ComputationFailed, match=r"^gmsh: [^\n]+$"):
        run_mesher(
            job._replace(faces=[Face(job.faces[0].loop[:-1], job.faces[0].labels[:-1])]), 60.0
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["alike", "unlike"])
def test_stiffness_is_within_a_tenth_of_a_per_cent_of_extrapolation(name, request):
    """Against the ordinary mesh, smoothed and of other sizes, extrapolated from resolutions 6, 8
    and 11.
    """
    stage = request.getfixturevalue(name).stage
    levels = np.array([6, 8, 11])
    fine = np.array(
        [np.diag(np.linalg.inv(solved(stage, int(n)).response.compliance)) for n in levels]
    )
    limit = np.array([grid_convergence(levels, fine[:, k], 0.0).extrapolated for k in range(3)])
    ring = unit_response(mesh_sectors(stage, RESOLUTION), plate_of(stage))
    found = np.diag(np.linalg.inv(ring.compliance))
    assert np.abs(found / limit - 1).max() < ACCURACY
    assert np.abs(fine[-1] / limit - 1).max() < ACCURACY / 20  # so that the limit is one


def test_a_poor_mesh_of_a_sector_is_made_again_with_smaller_triangles():
    """A triangle of the first mesh with two across the necks was folded beside the notch of the
    platform hinge.
    """
    changed = load_stage(GEOMETRY / "mobility3.toml").replace(
        chain={
            "link_lengths": [28.625599849475645, 33.39888615928118, 26.29895199941183],
            "link_width": 9.089341643522243,
        },
        platform={"radius": 18.642464220371245},
        hinges={
            "base": {"radius": 1.315536976679163, "neck": 0.5685023687116963},
            "elbow": {"radius": 1.5739044151619492, "neck": 0.5279825804156227},
            "platform": {"radius": 1.569083499626799, "neck": 0.47438918805945196},
        },
    )
    (coarse,) = mesh_sectors(changed, 2)
    (fine,) = mesh_sectors(changed, 8)
    assert scaled_jacobians(jacobians(coarse.mesh)).min() > 0.1
    C, finer = (unit_response((one,), plate_of(changed)).compliance for one in (coarse, fine))
    np.testing.assert_allclose(np.diag(C), np.diag(finer), rtol=TWO_ACROSS)
