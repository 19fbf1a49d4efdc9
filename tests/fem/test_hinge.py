"""Finite elements of one hinge between elastic blocks: what theory says of them, and what must not
matter.
"""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from hinge_charts import FREEDOMS, HIGH, LOW, SingleHinge, compliance, hinge_mesh, make, richardson
from hinge_charts import sample as sample_anew

from flexfem.fem.mesh import jacobians, scaled_jacobians
from flexfem.mechanism.outlines import Face, Segment, area
from flexfem.paper.stage_mesh import grading, notch_sizes
from flexfem.questions.bands import grid_convergence

from ..tolerances import SOLVED
from ..validation.fields import meshed

sample = cache(sample_anew)  # of the same hinges by several tests
COARSE = (2, 3, 4)  # levels of the quick tests
MESH = 4e-5  # relative: what their extrapolation leaves, most in shear
NU = 0.29
HINGES = [SingleHinge(0.04), SingleHinge(0.17, 1.6), SingleHinge(0.9, 2.7)]


def quarter(hinge):
    """The outline that `hinge_mesh` maps a grid onto, written out anew."""
    high, length = hinge.block
    notch = 1 + hinge.ratio / 2
    loop = [
        Segment(0j, 1 + length + 0j),
        Segment(1 + length + 0j, 1 + length + 0.5j * high),
        Segment(1 + length + 0.5j * high, 1 + 0.5j * high),
        Segment(1 + 0.5j * high, 1 + 1j * notch),
        Segment(1 + 1j * notch, 0.5j * hinge.ratio, 1j * notch),
        Segment(0.5j * hinge.ratio, 0j),
    ]
    labels = ["bottom", "right", "free", "free", "free", "left"]
    kept = [
        (segment, label)
        for segment, label in zip(loop, labels, strict=True)
        if segment.length > 1e-12
    ]
    return Face([segment for segment, _ in kept], [label for _, label in kept])


@pytest.mark.parametrize("hinge", HINGES)
def test_the_mesh_covers_the_drawn_hinge(hinge):
    mesh = hinge_mesh(hinge, 3)
    CHORDS = 5e-7  # a parabola is not quite an arc
    assert np.sum(jacobians(mesh)[:, -1]) / 2 == pytest.approx(
        area(quarter(hinge).loop), rel=CHORDS
    )
    assert scaled_jacobians(jacobians(mesh)).min() > 0.5
    x, y = mesh.nodes[np.unique(mesh.edges["top"])].T
    on_arc = x < 1 - 1e-12
    np.testing.assert_allclose(
        np.hypot(x[on_arc], y[on_arc] - 1 - hinge.ratio / 2), 1.0, rtol=1e-12
    )


@pytest.mark.parametrize("hinge", HINGES)
def test_what_is_left_of_the_hinge_does_not_depend_on_the_length_of_its_blocks(hinge):
    hinge = hinge._replace(poissons_ratio=NU)
    reference = sample(hinge, COARSE).values
    for length in (1.5, 3.1):
        found = sample(hinge._replace(length=length), COARSE).values
        np.testing.assert_allclose(
            found, reference, rtol=MESH
        )  # exp(-2 * 4.2 * 1.5) = 3e-6 is less


@pytest.mark.parametrize("hinge", HINGES)
def test_poissons_ratio_acts_on_shear_alone_and_there_as_in_a_beam_of_the_blocks_height(hinge):
    at_zero = sample(hinge, COARSE).values
    for nu in (0.2, NU, 0.4):
        law = at_zero + np.array([0.0, 0.0, 2 * 1.2 * nu * 2 / hinge.block[0]])
        np.testing.assert_allclose(
            sample(hinge._replace(poissons_ratio=nu), COARSE).values, law, rtol=MESH
        )


def test_rotation_of_a_slender_neck_follows_the_slender_body_expansion():
    """Above (2) by 2/5 t/R (derived in validate/holes.py): 0.800 % at t/R = 0.02, 0.8 % in the
    project's notes.
    """
    beta = 0.01
    q = 2 * beta + beta**2
    bend = 6 * (1 + beta) / q**1.5 * np.arctan(np.sqrt((2 + beta) / beta))
    beam = 1.5 / q * (1 / (1 + beta) + (3 + 2 * beta + beta**2) / ((1 + beta) * q) + bend)
    SECOND_ORDER = 4e-6  # (t/R)^2 is 4e-4, and its coefficient is small
    assert sample(SingleHinge(0.02), COARSE).values[0] / beam - 1 == pytest.approx(
        0.008, abs=SECOND_ORDER
    )


def test_a_wall_too_short_to_mesh_is_no_wall():
    full = compliance(SingleHinge(0.21), 2)
    for above in (1e-16, 1e-9, 1e-5):
        assert compliance(SingleHinge(0.21, 1 + above), 2) == pytest.approx(
            full, rel=2 * above + SOLVED
        )


@pytest.mark.parametrize("hinge", HINGES)
def test_compliances_converge_with_order_four_to_a_limit_inside_the_band(hinge):
    levels = np.array([2, 4, 8])
    found = np.array([compliance(hinge, refinement) for refinement in levels])
    observed = np.log2((found[1] - found[0]) / (found[2] - found[1]))
    assert np.all(
        (observed > 3.2) & (observed < 4.3)
    )  # the jumps of the outline's curvature cost something
    quick = sample(hinge, COARSE)
    np.testing.assert_array_less(
        np.abs(quick.values / richardson(levels, found)[-1] - 1), 2 * quick.bands
    )
    for k in range(3):
        study = grid_convergence(levels, found[:, k])
        assert study.verdict == "converging"
        assert richardson(levels, found)[-1, k] == pytest.approx(study.extrapolated, abs=study.band)


@pytest.mark.parametrize("hinge", HINGES)
def test_an_unstructured_mesh_of_gmsh_gives_the_same_compliances(hinge):
    high = hinge.block[0]
    across = 8  # of half a neck
    notch = notch_sizes(hinge.ratio, 1.0, 2 * across, 2 * across)
    mesh = meshed(quarter(hinge), [grading(0j, *size, high / 16, 2 * across) for size in notch])
    UNSTRUCTURED = 2e-4  # not extrapolated
    hinge = hinge._replace(poissons_ratio=NU)
    np.testing.assert_allclose(
        compliance(hinge, 0, mesh), sample(hinge, COARSE).values, rtol=UNSTRUCTURED
    )


@pytest.mark.slow
def test_the_chart_is_made_the_same_whoever_makes_it_and_says_what_made_it(tmp_path):
    coarse = LOW._replace(shape=(2, 2), levels=(1, 2, 3))
    for workers in (1, 2):
        make(coarse, tmp_path / str(workers), workers)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    found = json.loads((tmp_path / "1").read_text())
    assert {"flexfem", "scikit-fem", "numpy"} <= set(found["versions"])
    assert np.shape(found["shear"]) == np.shape(found["bands"]["shear"]) == (2, 2)


@pytest.mark.parametrize(
    ("grid", "row", "column"), [(LOW, 6, 2), (HIGH, 4, 1)], ids=["low", "high"]
)
def test_the_packaged_chart_can_be_made_anew(grid, row, column):
    """One sample of it at the full resolution, and the points it stands on."""
    found = json.loads(grid.path.read_text())
    assert found["range"] == {"t/R": [0.02, 1.2], "H/h": list(grid.ends["H/h"])}
    for name, points in zip(("t/R", "H/h"), grid.points(), strict=True):
        np.testing.assert_allclose(found[name], points, rtol=1e-7)
    made = sample(SingleHinge(found["t/R"][row], found["H/h"][column]))
    STORED = 5 * SOLVED  # eight digits, which another factorisation rounds to the next
    np.testing.assert_allclose(
        [found[name][row][column] for name in FREEDOMS], made.values, rtol=STORED
    )
    for k, name in enumerate(FREEDOMS):
        bands = np.array(found["bands"][name])
        assert (
            made.bands[k] == pytest.approx(bands[row, column], rel=0.1)
            and bands.max() == found["largest_band"][name]
        )


@pytest.mark.parametrize("ratio", [0.13, 0.7])
def test_high_blocks_add_the_logarithm_of_two_half_planes_to_a_force_and_nothing_to_a_moment(ratio):
    """Flamant: 2 F ln(r) / (pi E b) at each of two surfaces; what is left is linear in h/H, and
    quadratic under M.
    """
    found = np.array([compliance(SingleHinge(ratio, height), 2) for height in (10.0, 20.0, 40.0)])
    first, second = np.diff(found, axis=0)
    grown = (2 * second - first)[1:] / np.log(2) / (4 / np.pi)
    assert np.all(np.abs(grown - 1) < [1e-3, 0.015])  # shear has more of (h/H)^2
    assert 0 < second[0] < 0.3 * first[0] < 1e-3 * found[0, 0]


def test_a_slender_neck_between_high_blocks_is_not_lost_in_their_rigid_turning():
    """By f'u alone, rotation is off by 5e-4 here, and by 4e-5 at H/h = 20."""
    low, high = (compliance(SingleHinge(0.02, height), 3)[0] for height in (10.0, 60.0))
    assert abs(high / low - 1) < 2e-6  # what is left of its growth, and the square of what is lost
