"""Whole solutions against textbooks: a cantilever, single hinges, and the order of convergence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import quad

from flexfem.fem.elements import Plate, nodal_stress
from flexfem.fem.gmsh_process import run_mesher
from flexfem.fem.mesh import StageMesh, curved, ordered
from flexfem.fem.mesher import Cone, Job
from flexfem.fem.response import platform_response
from flexfem.mechanism.bodies import Face, Pose, Segment, notch_side, reverse
from flexfem.mechanism.stage import Hinge, load_stage

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
ST_VENANT = 1e-6  # what the ends of a bar three heights long feel of each other
GEOMETRY = Path(__file__).parents[2] / "geometry"


def cantilever(bar: Callable[..., StageMesh], length: float, height: float) -> np.ndarray:
    """Compliance at the tip of a bar, clamped at its left end."""
    return platform_response(bar(length, height, round(6 * length / height), 6), PLATE).compliance


def test_cantilever_of_timoshenko(bar: Callable[..., StageMesh]) -> None:
    """A clamped end holds the section from narrowing, which is worth about half a percent at five heights long."""
    CLAMP = 0.007
    length, height = 10.0, 2.0
    e, nu, b = PLATE
    area, inertia, shear = b * height, b * height**3 / 12, e / (2 * (1 + nu))
    bending, sliding = length**3 / (3 * e * inertia), 1.2 * length / (shear * area)
    C = cantilever(bar, length, height)
    assert sliding > 4 * CLAMP * bending  # else shear could be left out and nobody would see
    assert C[0, 0] == pytest.approx(length / (e * area), rel=CLAMP)
    assert C[1, 1] == pytest.approx(bending + sliding, rel=CLAMP)
    assert C[1, 2] == pytest.approx(length**2 / (2 * e * inertia), rel=CLAMP)
    assert C[2, 2] == pytest.approx(length / (e * inertia), rel=CLAMP)
    UNMIRRORED = 1e-4  # all diagonals of the grid lean to one side
    assert abs(C[0, 1]) < UNMIRRORED * C[1, 1] and abs(C[0, 2]) < UNMIRRORED * C[2, 2]


def test_a_longer_bar_adds_exactly_the_stretch_and_bend_of_its_extra_length(bar: Callable[..., StageMesh]) -> None:
    """The difference of two lengths is free of both ends, by Saint-Venant."""
    height, short, long = 2.0, 8.0, 12.0
    extra = cantilever(bar, long, height) - cantilever(bar, short, height)
    e, _, b = PLATE
    assert extra[0, 0] == pytest.approx((long - short) / (e * b * height), rel=10 * ST_VENANT)
    assert extra[2, 2] == pytest.approx((long - short) / (e * b * height**3 / 12), rel=10 * ST_VENANT)


def test_four_lengths_of_a_bar_give_the_bending_term_alone(bar: Callable[..., StageMesh]) -> None:
    """`C_yy = L^3/(3 E I) + c2 L^2 + c1 L + c0`: the third difference is free of clamp and shear."""
    height, step = 2.0, 2.0
    tips = [cantilever(bar, 8.0 + k * step, height)[1, 1] for k in range(4)]
    e, _, b = PLATE
    third = float(np.diff(tips, 3)[0])
    assert third == pytest.approx(2 * step**3 / (e * b * height**3 / 12), rel=1e-3)  # differences amplify ST_VENANT


class SingleHinge(NamedTuple):
    """A notch between two rigid ends: compliance about the neck's centre, and its mesh and fields."""

    compliance: np.ndarray
    mesh: StageMesh
    fields: np.ndarray


def halves(hinge: Hinge) -> list[Face]:
    """The two halves of a full notch between plates at its ends, the neck at the origin along x."""
    neck, width = Pose(0j, 0.0), 2 * hinge.radius + hinge.neck
    (below_in, below_out), (above_in, above_out) = (notch_side(neck, hinge, width, side) for side in (-1, 1))
    top, bottom = above_out[0].start, below_out[0].start
    left = [*below_in, Segment(bottom, top), *reverse(above_in), Segment(above_in[0].start, below_in[0].start)]
    right = [*below_out, Segment(below_out[-1].end, above_out[-1].end), *reverse(above_out), Segment(top, bottom)]
    return [Face(left, ["free", "neck", "free", "ground"]), Face(right, ["free", "hub", "free", "neck"])]


def single_hinge(neck: float, radius: float, plate: Plate, resolution: int = 8) -> SingleHinge:
    hinge = Hinge(radius=radius, neck=neck)
    bent, least, most = np.sqrt(neck * radius), neck / resolution, 2 * radius / resolution
    cone = Cone(0j, bent, least, most, (most - least) * resolution / 1.5)
    made = run_mesher(Job(halves(hinge), {"neck": resolution}, (cone,)), 30.0)
    mesh, _ = ordered(curved(made))
    response = platform_response(mesh, plate)
    return SingleHinge(response.compliance, mesh, response.fields)


def beam(neck: float, radius: float, power: int) -> float:
    """`int dx / h^power` over the notch: what (2) and (3) are closed forms of."""

    def integrand(angle: float) -> float:
        return radius * np.cos(angle) / (neck + 2 * radius * (1 - np.cos(angle))) ** power

    return float(2 * quad(integrand, 0.0, np.pi / 2, epsabs=0, epsrel=1e-10, limit=400)[0])


@pytest.mark.parametrize(
    ("slenderness", "above"), [(0.02, 0.8), (0.1, 3.8), (0.2, 7.0), (0.5, 13.0), (1.0, 16.0)], ids=lambda v: f"{v}"
)
def test_single_hinge_turns_more_than_the_beam_integral_by_the_known_share(slenderness: float, above: float) -> None:
    """An earlier computation of our own: plane stress, rigid end plates, nu = 0.33, in percent of (2)."""
    PRINTED = 0.5 if above > 10 else 0.05  # last digit given
    MESH = 0.05
    radius, plate = 3.0, PLATE._replace(poissons_ratio=0.33)
    found = single_hinge(slenderness * radius, radius, plate).compliance[2, 2]
    integral = 12 * beam(slenderness * radius, radius, 3) / (plate.youngs_modulus * plate.thickness)  # (2)
    assert 100 * (found / integral - 1) == pytest.approx(above, abs=PRINTED + MESH)


@pytest.mark.parametrize("slenderness", [0.05, 0.1, 0.2])
def test_single_hinge_stretches_more_than_the_beam_integral_by_the_known_share(slenderness: float) -> None:
    radius, plate = 3.0, PLATE._replace(poissons_ratio=0.33)
    found = single_hinge(slenderness * radius, radius, plate).compliance[0, 0]
    integral = beam(slenderness * radius, radius, 1) / (plate.youngs_modulus * plate.thickness)  # (3)
    assert 1.04 < found / integral < 1.09  # an earlier computation: 4 to 9 %


def test_compliances_about_the_centre_of_a_hinge_are_uncoupled() -> None:
    """Force at the neck's centre; the right plate is rigid, so it is read there."""
    C = single_hinge(0.4, 3.0, PLATE).compliance
    size = np.sqrt(np.diag(C))
    COUPLING = 2e-5  # of a mesh that is not mirrored about the neck
    off = np.abs(C - np.diag(np.diag(C))) / np.outer(size, size)
    assert off.max() < COUPLING


def test_bending_stress_of_a_long_thin_hinge() -> None:
    """At t/R = 0.05 a notch is nearly a beam: `sigma = 6 M/(b t^2)`, two percent more by its curvature."""
    neck, radius = 0.2, 4.0
    hinge = single_hinge(neck, radius, PLATE)
    stress = nodal_stress(hinge.mesh, PLATE, hinge.fields[2])
    edge = np.unique(hinge.mesh.edges["neck"])
    across = hinge.mesh.nodes[edge, 1]
    nominal = 6 / (PLATE.thickness * neck**2)
    outer = [stress[edge[np.argmax(across)], 0], stress[edge[np.argmin(across)], 0]]
    np.testing.assert_allclose(np.array(outer) / nominal, [-1.0, 1.0], rtol=0.03)  # a positive moment presses the top
    np.testing.assert_allclose(stress[edge, 0] / nominal, -2 * across / neck, rtol=0, atol=0.03)


def test_platform_compliance_converges_with_order_three_or_more(solve: Callable[..., Any]) -> None:
    """Curved quadratic triangles; two across a neck are too few to be in the asymptotic range, so from three on."""
    stage = load_stage(GEOMETRY / "mobility6.toml")
    coarse, middle, fine = (np.diag(solve(stage, n).response.compliance) for n in (3, 6, 12))
    assert np.all(middle > coarse) and np.all(fine > middle)  # displacement elements are too stiff
    order = np.log2((middle - coarse) / (fine - middle))
    assert np.all(order >= 3.0)
    assert np.all((fine - middle) / fine < 3e-4)
