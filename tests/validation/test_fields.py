"""The ground that problems stand on: exact fields are exact, and loads and quadratures of
`flexfem.fem.structure`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.fem.elements import integration
from flexfem.fem.mesh import PlaneMesh, mapped, nodes_on

from . import consistency, plane
from .fields import body_force, clamp, edge_force, errors, on_chords, pressure, solve, uniform
from .problem import Exact, hooke

PLATE = consistency.PLATE
STEP = 1e-5  # mm, of central differences
DIFFERENCE = 1e-7  # relative: STEP squared times second derivatives, and round-off over STEP
RNG = np.random.default_rng(29)
ANGLE = RNG.uniform(0.05, 1.5, 20)
AROUND = np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=-1)
BAR = RNG.uniform([0, -1], [3, 1], (20, 2))
FIELDS = {
    "manufactured": (consistency.FIELD, BAR),
    "kirsch": (plane.KIRSCH, RNG.uniform(1, 3, (20, 1)) * AROUND),
    "golovin": (plane.GOLOVIN, RNG.uniform(plane.INNER, plane.OUTER, (20, 1)) * AROUND),
    "timoshenko": (plane.TIMOSHENKO, BAR),
}


def slopes(function: Callable[[Array], Array], points: Array) -> Array:
    """Derivatives by x and y, along a new last axis, by central differences."""
    steps = STEP * np.eye(2)
    return np.stack(
        [(function(points + d) - function(points - d)) / (2 * STEP) for d in steps], axis=-1
    )


@pytest.fixture(scope="module")
def plate() -> PlaneMesh:
    return consistency.plate_mesh(0.25)


@pytest.mark.parametrize(("exact", "points"), FIELDS.values(), ids=FIELDS)
def test_exact_stress_is_that_of_the_displacement_and_in_equilibrium(
    exact: Exact, points: Array
) -> None:
    found = slopes(exact.displacement, points)
    wanted = exact.stress(points)
    np.testing.assert_allclose(
        hooke(exact.plate, found), wanted, rtol=0, atol=DIFFERENCE * np.abs(wanted).max()
    )
    if exact.gradient is not None:
        np.testing.assert_allclose(
            exact.gradient(points), found, rtol=0, atol=DIFFERENCE * np.abs(found).max()
        )
    change = slopes(exact.stress, points)
    force = np.zeros_like(points) if exact.body_force is None else exact.body_force(points)
    np.testing.assert_allclose(
        np.einsum("nabb->na", change) + force, 0.0, atol=DIFFERENCE * np.abs(change).max()
    )


def test_kirsch_hole_and_golovin_arcs_are_free() -> None:
    for stress, radii in (
        (plane.kirsch_stress, [1.0]),
        (plane.golovin_stress, [plane.INNER, plane.OUTER]),
    ):
        inside = np.abs(stress(1.02 * radii[0] * AROUND)).max()
        for radius in radii:
            pulled = (stress(radius * AROUND) @ AROUND[..., None])[..., 0]
            np.testing.assert_allclose(
                pulled, 0.0, atol=1e-9 * inside
            )  # differences of large terms


def test_quadrature_points_are_those_of_the_gradients() -> None:
    """A quadratic field on straight triangles has its exact gradient at every point, in the points'
    own order.
    """
    mesh = on_chords(mapped(3, 2, lambda u, v: np.stack([2.3 * u + 0.4 * v, 1.1 * v], axis=-1)))
    x, y = mesh.nodes.T
    for batch in integration(mesh, 8):
        triangles = batch.triangles
        gradients = batch.gradients
        N = batch.phi
        points = np.einsum("eid,iq->eqd", mesh.nodes[triangles], N)
        found = np.einsum("ei,eibq->eqb", (x**2 - 3 * x * y)[triangles], gradients)
        px, py = np.moveaxis(points, -1, 0)
        np.testing.assert_allclose(found, np.stack([2 * px - 3 * py, -3 * px], axis=-1), atol=1e-10)


def test_edge_and_body_forces_have_the_resultants_of_drawn_arcs(plate: PlaneMesh) -> None:
    """Pressure on an arc is that on its chord, outwards of the plate, so into the notch; around, it
    is nothing.
    """
    b = PLATE.thickness
    notch = consistency.NOTCH
    corner = consistency.CORNER
    on_notch = edge_force(plate, PLATE, plate.edges["notch"], pressure(3.7)).sum(axis=0)
    np.testing.assert_allclose(on_notch, [0.0, 3.7 * b * 2 * notch], atol=1e-9)
    force = edge_force(plate, PLATE, np.concatenate(list(plate.edges.values())), pressure(3.7))
    arms = np.column_stack([-plate.nodes[:, 1], plate.nodes[:, 0]])
    np.testing.assert_allclose(
        [*force.sum(axis=0), np.sum(arms * force)], 0.0, atol=1e-11 * np.abs(force).sum()
    )
    along = edge_force(plate, PLATE, plate.edges["notch"], uniform(2.0, -1.0)).sum(axis=0)
    np.testing.assert_allclose(
        along, b * np.pi * notch * np.array([2.0, -1.0]), rtol=1e-4
    )  # of the mesh
    weight = body_force(plate, PLATE, lambda x: np.broadcast_to([0.3, -0.2], x.shape)).sum(axis=0)
    area = 6 - np.pi * notch**2 / 2 - (1 - np.pi / 4) * corner**2
    np.testing.assert_allclose(weight, b * area * np.array([0.3, -0.2]), rtol=1e-5)  # of the mesh


def test_reactions_are_on_the_supports_and_balance(plate: PlaneMesh) -> None:
    held = nodes_on(plate, "held")
    force = edge_force(
        plate, PLATE, plate.edges["bottom"], uniform(1.0, 2.0)
    )  # also on a node that is held
    solution = solve(plate, PLATE, force, clamp(held))
    assert np.any(force[held] != 0.0) and np.all(np.delete(solution.reactions, held, axis=0) == 0.0)
    np.testing.assert_allclose(
        (solution.reactions + force).sum(axis=0), 0.0, atol=1e-9 * np.abs(force).sum()
    )


def test_errors_of_half_an_exact_linear_field_are_one_half() -> None:
    mesh = consistency.distorted()
    slope = consistency.SLOPES
    exact = (
        lambda x: x @ slope.T,
        lambda x: np.broadcast_to(slope, (*x.shape[:-1], 2, 2)),
        lambda x: np.broadcast_to(hooke(PLATE, slope), (*x.shape[:-1], 2, 2)),
    )
    np.testing.assert_allclose(
        errors(mesh, PLATE, mesh.nodes @ slope.T / 2, *exact), 0.5, rtol=1e-11
    )
