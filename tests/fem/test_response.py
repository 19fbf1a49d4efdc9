"""How the stage answers loads: symmetries and scalings that hold to round-off, balances, and
refusals.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import flexfem.fem.response
from flexfem.arrays import turned
from flexfem.fem.elements import Plate
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import ordered
from flexfem.fem.response import factorised_whole, platform_response
from flexfem.fem.structure import NONE, structure
from flexfem.paper.designs import stage_frames
from flexfem.paper.fields import neck_maxima, neck_stresses, neck_wrenches
from flexfem.paper.frames import chain_rotation
from flexfem.paper.stage import load_stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.refused import ComputationFailed

from ..tolerances import SOLVED, SUMS
from .conftest import GEOMETRY, bar, solved

LOAD = np.array([1.3, -0.7, 41.0])  # N, N, N mm


def difference(C, other):
    """Largest change over the diagonal."""
    size = np.sqrt(np.diag(other))
    return float(np.max(np.abs(C - other) / np.outer(size, size)))


def test_threefold_symmetry_makes_the_reference_stages_isotropic(reference):
    C = reference.response.compliance
    assert difference(C, np.diag(np.diag(C))) < SOLVED
    assert abs(C[0, 0] / C[1, 1] - 1) < SOLVED
    assert difference(C, C.T) < SOLVED


def test_mirrored_stage_has_the_mirrored_compliance(unlike):
    """A sign slip in the rigid hub's moment arm would not survive a mirror: theta and y change sign
    together.
    """
    mesh = unlike.mesh
    flipped = mesh._replace(
        nodes=mesh.nodes * [1.0, -1.0], triangles=mesh.triangles[:, [0, 2, 1, 5, 4, 3]]
    )
    M = np.diag([1.0, -1.0, -1.0])
    mirrored = platform_response(ordered(flipped)[0], plate_of(unlike.stage)).compliance
    assert difference(mirrored, M @ unlike.response.compliance @ M.T) < SOLVED


def test_ground_rests_and_hub_moves_as_a_rigid_body(each):
    ground, hub = (np.unique(each.mesh.edges[name]) for name in ("ground", "hub"))
    x, y = each.mesh.nodes[hub].T
    for pose, field in zip(each.response.compliance.T, each.response.fields, strict=True):
        assert np.all(field[ground] == 0.0)
        expected = np.stack([pose[0] - pose[2] * y, pose[1] + pose[2] * x], axis=-1)
        np.testing.assert_allclose(field[hub], expected, rtol=0, atol=SUMS * np.abs(field).max())


def test_equations_are_the_stiffness_seen_from_the_unknowns():
    """`T' K T` formed densely, beside the assembly that never forms T."""
    mesh = bar(3.1, 1.3, 4, 3)
    mesh = mesh._replace(
        nodes=mesh.nodes + np.array([4.3, -1.7])
    )  # so that every moment arm counts
    plate = Plate(68.3e3, 0.29, 9.7)
    of = structure(mesh, plate)
    T = of.fields(np.eye(of.size)).reshape(of.size, -1).T
    K = structure(mesh, plate, held=NONE).lower().toarray()
    expected = T.T @ (K + np.tril(K, -1).T) @ T
    lower = of.lower().toarray()
    scale = np.abs(expected).max()
    np.testing.assert_allclose(lower, np.tril(expected), rtol=0, atol=SUMS * scale)
    forces = np.random.default_rng(29).normal(size=(2, len(mesh.nodes), 2))
    np.testing.assert_allclose(
        of.loads(forces), T.T @ forces.reshape(2, -1).T, rtol=0, atol=SUMS * 1e3
    )
    C = platform_response(mesh, plate).compliance
    np.testing.assert_allclose(
        C, np.linalg.inv(expected)[-3:, -3:], rtol=SOLVED
    )  # the dense inverse is not refined


@pytest.mark.parametrize(("off", "refused"), [(0.7e-9, False), (1.5e-9, True), (np.nan, True)])
def test_energy_that_is_not_the_work_to_a_billionth_is_refused(off, refused, monkeypatch):
    """A solver that is off by so much, and no refinement."""
    of = structure(bar(3.1, 1.3, 4, 3), Plate(68.3e3, 0.29, 9.7))
    model = factorised_whole(of)
    exact = factorise(of.lower())
    space = model.spaces[0]._replace(solve=lambda b: (1 + off) * exact(b))
    monkeypatch.setattr(flexfem.fem.response, "MOST_SOLVES", 1)
    with pytest.raises(ComputationFailed, match="refused") if refused else nullcontext():
        replace(model, spaces=(space,)).response()


def test_reactions_that_do_not_balance_are_refused(monkeypatch):
    """One clamped node's forces are left out of the sum."""
    monkeypatch.setattr(
        flexfem.fem.response, "clamped_nodes", lambda mesh: [np.unique(mesh.edges["ground"])[1:]]
    )
    with pytest.raises(ComputationFailed, match="reactions and load differ"):
        platform_response(bar(3.1, 1.3, 4, 3), Plate(68.3e3, 0.29, 9.7))


def test_a_loose_body_is_refused(alike):
    """With no pad clamped the stage floats: the solution must not come back as a number."""
    floating = alike.mesh._replace(
        edges={**alike.mesh.edges, "ground": alike.mesh.edges["ground"][:0]}
    )
    with pytest.raises(ComputationFailed):
        platform_response(floating, plate_of(alike.stage))


def test_a_stage_under_a_load_moves_by_the_compliance_and_stores_half_the_work(unlike):
    found = unlike.response.under(LOAD[None])
    np.testing.assert_allclose(found.motions[:, 0], unlike.response.compliance @ LOAD, rtol=SOLVED)
    assert found.energy[0, 0] == pytest.approx(float(LOAD @ found.motions[:, 0]), rel=SOLVED)
    np.testing.assert_allclose(found.reactions[0], -LOAD, rtol=0, atol=SOLVED * 41)  # of 41 N mm


def test_a_force_turned_by_120_degrees_stresses_the_next_chain(alike):
    force = np.array([1.3, -0.7, 0.0])
    here, there = neck_stresses(
        alike.stage, alike.response, np.array([force, chain_rotation(1) @ force])
    ).highest
    np.testing.assert_allclose(np.roll(here, 1, axis=0), there, rtol=SOLVED)
    assert not np.allclose(here, there, rtol=0.05)


def test_a_neck_takes_the_largest_value_within_its_notch_radius_and_none_beyond(unlike):
    """A peak at one node at a time, the last inside the notch's radius and the first outside it."""
    stage = unlike.stage
    nodes = unlike.mesh.nodes
    for (chain, k), radius in (((0, 0), 2.3), ((1, 1), 1.6), ((2, 2), 1.9)):
        away = np.linalg.norm(nodes - stage_frames(stage).centres[chain, k], axis=1)
        last = np.flatnonzero(away <= radius)
        first = np.flatnonzero(away > radius)
        for node, found in (
            (last[np.argmax(away[last])], 7.0),
            (first[np.argmin(away[first])], -2.0),
        ):
            values = np.full(len(nodes), -2.0)
            values[node] = 7.0
            assert neck_maxima(stage, unlike.mesh, values)[chain, k] == found


def section_loads(stage, mesh, field, chain):
    """Axial and shear force, N, and bending moment, N mm, in the base neck."""
    placed = stage_frames(stage)
    x, y = placed.centres[chain, 0]
    angle = placed.axes[chain, 0]
    fx, fy, moment = neck_wrenches(mesh, plate_of(stage), field[None])[chain, 0, :, 0]
    return *turned(np.array([fx, fy]), -angle), moment - x * fy + y * fx


@pytest.mark.parametrize(
    "load", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 30.0)], ids=["x", "y", "theta"]
)
def test_neck_stress_is_near_that_of_bending_and_tension(alike, load):
    """A notch of t/R = 0.14 concentrates `6 M/(b h^2) + N/(b h)` by a few percent; the coarse mesh
    adds some.
    """
    stage = alike.stage
    field = alike.response.under(np.array([load])).nodal[0]
    necks = neck_stresses(stage, alike.response, np.array([load])).highest[0]
    hinge = stage.hinge(1, "base")
    b = stage.thickness
    x = np.linspace(-0.9, 0.9, 181) * hinge.radius
    h = hinge.neck + 2 * hinge.radius - 2 * np.sqrt(hinge.radius**2 - x**2)  # below (3)
    for chain in range(3):
        axial, shear, moment = section_loads(stage, alike.mesh, field, chain)
        nominal = np.max(6 * abs(moment - shear * x) / (b * h**2) + abs(axial) / (b * h))
        assert 0.97 < necks[chain, 0] / nominal < 1.12


def test_platform_compliance_converges_with_order_three_or_more():
    """Curved quadratic triangles; two across a neck are too few to be in the asymptotic range, so
    from three on.
    """
    stage = load_stage(GEOMETRY / "mobility6.toml")
    coarse, middle, fine = (np.diag(solved(stage, n).response.compliance) for n in (3, 6, 12))
    assert np.all(middle > coarse) and np.all(fine > middle)  # displacement elements are too stiff
    order = np.log2((middle - coarse) / (fine - middle))
    assert np.all(order >= 3.0)
    assert np.all((fine - middle) / fine < 3e-4)
