"""The mesh is the drawn stage: all of it, in one piece, conforming, curved, exactly symmetric, or
else refused.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from subprocess import Popen
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

import flexfem.fem.mesh
from flexfem.arrays import turned
from flexfem.fem.mesh import PlaneMesh, check_triangles, jacobians, scaled_jacobians
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import area
from flexfem.mechanism.plate import plate_polygon
from flexfem.meshing import process
from flexfem.meshing.process import end_processes, run_mesher
from flexfem.meshing.requests import FaceMesh
from flexfem.paper.bodies import BODIES, draw_sector
from flexfem.paper.designs import stage_frames
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage import HINGE_NAMES
from flexfem.paper.stage_mesh import build_mesh
from flexfem.refused import BadInput, ComputationFailed

from ..conftest import with_changes

ROUND_OFF = 1e-12  # mm on coordinates up to 70 mm: a few roundings
ON_ARC = 1e-8  # mm; OpenCASCADE draws to its own tolerance
COARSE = 3  # resolution of the fixtures


def sides(mesh):
    """All sides (3m, 3) of the triangles: ends, then middle."""
    t = mesh.triangles
    return np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])


def length(mesh, edges):
    """Length of straight edges, mm."""
    return float(np.sum(np.linalg.norm(mesh.nodes[edges[:, 0]] - mesh.nodes[edges[:, 1]], axis=1)))


def test_interior_sides_are_shared_by_two_triangles_and_outer_sides_belong_to_one(each):
    found = sides(each.mesh)
    ends = np.sort(found[:, :2], axis=1)
    for side, sharing in Counter(map(tuple, ends.tolist())).items():
        assert sharing in (1, 2), side
    middles: dict[tuple[int, int], set[int]] = {}
    for (a, b), middle in zip(ends.tolist(), found[:, 2].tolist(), strict=True):
        middles.setdefault((a, b), set()).add(middle)
    assert all(
        len(at) == 1 for at in middles.values()
    )  # else the two triangles could part between their corners
    assert len(set().union(*middles.values())) == len(middles)


def test_area_of_every_body_is_the_drawn_one(each):
    found = np.bincount(each.mesh.bodies, jacobians(each.mesh)[:, -1] / 2, minlength=12)
    faces = [draw_sector(each.stage, chain)[body] for chain in (1, 2, 3) for body in BODIES]
    ARCS = 1e-4  # parabolas instead of arcs of 40 degrees
    np.testing.assert_allclose(found, [area(face.loop) for face in faces], rtol=ARCS)


def test_triangles_are_counter_clockwise_and_far_from_folded(each):
    assert np.all(jacobians(each.mesh) > 0)
    assert (
        0.6 < scaled_jacobians(jacobians(each.mesh)).min() <= 1.0
    )  # 0.8; less than 0.1 is refused


def test_nodes_of_alike_chains_are_symmetric_to_round_off(alike):
    nodes = alike.mesh.nodes
    distance, partner = KDTree(nodes).query(turned(nodes, CHAIN_TURN))
    assert distance.max() < ROUND_OFF
    assert len(np.unique(partner)) == len(nodes)
    triangles = {tuple(sorted(t)) for t in alike.mesh.triangles.tolist()}
    assert {tuple(sorted(t)) for t in partner[alike.mesh.triangles].tolist()} == triangles


def test_every_neck_is_crossed_by_as_many_triangles_as_asked_for(each):
    mesh = each.mesh
    sharing = Counter(tuple(sorted(s)) for s in sides(each.mesh)[:, :2].tolist())
    for chain in (1, 2, 3):
        for k, name in enumerate(HINGE_NAMES):
            edges = mesh.edges[f"neck {chain} {name}"]
            neck = each.stage.hinge(chain, name).neck
            stubby = neck / (
                0.5 * each.stage.hinge(chain, name).radius
            )  # its notch must be resolved, not its neck
            assert len(edges) == np.ceil(COARSE * max(1.0, stubby))
            assert length(mesh, edges) == pytest.approx(neck, rel=1e-9)  # ten digits of 70 mm
            # equal edges about the hinge's centre, middles in the middle
            np.testing.assert_allclose(
                mesh.nodes[np.unique(edges)].mean(axis=0),
                stage_frames(each.stage).centres[chain - 1, k],
                atol=ON_ARC,
            )
            assert all(sharing[tuple(sorted(edge[:2].tolist()))] == 2 for edge in edges)


def test_hub_is_a_full_circle_with_middle_nodes_on_it(each):
    edges = each.mesh.edges["hub"]
    radius = each.stage.platform.hub_radius
    nodes = each.mesh.nodes[np.unique(edges)]
    np.testing.assert_allclose(np.hypot(*nodes.T), radius, atol=ON_ARC)
    assert len(np.unique(edges)) == 2 * len(edges)  # closed


def test_ground_is_the_straight_back_of_three_pads(each):
    edges = each.mesh.edges["ground"]
    assert length(each.mesh, edges) == pytest.approx(3 * each.stage.chain.link_width, rel=1e-9)
    placed = stage_frames(each.stage)
    back = each.stage.chain.link_width + each.stage.array("radius")[:, 0]
    along = np.stack([np.cos(placed.axes[:, 0]), np.sin(placed.axes[:, 0])], axis=-1)
    for node in each.mesh.nodes[np.unique(edges)]:
        behind = np.sum((node - placed.centres[:, 0]) * along, axis=-1) + back
        assert np.min(np.abs(behind)) < ON_ARC


@pytest.mark.parametrize("bend", [1e-10, 1e-7, 1e-5], ids=lambda bend: f"{bend:g} degrees")
def test_links_bent_by_next_to_nothing_are_meshed_as_straight_ones(bend, alike):
    """The arc of such a bend is shorter than two points of the drawing can be apart."""
    mesh = build_mesh(with_changes({"hinges.elbow.axis_deg": 175.0 + bend}), COARSE)
    assert jacobians(mesh)[:, -1].sum() == pytest.approx(
        jacobians(alike.mesh)[:, -1].sum(), rel=1e-6
    )  # other parabolas


def test_too_large_a_mesh_is_refused(alike, monkeypatch):
    monkeypatch.setattr(flexfem.fem.mesh, "MOST_TRIANGLES", 99)
    with pytest.raises(
        ComputationFailed, match=r"^mesh of \d+ triangles, expected at most 99: [^\n]*$"
    ):
        build_mesh(alike.stage, COARSE)


class Trap:
    """Pickles into a call of something in the child, in place of a face."""

    def __init__(self, call, *arguments):
        self.trap = (call, arguments)

    def __reduce__(self):
        return self.trap


def test_a_child_that_hangs_is_stopped():
    with pytest.raises(ComputationFailed, match=r"^gmsh was stopped: [^\n]*$"):
        run_mesher(FaceMesh([Trap(time.sleep, 60)], {}, []), 0.5)


def test_a_child_that_dies_is_one_line():
    with pytest.raises(ComputationFailed) as failure:
        run_mesher(FaceMesh([Trap(os.abort)], {}, []), 20.0)
    assert "\n" not in str(failure.value) and str(failure.value)


def test_one_process_meshes_stage_after_stage_until_one_fails(alike, monkeypatch):
    started: list[Any] = []
    monkeypatch.setattr(
        process,
        "Popen",
        lambda *args, **named: started.append(Popen(*args, **named)) or started[-1],
    )
    end_processes()
    first = build_mesh(alike.stage, 2)
    second = build_mesh(alike.stage, 3)
    assert len(started) == 1 and len(second.triangles) > len(first.triangles)
    with pytest.raises(ComputationFailed):
        run_mesher(FaceMesh([Trap(os.abort)], {}, []), 20.0)
    assert np.array_equal(build_mesh(alike.stage, 2).nodes, first.nodes) and len(started) == 2
    monkeypatch.setattr(process, "MOST_KEPT", 1000)  # bytes; large meshes leave no process behind
    build_mesh(alike.stage, 2)
    assert all(each.poll() is not None for each in started)


def severed(mesh, label, bodies):
    """The mesh with the given bodies on nodes of their own along an edge."""
    edge = np.unique(mesh.edges[label])
    own = np.arange(len(mesh.nodes))
    own[edge] = len(mesh.nodes) + np.arange(len(edge))
    triangles = mesh.triangles.copy()
    loose = np.isin(mesh.bodies, bodies)
    triangles[loose] = own[triangles[loose]]
    return mesh._replace(nodes=np.concatenate([mesh.nodes, mesh.nodes[edge]]), triangles=triangles)


def with_node_moved(mesh, triangle, which, to):
    nodes = mesh.nodes.copy()
    nodes[mesh.triangles[triangle, which]] = nodes[mesh.triangles[triangle, to]]
    return mesh._replace(nodes=nodes)


@pytest.mark.parametrize(
    ("label", "bodies"), [("neck 1 base", [0]), ("neck 2 platform", [4, 5, 6])]
)
def test_a_severed_neck_is_refused(alike, label, bodies):
    with pytest.raises(ComputationFailed, match=r"2 pieces.*severed"):
        check_triangles(severed(alike.mesh, label, bodies), plate_polygon(alike.stage.layout).area)


def test_an_orphan_node_is_refused(alike):
    orphaned = alike.mesh._replace(nodes=np.concatenate([alike.mesh.nodes, [[1.0, 2.0]]]))
    with pytest.raises(ComputationFailed, match="belong to no triangle"):
        check_triangles(orphaned, plate_polygon(alike.stage.layout).area)


def test_the_mesh_of_another_stage_is_refused(alike):
    with pytest.raises(ComputationFailed, match=r"covers .* mm\^2, expected"):
        check_triangles(
            alike.mesh, plate_polygon(with_changes({"platform.hub_radius_mm": 7.9}).layout).area
        )


@pytest.mark.parametrize(("which", "to"), [(3, 0), (4, 2), (5, 0)])
def test_a_folded_triangle_is_refused(alike, which, to):
    finest = int(np.argmin(jacobians(alike.mesh)[:, -1]))  # moves no area worth mentioning
    with pytest.raises(ComputationFailed, match="scaled Jacobian"):
        check_triangles(
            with_node_moved(alike.mesh, finest, which, to), plate_polygon(alike.stage.layout).area
        )


@pytest.mark.parametrize(("place", "sound"), [(0.2725, False), (0.2775, True)])
def test_a_middle_node_close_to_its_corner_is_refused(place, sound):
    """On a straight side the Jacobian at the corner is 4 p - 1 of the mean one: 0.09 and 0.11."""
    nodes = np.array(
        [[0.0, 0.0], [2.0, 0.0], [0.0, 3.0], [2.0 * place, 0.0], [1.0, 1.5], [0.0, 1.5]]
    )
    single = PlaneMesh(nodes, np.arange(6)[None, :], np.zeros(1, dtype=np.int64), {})
    assert scaled_jacobians(jacobians(single)).min() == pytest.approx(4 * place - 1, rel=1e-12)
    if sound:
        check_triangles(single, 3.0)
    else:
        with pytest.raises(
            ComputationFailed, match=r"Jacobian of 0\.09 near \(0.666667, 1\) mm, expected > 0\.1"
        ):
            check_triangles(single, 3.0)


@pytest.mark.slow
def test_random_feasible_stages_can_be_meshed():
    rng = np.random.default_rng(29)
    meshed = 0
    while meshed < 12:
        lengths = np.array([31.0, 33.5, 25.0]) * rng.uniform(0.8, 1.2, 3)
        angles = np.array([175.0, -85.0, 92.0]) + rng.uniform(-20.0, 20.0, 3)
        changes: dict[str, Any] = {
            "chain.link_lengths_mm": lengths.tolist(),
            "chain.joint_angles_deg": angles.tolist(),
            "platform.radius_mm": float(rng.uniform(11.0, 17.0)),
            "override": [{"chain": 2, "hinge": "elbow", "neck_mm": float(rng.uniform(0.2, 1.0))}],
        }
        stage = with_changes(changes)
        try:
            check_feasible(stage)
        except BadInput:
            continue
        build_mesh(stage, COARSE)
        meshed += 1
