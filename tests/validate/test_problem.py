"""The ground the benchmarks stand on: quadrature, loads, exact fields, extrapolation and the table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, integration
from flexfem.fem.problem import (
    Support,
    body_force,
    clamp,
    edge_force,
    errors,
    mapped,
    nearest_node,
    nodes_on,
    on_chords,
    outward,
    pressure,
    shape_values,
    solve,
    uniform,
)
from flexfem.refused import BadInput
from flexfem.validate import beams, holes
from flexfem.validate import exact as known
from flexfem.validate.records import Finding, extrapolated, order
from flexfem.validate.registry import BenchmarkTable, markdown_page, run_benchmarks, write_benchmarks

PLATE = known.PLATE
STEP = 1e-5  # mm, of central differences
DIFFERENCE = 1e-8  # relative: STEP squared times second derivatives, and round-off over STEP
ROUND_OFF = 1e-11


class Exact(NamedTuple):
    """An exact field with its plate, some points of its domain and the force per volume that holds it."""

    plate: Plate
    displacement: Callable[[Array], Array]
    stress: Callable[[Array], Array]
    points: Array
    body_force: Callable[[Array], Array] | None


def exact_fields() -> dict[str, Exact]:
    rng = np.random.default_rng(29)
    angle, share = rng.uniform(0.05, 1.5, 20), rng.uniform(0, 1, 20)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    field = known.Field(PLATE)
    ring = (beams.CURVED_INNER + share * (beams.CURVED_OUTER - beams.CURVED_INNER))[:, None] * around
    bar = rng.uniform([0, -1], [3, 1], (20, 2))
    return {
        "manufactured": Exact(PLATE, field.displacement, field.stress, bar, field.body_force),
        "kirsch": Exact(
            holes.PLATE, holes.kirsch_displacement, holes.kirsch_stress, (1 + 2 * share)[:, None] * around, None
        ),
        "golovin": Exact(beams.CURVED, beams.ring_displacement, beams.ring_stress, ring, None),
        "timoshenko": Exact(beams.CANTILEVER, beams.cantilever_displacement, beams.cantilever_stress, bar, None),
    }


@pytest.fixture(params=exact_fields())
def exact(request: pytest.FixtureRequest) -> Exact:
    return exact_fields()[request.param]


def slopes(function: Callable[[Array], Array], points: Array) -> Array:
    """Derivatives by x and y, along a new last axis, by central differences."""
    steps = STEP * np.eye(2)
    return np.stack([(function(points + d) - function(points - d)) / (2 * STEP) for d in steps], axis=-1)


@pytest.fixture(scope="module")
def plate() -> StageMesh:
    return known.plate_mesh(0.25)


def test_exact_stress_is_that_of_the_exact_displacement(exact: Exact) -> None:
    found = known.hooke(exact.plate, slopes(exact.displacement, exact.points))
    wanted = exact.stress(exact.points)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=10 * DIFFERENCE * np.abs(wanted).max())


def test_exact_fields_are_in_equilibrium(exact: Exact) -> None:
    held = np.einsum("nabb->na", slopes(exact.stress, exact.points))
    force = np.zeros_like(held) if exact.body_force is None else exact.body_force(exact.points)
    scale = np.abs(slopes(exact.stress, exact.points)).max()
    np.testing.assert_allclose(held + force, 0.0, atol=10 * DIFFERENCE * scale)


def test_manufactured_derivatives_are_those_of_the_field() -> None:
    field, points = known.Field(PLATE), exact_fields()["manufactured"].points
    for function, derivative in ((field.displacement, field.gradient), (field.gradient, field.second)):
        wanted = slopes(function, points)
        np.testing.assert_allclose(derivative(points), wanted, rtol=0, atol=10 * DIFFERENCE * np.abs(wanted).max())


def test_hooke_is_a_thin_plates() -> None:
    """Strains back from the stresses by the compliances of plane stress."""
    gradient = np.array([[1.3e-3, -0.4e-3], [2.1e-3, 0.7e-3]])
    (xx, xy), (_, yy) = known.hooke(PLATE, gradient)
    e, nu, _ = PLATE
    assert (xx - nu * yy) / e == pytest.approx(gradient[0, 0], rel=ROUND_OFF)
    assert (yy - nu * xx) / e == pytest.approx(gradient[1, 1], rel=ROUND_OFF)
    assert 2 * (1 + nu) * xy / e == pytest.approx(gradient[0, 1] + gradient[1, 0], rel=ROUND_OFF)


def test_kirsch_hole_is_free_and_forgotten_far_away() -> None:
    angle = np.linspace(0, np.pi / 2, 9)
    n = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    pulled = (holes.kirsch_stress(holes.HOLE * n) @ n[..., None])[..., 0]
    np.testing.assert_allclose(pulled, 0.0, atol=ROUND_OFF)
    far = holes.kirsch_stress(1e6 * n)
    np.testing.assert_allclose(far, np.broadcast_to(np.diag([holes.TENSION, 0.0]), far.shape), atol=1e-9)


def test_golovin_ring_is_free_on_its_arcs_and_carries_a_unit_force() -> None:
    angle = np.linspace(0, np.pi / 2, 9)
    n = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    inside = np.abs(beams.ring_stress(4.2 * n)).max()
    for radius in (beams.CURVED_INNER, beams.CURVED_OUTER):
        pulled = (beams.ring_stress(radius * n) @ n[..., None])[..., 0]
        np.testing.assert_allclose(pulled, 0.0, atol=1e-9 * inside)  # differences of large terms
    mesh = beams.quarter_ring(12, 3)
    end = edge_force(
        mesh, beams.CURVED, mesh.edges["bottom"], lambda x, m: (beams.ring_stress(x) @ m[..., None])[..., 0]
    )
    np.testing.assert_allclose(end.sum(axis=0), [1.0, 0.0], atol=1e-3)  # of three points on a smooth profile


def test_golovin_held_section_does_not_move_along_the_ring() -> None:
    radii = np.linspace(beams.CURVED_INNER, beams.CURVED_OUTER, 5)
    held = beams.ring_displacement(np.stack([0 * radii, radii], axis=-1))
    np.testing.assert_allclose(held[:, 0], 0.0, atol=1e-9 * beams.end_displacement())
    loaded = beams.ring_displacement(np.stack([radii, 0 * radii], axis=-1))
    np.testing.assert_allclose(loaded[:, 0], beams.end_displacement(), rtol=1e-9)


@pytest.mark.parametrize("power", [(0, 0), (1, 0), (0, 1), (2, 1), (3, 4), (0, 8)])
def test_quadrature_points_and_weights_belong_together(power: tuple[int, int]) -> None:
    """Polynomials up to the stated degree over a straight-sided rectangle."""
    mesh, (p, q), total = mapped(3, 2, lambda u, v: np.stack([2.3 * u, 1.1 * v], axis=-1)), power, 0.0
    for triangles, _, weights in integration(mesh, 8):
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], shape_values(8))
        total += float(np.sum(points[..., 0] ** p * points[..., 1] ** q * weights))
    assert total == pytest.approx(2.3 ** (p + 1) / (p + 1) * 1.1 ** (q + 1) / (q + 1), rel=ROUND_OFF)


def test_quadrature_points_are_those_of_the_gradients() -> None:
    """A quadratic field on straight triangles has its exact gradient at every point, in the points' own order."""
    mesh = on_chords(mapped(3, 2, lambda u, v: np.stack([2.3 * u + 0.4 * v, 1.1 * v], axis=-1)))
    x, y = mesh.nodes.T
    for triangles, gradients, _ in integration(mesh, 8):
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], shape_values(8))
        found = np.einsum("ei,eibq->eqb", (x**2 - 3 * x * y)[triangles], gradients)
        px, py = np.moveaxis(points, -1, 0)
        np.testing.assert_allclose(found, np.stack([2 * px - 3 * py, -3 * px], axis=-1), atol=1e-10)


def test_pressure_all_around_has_no_resultant(plate: StageMesh) -> None:
    every = np.concatenate(list(plate.edges.values()))
    force = edge_force(plate, PLATE, every, pressure(3.7))
    arms = np.column_stack([-plate.nodes[:, 1], plate.nodes[:, 0]])
    np.testing.assert_allclose([*force.sum(axis=0), np.sum(arms * force)], 0.0, atol=ROUND_OFF * np.abs(force).sum())


def test_pressure_on_an_arc_is_that_on_its_chord(plate: StageMesh) -> None:
    """Outwards of the plate, so into the notch: upwards."""
    force = edge_force(plate, PLATE, plate.edges["notch"], pressure(3.7)).sum(axis=0)
    np.testing.assert_allclose(force, [0.0, 3.7 * PLATE.thickness * 2 * known.NOTCH], atol=1e-9)


def test_traction_is_spread_over_the_length_of_an_arc(plate: StageMesh) -> None:
    force = edge_force(plate, PLATE, plate.edges["notch"], uniform(2.0, -1.0)).sum(axis=0)
    length = np.pi * known.NOTCH
    np.testing.assert_allclose(force, PLATE.thickness * length * np.array([2.0, -1.0]), rtol=1e-4)  # of the mesh


def test_body_force_adds_up_to_the_volume(plate: StageMesh) -> None:
    force = body_force(plate, PLATE, lambda x: np.broadcast_to([0.3, -0.2], x.shape)).sum(axis=0)
    area = 6 - np.pi * known.NOTCH**2 / 2 - (1 - np.pi / 4) * known.CORNER**2
    np.testing.assert_allclose(force, PLATE.thickness * area * np.array([0.3, -0.2]), rtol=1e-5)  # of the mesh


def test_outward_edges_do_not_depend_on_how_they_are_given(plate: StageMesh) -> None:
    edges = np.concatenate(list(plate.edges.values()))
    np.testing.assert_array_equal(outward(plate, edges[:, [1, 0, 2]]), outward(plate, edges))


def test_reactions_are_on_the_supports_and_balance(plate: StageMesh) -> None:
    held = nodes_on(plate, "held")
    force = edge_force(plate, PLATE, plate.edges["bottom"], uniform(1.0, 2.0))  # also on a node that is held
    assert np.any(force[held] != 0.0)
    solution = solve(plate, PLATE, force, clamp(held))
    assert np.all(np.delete(solution.reactions, held, axis=0) == 0.0)
    np.testing.assert_allclose((solution.reactions + force).sum(axis=0), 0.0, atol=1e-9 * np.abs(force).sum())
    assert solution.unknowns == 2 * (len(plate.nodes) - len(held))


def test_prescribed_displacements_are_taken_as_given(plate: StageMesh) -> None:
    held = nodes_on(plate, "held")
    supports = [Support(held, 0, 0.01), Support(held, 1, np.linspace(0, 1e-3, len(held)))]
    field = solve(plate, PLATE, np.zeros_like(plate.nodes), supports).field
    np.testing.assert_array_equal(
        field[held], np.column_stack([np.full(len(held), 0.01), np.linspace(0, 1e-3, len(held))])
    )


def test_errors_of_the_exact_linear_field_are_round_off_and_of_half_of_it_one_half() -> None:
    mesh, slope = known.distorted(), known.SLOPES
    exact = (
        lambda x: x @ slope.T,
        lambda x: np.broadcast_to(slope, (*x.shape[:-1], 2, 2)),
        lambda x: np.broadcast_to(known.hooke(PLATE, slope), (*x.shape[:-1], 2, 2)),
    )
    field = mesh.nodes @ slope.T
    assert max(errors(mesh, PLATE, field, *exact)) < ROUND_OFF
    np.testing.assert_allclose(errors(mesh, PLATE, field / 2, *exact), 0.5, rtol=ROUND_OFF)


def test_mapped_grid_is_counter_clockwise_with_middles_where_the_map_puts_them() -> None:
    mesh = beams.quarter_ring(5, 2)
    a, b, c = (mesh.nodes[mesh.triangles[:, k]] for k in range(3))
    assert np.all((b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0])
    for side, radius in (("left", beams.CURVED_INNER), ("right", beams.CURVED_OUTER)):
        np.testing.assert_allclose(np.hypot(*mesh.nodes[nodes_on(mesh, side)].T), radius, rtol=ROUND_OFF)
    straight = on_chords(mesh)
    ends, middles = straight.triangles[:, [0, 1]], straight.triangles[:, 3]
    np.testing.assert_allclose(straight.nodes[middles], straight.nodes[ends].mean(axis=1), rtol=ROUND_OFF)


def test_a_point_without_a_node_is_an_error(plate: StageMesh) -> None:
    assert np.all(plate.nodes[nearest_node(plate, 3.0, 2.0)] == [3.0, 2.0])
    with pytest.raises(ValueError, match="no node"):
        nearest_node(plate, 1.5, 2.0)


def test_order_and_limit_of_a_power_law() -> None:
    sizes = (0.4, 0.2, 0.1)
    assert order(sizes, [3 * h**2.3 for h in sizes]) == pytest.approx(2.3)
    assert extrapolated(sizes, [5.1 - 3 * h**1.7 for h in sizes]) == pytest.approx(5.1)
    assert extrapolated(sizes, [1.0, 1.6, 2.0]) == pytest.approx(2.8)  # slow: 0.6, 0.4, and 0.8 to come
    assert extrapolated(sizes, [1.0, 2.0, 3.0]) == 3.0
    assert extrapolated(sizes, [1.0, 2.0, 1.5]) == 1.5  # no monotonic convergence, no extrapolation
    with pytest.raises(ValueError, match="one ratio"):
        extrapolated((0.4, 0.2, 0.15), (1.0, 2.0, 3.0))


def test_not_a_number_never_passes() -> None:
    assert not Finding("a", "b", "c", 1.0, float("nan"), 1.0).passed
    assert Finding("a", "b", "c", 1.0, 1.5, 0.5).passed
    assert not Finding("a", "b", "c", 1.0, 0.4, 0.5).passed


def test_table_counts_what_failed_and_is_written_as_it_is_shown(tmp_path: Path) -> None:
    good, bad = (
        Finding("one", "source", "what", 3.0, 3.1, 0.2),
        Finding("two", "source", "what", 0.0, 1.0, 0.5, note="why"),
    )
    table = BenchmarkTable([good, bad], {"one": 0.1, "two": 0.2})
    text = markdown_page(table)
    assert not table.passed and "1 of 2 failed" in text and "**FAILED**" in text and "- two, what: why." in text
    assert "| one | what | 3 | exact | 3.1 | +1.0e-01 (+3.33 %) | 0.2 | 0 | passed |" in text
    assert write_benchmarks(table, tmp_path / "new").read_text() == text
    assert "all 1 passed" in markdown_page(BenchmarkTable([good], {"one": 0.1}))


def test_chosen_benchmarks_run_alone_and_unknown_ones_are_refused() -> None:
    seen: list[str] = []
    table = run_benchmarks(["patch-test", "rigid-body-motions"], seen.append)
    assert seen == ["patch-test", "rigid-body-motions"] == list(table.seconds) and table.passed
    with pytest.raises(BadInput, match="kirsch-hole"):
        run_benchmarks(["no-such"])
