"""Condensed sectors answer as the whole stage does, whose equations are the slow reference."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.arrays import turned
from flexfem.fem.mesh import PlaneMesh, joined
from flexfem.fem.response import Response, platform_response, unit_response
from flexfem.fem.structure import Structure
from flexfem.fem.symmetry import sector_values
from flexfem.paper.actuators import HINGE_NAMES
from flexfem.paper.fields import base_rotations, envelope, neck_stresses
from flexfem.paper.frames import CHAIN_TURN, chain_rotation
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import mesh_sectors, plate_of
from flexfem.refused import ComputationFailed

from ..tolerances import SOLVED, SUMS

LOADS = np.array([[1.3, -0.7, 0.0], [0.2, 1.1, 31.0], [0.0, 0.0, 40.0]])  # N, N, N mm
COARSE = 2  # triangles across a neck; the algebra does not care


class Both(NamedTuple):
    """A stage solved in both ways on the same triangles."""

    stage: Stage
    response: Response
    mesh: PlaneMesh
    whole: Response


def in_both_ways(stage):
    sectors = mesh_sectors(stage, COARSE)
    mesh, _ = joined(sectors)
    plate = plate_of(stage)
    return Both(stage, unit_response(sectors, plate), mesh, platform_response(mesh, plate))


@pytest.fixture(scope="module")
def pair(alike, unlike):
    return {"alike": in_both_ways(alike.stage), "unlike": in_both_ways(unlike.stage)}


@pytest.fixture(params=["alike", "unlike"])
def both(request, pair):
    return pair[request.param]


def scaled(compliance):
    """Relative to the root of the product of its diagonal terms."""
    size = np.sqrt(np.diag(compliance))
    return np.asarray(compliance / np.outer(size, size))


def test_compliance_is_that_of_the_whole_stage(both):
    assert np.abs(scaled(both.response.compliance) - scaled(both.whole.compliance)).max() < SOLVED
    np.testing.assert_allclose(
        np.diag(both.response.compliance), np.diag(both.whole.compliance), rtol=SOLVED
    )
    assert both.response.unknowns == both.whole.unknowns


def test_whole_mesh_and_fields_on_demand_are_those_of_the_whole_stage(both):
    np.testing.assert_array_equal(both.response.mesh.nodes, both.mesh.nodes)
    size = np.abs(both.whole.fields).max(axis=(1, 2), keepdims=True)
    assert np.abs((both.response.fields - both.whole.fields) / size).max() < SOLVED
    assert both.response.triangles == len(both.mesh.triangles)
    np.testing.assert_allclose(
        both.response.reactions, both.whole.reactions, rtol=0, atol=10 * SOLVED
    )  # N, of unit loads
    np.testing.assert_allclose(
        scaled(both.response.energy), scaled(both.whole.energy), rtol=0, atol=SOLVED
    )


def test_neck_stresses_are_those_of_the_whole_stage(both):
    found = neck_stresses(both.stage, both.response, LOADS).highest
    expected = neck_stresses(both.stage, both.whole, LOADS).highest
    np.testing.assert_allclose(
        found, expected, rtol=SOLVED
    )  # differences of displacements, over a small triangle


def test_envelope_holds_every_node_of_the_whole_stage(both):
    assert envelope(both.response) == pytest.approx(
        2 * np.hypot(*both.mesh.nodes.T).max(), rel=1e-12
    )


def test_a_platform_turned_by_one_chain_shows_the_next_chain_the_same_load(pair):
    stage = pair["alike"].stage
    response = pair["alike"].response
    turns = base_rotations(stage, response)
    load = np.array([1.3, -0.7, 5.0])
    here = load @ turns
    there = (chain_rotation(1) @ load) @ turns
    np.testing.assert_allclose(np.roll(here, 1), there, rtol=1e-6)
    assert not np.allclose(here, there, rtol=0.05)


def test_base_rotation_of_a_rigidly_turned_link_is_its_angle_against_the_pad(pair):
    """Displacements of rigid rotations of link 1 and of the pad, others in every chain."""
    both = pair["unlike"]
    links = (1.7e-3, 1.1e-3, -0.6e-3)
    pads = (-0.4e-3, 0.2e-3, 0.3e-3)
    mesh = both.mesh
    fields = np.zeros((3, len(both.mesh.nodes), 2))
    for chain, (link, pad) in enumerate(zip(links, pads, strict=True)):
        for angle, body in ((pad, mesh.bodies == 4 * chain), (link, mesh.bodies == 4 * chain + 1)):
            moved = np.unique(mesh.triangles[body])
            fields[1, moved] = angle * np.stack(
                [-mesh.nodes[moved, 1], mesh.nodes[moved, 0]], axis=-1
            )
    turns = base_rotations(both.stage, replace(both.response, nodal=fields))
    np.testing.assert_allclose(turns[1], [2.1e-3, 0.9e-3, -0.9e-3], rtol=1e-12)
    assert np.all(turns[[0, 2]] == 0.0)


def test_without_cholmod_the_answer_is_the_same(pair, monkeypatch):
    monkeypatch.setitem(sys.modules, "cvxopt", None)  # as if it were not installed
    both = pair["unlike"]
    again = unit_response(both.response.sectors, plate_of(both.stage))
    assert np.abs(scaled(again.compliance) - scaled(both.response.compliance)).max() < SOLVED


def test_an_answer_that_does_not_balance_is_refused(pair, monkeypatch):
    """Element matrices that are not those of the residuals: refinement does not mend it, and the
    check sees it.
    """
    both = pair["alike"]
    lower = Structure.lower
    monkeypatch.setattr(Structure, "lower", lambda of: 9.0 * lower(of))
    with pytest.raises(ComputationFailed, match="refused"):
        unit_response(both.response.sectors, plate_of(both.stage))


def test_a_stage_that_is_not_held_is_refused(pair):
    """Round-off decides whether the factorisation or the balance of forces shows it."""
    (sector,) = pair["alike"].response.sectors
    floating = sector._replace(
        mesh=sector.mesh._replace(edges={**sector.mesh.edges, "ground": np.empty((0, 3), int)})
    )
    with pytest.raises(
        ComputationFailed, match=r"precision: a part is not supported|reactions and load"
    ):
        unit_response((floating,), plate_of(pair["alike"].stage))


@pytest.mark.parametrize("name", ["alike", "unlike"])
def test_plane_strain_changes_neck_stress_as_in_the_whole_stage(name, pair):
    stage = pair[name].stage.model_copy(update={"model": "plane_strain"})
    both = in_both_ways(stage)
    expected = neck_stresses(stage, both.whole, LOADS).highest
    np.testing.assert_allclose(
        neck_stresses(stage, both.response, LOADS).highest, expected, rtol=SOLVED
    )


def test_round_off_opens_no_cut_between_alike_chains_with_thin_necks(alike):
    """The equations of nine thin necks lose eight digits; energy and work agree, because cuts stay
    shut.
    """
    thin = {
        name: getattr(alike.stage.hinges, name).model_copy(update={"neck": 0.02})
        for name in HINGE_NAMES
    }
    stage = alike.stage.model_copy(
        update={"hinges": alike.stage.hinges.model_copy(update=thin), "override": ()}
    )
    response = unit_response(mesh_sectors(stage, COARSE), plate_of(stage))
    (sector,) = response.sectors
    fields = sector_values([response.nodal])
    for chain in range(3):
        ahead = fields[chain][:, sector.ahead]
        behind = turned(fields[(chain + 1) % 3][:, sector.behind], CHAIN_TURN)
        np.testing.assert_allclose(
            ahead, behind, rtol=0, atol=SUMS * np.max(np.abs(ahead))
        )  # 5e-9 was seen
