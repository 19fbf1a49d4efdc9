"""Finite elements of one hinge in three dimensions: bars of known stiffness, both limits, and what
must not matter.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from hinge_charts import (
    THICK,
    SingleHinge,
    layers,
    make,
    section_mesh,
    supported,
    thick_response,
    thick_sample,
)
from hinge_charts import sample as plane_sample

from flexfem.fem.elements import SOLID_QUADRATURE, Plate, integration, layered
from flexfem.fem.mesh import jacobians, mapped, nodes_on, scaled_jacobians
from flexfem.fem.structure import NONE, structure

from ..tolerances import SOLVED
from ..validation.fields import edge_force

NU = 0.29
FREEDOMS = ("rotation", "axial")
COARSE = (1, 2, 3)  # levels of the quick tests
BAR_LENGTH = 3.7
BAR_HEIGHT = 1.3  # of the quarter of a bar; full height 2.6
Z = 0.9 * np.array([0.0, 0.3, 0.7, 1.0])


def bar(columns=3, rows=2, length=BAR_LENGTH):
    return mapped(columns, rows, lambda u, v: np.stack([length * u, BAR_HEIGHT * v], axis=-1))


def bent(y):
    """Stress of a unit moment per thickness on the full height."""
    return 12 * y / (2 * BAR_HEIGHT) ** 3


def bar_compliance(mesh, z, stress, hold):
    """Of a quarter of a bar under a stress sxx(y) on the edges `right`; `hold` marks what is held
    (n, m, 3).
    """
    line = layered(z)
    of = structure(mesh, Plate(1.0, NU, 1.0), line, SOLID_QUADRATURE, NONE)
    along = line.values @ line.weights

    def pulling(at, _):
        return np.stack([stress(at[..., 1]), 0 * at[..., 1]], axis=-1)

    flat = edge_force(mesh, Plate(1.0, 0.0, 1.0), mesh.edges["right"], pulling)
    force = np.pad(flat[:, None] * along[:, None], [(0, 0), (0, 0), (0, 1)])
    held = np.zeros(force.shape, dtype=bool)
    hold(held, nodes_on(mesh, "left"), nodes_on(mesh, "bottom"))
    return 2 * np.sum(force * supported(of, of.lower(), force, held)) / along.sum()


def pulled(held, neck, axis):
    held[neck, :, 0] = held[axis, :, 1] = held[:, 0, 2] = True


def turned(held, neck, axis):
    held[neck, :, 0] = held[axis, :, 0] = held[axis, :, 2] = held[:, 0, 2] = held[axis[0], 0, 1] = (
        True
    )


def clamped(held, neck, axis):
    turned(held, neck, axis)
    held[neck, :, 2] = True


@pytest.mark.parametrize("thickness", [0.07, 1.0, 23.0])
def test_a_bar_has_youngs_modulus_whatever_its_thickness(thickness):
    """Pulled, and bent with Saint-Venant's anticlastic curvature, which blocks take part in."""
    found = bar_compliance(
        bar(), thickness * Z, lambda y: np.full_like(y, 1 / (2 * BAR_HEIGHT)), pulled
    )
    assert found == pytest.approx(BAR_LENGTH / (2 * BAR_HEIGHT), rel=SOLVED)
    found = bar_compliance(bar(), thickness * Z, bent, turned)
    assert found == pytest.approx(12 * BAR_LENGTH / (2 * BAR_HEIGHT) ** 3, rel=SOLVED)


def test_a_wide_clamped_strip_bends_as_a_plate_and_a_narrow_one_as_a_beam():
    """The clamp keeps a batch wider than long from bending across, but for its edges; a narrow one
    is free.
    """
    places = 1 - np.linspace(1, 0, 7) ** 2
    widths = [
        bar_compliance(bar(8, 2, 12.0), width * places, bent, clamped)
        for width in (0.5, 4.0, 30.0, 400.0)
    ]
    found = np.array(widths) / (12 * 12.0 / (2 * BAR_HEIGHT) ** 3)
    assert np.all(np.diff(found) < 0)
    EDGES = 12.0 / 400.0 * NU**2  # as much as the batch is long is free of the plate's constraint
    assert 1 - 0.02 < found[0] < 1 and 0 < found[-1] - (1 - NU**2) < EDGES


@pytest.mark.parametrize(
    "hinge",
    [
        SingleHinge(0.03, 1.0, 40.0, NU),
        SingleHinge(0.4, 1.0, 0.7, NU),
        SingleHinge(1.1, 1.0, 9.0, NU),
    ],
)
def test_the_mesh_is_that_of_a_hinge(hinge):
    mesh = section_mesh(hinge, 2)
    high, length = hinge.block
    x, y = mesh.nodes[nodes_on(mesh, "top")].T
    on_arc = x < 1 - 1e-12
    np.testing.assert_allclose(
        np.hypot(x[on_arc], y[on_arc] - 1 - hinge.ratio / 2), 1.0, rtol=1e-12
    )
    np.testing.assert_allclose(y[~on_arc], high / 2, rtol=1e-12)
    area = sum(batch.weights.sum() for batch in integration(mesh))
    CHORDS = 1e-4  # a parabola is not quite an arc
    assert 4 * area == pytest.approx(2 * high * (1 + length) - np.pi, rel=CHORDS)
    assert scaled_jacobians(jacobians(mesh)).min() > 0.3
    z = layers(hinge, 2).heights[::2]
    assert (
        z[0] == 0
        and z[-1] == pytest.approx(hinge.width * hinge.ratio / 2)
        and np.all(np.diff(z, 2) < 1e-12)
    )


@pytest.mark.parametrize("width", [0.6, 7.0, 45.0])
def test_without_contraction_across_thickness_makes_no_difference(width):
    plane, excess, _ = thick_response(SingleHinge(0.17, 1.0, width, 0.0), 1)
    np.testing.assert_allclose(excess / plane, 0.0, atol=SOLVED)


def test_stress_is_that_of_plane_stress_without_contraction_and_in_a_thin_neck():
    np.testing.assert_allclose(
        thick_response(SingleHinge(0.17, 1.0, 7.0, 0.0), 2)[2], 1.0, rtol=SOLVED
    )
    np.testing.assert_allclose(thick_response(SingleHinge(0.3, 1.0, 0.1, NU), 3)[2], 1.0, atol=2e-3)


@pytest.mark.parametrize("ratio", [0.05, pytest.param(0.9, marks=pytest.mark.slow)])
def test_a_thin_hinge_is_in_plane_stress(ratio):
    """As the square of the thickness, which the positions of halved thicknesses show."""
    thick, thin = (
        thick_sample(SingleHinge(ratio, 1.0, width, NU), COARSE)[0] for width in (0.4, 0.2)
    )
    assert np.all(np.abs(thin.values) < 0.004)  # of the nine per cent between the limits
    assert np.all(thin.values < 0.4 * thick.values + thin.bands)


def position(hinge, refinement):
    """As of `thick_sample`, on one mesh."""
    plane, excess, _ = thick_response(hinge, refinement)
    return -excess / plane / hinge.poissons_ratio**2


def thick_limit(hinge, plane):
    """Position (2,) that b -> infinity leads to with blocks of the hinge's own length; its width
    does not matter.

    plane : (2,), plane-stress compliances `E b R^2 theta/M` and `E b dx/F_x` of the hinge, less the
    blocks'."""
    high, block = hinge.block
    x, w = np.polynomial.legendre.leggauss(40)
    depth = 2 + hinge.ratio - 2 * np.sin((x + 1) * np.pi / 2)  # at cos(angle) = x/R
    slope = np.sin((x + 1) * np.pi / 2) * np.pi / 2
    area = 2 * block * high + w @ (depth * slope)
    second = (2 * block * high**3 + w @ (depth**3 * slope)) / 12
    length = 2 * block + 2
    kept = np.array(
        [length**2 / second - 24 * block / high**3, length**2 / area - 2 * block / high]
    )
    return 1 - kept / plane


@pytest.mark.parametrize(
    ("level", "mesh"), [(2, 2.2e-3), pytest.param(3, 6e-4, marks=pytest.mark.slow)]
)
def test_a_thick_hinge_is_in_plane_strain_but_for_contracting_as_a_whole(level, mesh):
    """The closed form of the limit; what is left is the edges', in proportion to 1/b."""
    ratio = 0.1
    plane = plane_sample(SingleHinge(ratio), (2, 3, 4)).values[:2]
    wide = [SingleHinge(ratio, 1.0, width / ratio, NU, 2.0) for width in (200.0, 400.0)]
    limit = thick_limit(wide[0], plane)
    left = np.array([limit - position(hinge, level) for hinge in wide])
    assert np.all(np.abs(left[1]) < 0.006)
    np.testing.assert_allclose(
        left[0], 2 * left[1], atol=mesh
    )  # of a position: a tenth of it in the compliance


@pytest.mark.parametrize("ratio", [0.04, 0.5])
def test_a_hinge_goes_from_plane_stress_to_plane_strain_as_it_gets_thicker(ratio):
    found = np.array(
        [
            position(SingleHinge(ratio, 1.0, width, NU), 1)
            for width in (1.0, 2.0, 5.0, 12.0, 30.0, 50.0)
        ]
    )
    assert np.all(found > 0) and np.all(found < 1) and np.all(np.diff(found, axis=0) > 0)
    assert np.all(found[:, 0] > found[:, 1])  # bending is held back more than pulling


@pytest.mark.parametrize(
    "hinge",
    [
        SingleHinge(0.05, 1.0, 9.0, NU),
        pytest.param(SingleHinge(1.0, 1.0, 3.0, NU), marks=pytest.mark.slow),
    ],
)
def test_positions_converge_and_the_band_covers_a_finer_mesh(hinge):
    coarse, fine = (thick_sample(hinge, levels)[0] for levels in (COARSE, (2, 3, 4)))
    assert np.all(np.abs(fine.values - coarse.values) < coarse.bands + 2e-5)


@pytest.mark.slow
def test_the_chart_says_its_largest_bands(tmp_path):
    make(THICK._replace(shape=(2, 1, 1), levels=COARSE), tmp_path / "one", 1)
    found = json.loads((tmp_path / "one").read_text())
    assert np.shape(found["axial"]) == np.shape(found["bands"]["axial"]) == (2, 1, 1)
    (nu,) = found["nu"]
    for name in ("rotation", "axial"):  # of the compliance: of p times nu^2
        worst = np.max(found["bands"][name]) * nu**2
        assert found["largest_band"][name] == pytest.approx(
            worst, rel=0.1
        )  # both are kept to two digits


def test_the_packaged_chart_stands_on_its_points_and_states_its_largest_bands():
    found = json.loads(THICK.path.read_text())
    for name, points in zip(("t/R", "b/t", "nu"), THICK.points(), strict=True):
        np.testing.assert_allclose(found[name], points, rtol=1e-7)
    for name in FREEDOMS:
        worth = np.array(found["bands"][name]) * np.array(found["nu"]) ** 2
        assert (
            worth.max() == pytest.approx(found["largest_band"][name], rel=0.05)
            and worth.max() < 1e-3
        )


@pytest.mark.slow
def test_the_packaged_chart_can_be_made_anew():
    """One sample of it at the full resolution; coarser ones are compared with the chart by the
    quick tests of it.
    """
    found = json.loads(THICK.path.read_text())
    at = (4, 3, 1)
    made, _ = thick_sample(SingleHinge(found["t/R"][4], 1.0, found["b/t"][3], found["nu"][1]))
    DIGITS = 1e-5  # kept in the file
    for k, name in enumerate(FREEDOMS):
        assert np.array(found[name])[at] == pytest.approx(made.values[k], abs=DIGITS)
