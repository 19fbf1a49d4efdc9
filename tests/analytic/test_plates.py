"""The analytic model of plate mechanisms against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.finite import displaced
from flexfem.analytic.network import with_springs
from flexfem.analytic.plates import (
    body_moments,
    hinge_inertia,
    modes,
    respond,
    thermal_response,
    weight_response,
)
from flexfem.mechanism.layout import Body, Joint, Layout, LinearActuator, Patch, PayloadMass
from flexfem.mechanism.outlines import polyline
from flexfem.mechanism.profiles import Circular, Leaf
from flexfem.mechanism.tabulated import Tabulated
from flexfem.refused import ComputationFailed

from ..tolerances import DENSE

E = 70e3
NU = 0.3
B = 8.0
RHO = 2.7e-9
SPAN = 40.0
T = 0.8
EI = E * B * T**3 / 12
EA = E * B * T
SHEAR = 1.2 * SPAN * 2 * (1 + NU) / EA  # transverse compliance of the leaf by shear
LEAF = Leaf(T, SPAN)
SMALL_TURNS = 5e-3  # of a deflection of 0.9 mm over 40 mm: the square of its slope, 0.035
SLENDER = 2e-3  # of a mass: shear of a leaf 300 times as long as thick, and the rule of integration


def box(name, low, high, **more):
    a = low.real + 1j * high.imag
    b = high.real + 1j * low.imag
    return Body(name, tuple(polyline(low, b, high, a, low)), **more)


def layout(bodies, hinges, points, **more):
    return Layout(tuple(bodies), tuple(hinges), B, E, NU, RHO, 300.0, points, **more)


def parallelogram(**more):
    """Two leaves up from the ground at x = -15 and 25 to a stage, the output where forces cause no
    rotation.
    """
    bodies = [box("ground", -30 - 10j, 40 + 0j, fixed=True), box("stage", -20 + 40j, 30 + 52j)]
    hinges = [Joint(f"leaf {x}", (0, 1), x + 20j, np.pi / 2, LEAF, T) for x in (-15, 25)]
    return layout(bodies, hinges, (("output", Patch(1, 5 + 20j)),), **more)


def test_cantilever():
    """Along 30 degrees, a force and a moment at the end of the leaf; the moments at root and end."""
    d = np.exp(1j * np.pi / 6)
    bodies = [box("wall", -9 - 9j, 0j, fixed=True), box("tip", SPAN * d - 5, SPAN * d + 5 + 9j)]
    found = respond(
        layout(
            bodies,
            [Joint("leaf", (0, 1), SPAN / 2 * d, np.pi / 6, LEAF, T)],
            (("output", Patch(1, SPAN * d)),),
        )
    )
    R = np.array([[d.real, -d.imag, 0], [d.imag, d.real, 0], [0, 0, 1]])
    local = R.T @ found.compliance @ R
    bending = SPAN**3 / (3 * EI) + SHEAR
    slope = SPAN**2 / (2 * EI)
    assert local == pytest.approx(
        np.array([[SPAN / EA, 0, 0], [0, bending, slope], [0, slope, SPAN / EI]]),
        rel=DENSE,
        abs=1e-15,
    )
    N, V, M = found.wrenches[0] @ R  # by the local forces and the moment at the end
    assert np.array([N, V]) == pytest.approx(np.eye(3)[:2], abs=DENSE)
    root = M + SPAN / 2 * V
    end = M - SPAN / 2 * V
    assert (*root, *end) == pytest.approx((0, SPAN, 1, 0, 0, 1), abs=SPAN * DENSE)


def test_parallelogram_and_its_frequency():
    """24 E I / L^3 and shear; with a payload and a drive from ground to stage, `omega^2 = K / m`."""
    K = 2 / (SPAN**3 / (12 * EI) + SHEAR)
    found = np.linalg.inv(respond(parallelogram()).compliance)
    assert found[0, 0] == pytest.approx(K, rel=DENSE)
    assert found[1, 1] == pytest.approx(2 * EA / SPAN, rel=DENSE)
    assert found[2, 2] == pytest.approx(2 * (EA / SPAN * 20**2 + EI / SPAN), rel=DENSE)
    drive = LinearActuator(
        "drive", (Patch(0, -20 + 20j), Patch(1, 5 + 20j)), 1 + 0j, 3.0, 0.02, 0.06, 4e-6
    )
    driven = parallelogram(
        actuators=(drive,), payloads=(PayloadMass(Patch(1, 10 + 46j), 5e-5, 0.0),)
    )
    mass = RHO * B * (50 * 12 + 2 * SPAN * T * 13 / 35) + 5e-5 + 2e-6
    C = respond(driven).compliance
    at_rest = modes(driven).frequencies
    slow = (at_rest[0], modes(driven, engaged=True).frequencies[0])
    assert C[3, :3] == pytest.approx(C[0, :3], rel=DENSE)
    assert slow == pytest.approx(
        (np.sqrt(K / mass), np.sqrt((K + 3) / mass)), rel=1e-3
    )  # it turns a little
    assert len(at_rest) == 3
    assert with_springs(C, np.array([3.0]))[0, 0] == pytest.approx(1 / (K + 3), rel=DENSE)
    mass += (
        RHO * B * 2 * SPAN * T * (1 / 2 - 13 / 35)
    )  # of the weight half of a leaf is carried at either end
    weight = weight_response(driven, [(9810.0, 0.0)])[0][:, 0]
    assert weight[0] == pytest.approx(9810 * mass / K, rel=DENSE)
    above = RHO * B * (50 * 12 * 26 + 2 * SPAN * T / 2 * 10) + 5e-5 * 26  # the output
    assert weight[2] == pytest.approx(-9810 * above / found[2, 2], rel=DENSE)


def test_the_mass_of_a_leaf_is_that_of_a_beam_element_of_hermite():
    """`m / 420 [156, 54, 22 L, 4 L^2]` across, `m / 3` and `m / 6` along; a rigid motion has the
    whole mass.
    """
    length = 60.0
    depth = 0.2
    plate = parallelogram()
    leaf = Joint(
        "leaf", (0, 1), 30 + 0j, 0.0, Leaf(depth, length, 0.0), 0.0
    )  # from the origin along x
    M = hinge_inertia(plate, leaf)
    m = RHO * B * length * depth
    near = np.eye(6)[1]
    far = np.eye(6)[4]  # the end at the origin, and the far one, shifted across
    turned = np.array([0.0, 0, 0, 0, -length, 1])  # the far end about its own place
    assert near @ M @ near == pytest.approx(m * 156 / 420, rel=SLENDER)
    assert near @ M @ far == pytest.approx(m * 54 / 420, rel=SLENDER)
    assert far @ M @ turned == pytest.approx(-m * 22 * length / 420, rel=SLENDER)
    assert turned @ M @ turned == pytest.approx(m * 4 * length**2 / 420, rel=SLENDER)
    assert M[0, 0] == pytest.approx(m / 3, rel=SLENDER) and M[0, 3] == pytest.approx(
        m / 6, rel=SLENDER
    )
    both = np.tile(np.eye(3), 2)
    rigid = both @ M @ both.T
    polar = m * (length**2 / 3 + depth**2 / 12)  # about the near end
    expected = np.array([[m, 0, 0], [0, m, m * 30], [0, m * 30, polar]])
    np.testing.assert_allclose(rigid, expected, rtol=DENSE, atol=DENSE * polar)


def test_cross_spring_pivot():
    """8 (1 - 3 a + 3 a^2) E I / L, the leaves crossing at a = 0.3 of their length from the moving
    body.
    """
    a = 0.3
    Phi = 12 * EI / SPAN**3 * SHEAR
    bodies = [box("ground", -60 - 60j, 60 - 40j, fixed=True), box("rotor", -20 + 20j, 20 + 30j)]
    hinges = [
        Joint(name, (0, 1), (a - 0.5) * SPAN * d, np.angle(d), LEAF, T)
        for name, d in (("1", np.exp(1j)), ("2", np.exp(1.9j)))
    ]
    found = np.linalg.inv(respond(layout(bodies, hinges, (("output", Patch(1, 0j)),))).compliance)
    assert found[2, 2] == pytest.approx(
        2 * EI / SPAN * (1 + 12 * (0.5 - a) ** 2 / (1 + Phi)), rel=DENSE
    )
    assert found[2, 2] == pytest.approx(8 * (1 - 3 * a + 3 * a * a) * EI / SPAN, rel=1e-3)


def lever():
    """A drive at 10 mm turns a lever; a link takes the motion at 45 mm to a stage on a
    parallelogram.
    """
    notch = Circular(0.3, 2.0)
    bodies = [
        box("ground", -30 - 40j, 90 - 20j, fixed=True),
        box("lever", -5 - 3j, 50 + 3j),
        box("link", 43 + 6j, 47 + 40j),
        box("stage", 20 + 40j, 70 + 52j),
    ]
    hinges = [
        Joint("pivot", (0, 1), -5j, np.pi / 2, notch, 10),
        Joint("root", (1, 2), 45 + 4j, np.pi / 2, notch, 10),
        Joint("tip", (3, 2), 45 + 38j, -np.pi / 2, notch, 10),
        *(Joint(f"leaf {y}", (3, 0), 90 + y * 1j, 0.0, Leaf(0.3, 40.0), 1.0) for y in (42, 50)),
    ]
    drive = LinearActuator("drive", (Patch(0, 10 - 20j), Patch(1, 10 - 3j)), 1j, 1e4, 0.01, 100.0)
    return layout(bodies, hinges, (("output", Patch(3, 45 + 46j)),), actuators=(drive,))


def test_lever_and_its_finite_motion():
    """The ratio of arms, less by axial compliance; finite motion begins as the linear one and has
    its tangent.
    """
    C = respond(lever()).compliance
    F = np.array([[2.0, 5.0, 40.0, 60.0]])
    step = 1e-3 * np.eye(4)
    assert np.abs(C - C.T).max() < DENSE * np.abs(C).max()
    assert C[1, 3] / C[3, 3] == pytest.approx(4.5, rel=0.03)
    assert displaced(lever(), 1e-7 * F).motions[0] == pytest.approx(1e-7 * C @ F[0], rel=1e-3)
    tangent = displaced(lever(), F).compliance[0]
    ahead, back = (
        displaced(lever(), np.concatenate([F, F + sign * step])).motions[1:] for sign in (1, -1)
    )
    assert (ahead - back) / 2e-3 == pytest.approx(
        tangent, rel=1e-5, abs=1e-7 * np.abs(tangent).max()
    )


def test_elastica():
    """Bisshopp and Drucker 1945: the end of a cantilever under P L^2 / (E I) = 1, 2, 5, 10; a
    moment makes an arc.
    """
    bodies = [box("wall", -9 - 9j, 0j, fixed=True), box("tip", 100 + 0j, 109 + 9j)]
    thin = layout(
        bodies,
        [Joint("leaf", (0, 1), 50, 0.0, Leaf(0.1, 100.0), 1.0)],
        (("end", Patch(1, 100 + 0j)),),
    )
    moment = E * B * 0.1**3 / 12 / 100
    found = displaced(thin, np.outer([1, 2, 5, 10], [0, moment / 100, 0]))
    assert found.motions[:, 1] == pytest.approx([30.172, 49.346, 71.379, 81.061], abs=4e-3)
    assert found.motions[:, 0] == pytest.approx([-5.643, -16.064, -38.763, -55.500], abs=4e-3)
    assert found.stable.all()
    arc = displaced(thin, np.array([[0, 0, np.pi * moment]])).motions[0]
    assert arc == pytest.approx([-100, 200 / np.pi, np.pi], rel=1e-4)


def test_beams_off_the_axis_begin_with_the_compliance_of_the_network():
    """Notches on one side, a bowed table and its mirror image, in a loop that strains them all."""
    bowed = Tabulated(((0, 0.9, 0.3), (9, 0.7, -0.3), (31, 0.1, 0.5), (40, 1.0, 0.2)), smooth=True)
    bodies = [box("ground", -30 - 10j, 40 + 0j, fixed=True), box("stage", -20 + 40j, 30 + 52j)]
    profiles = (bowed, bowed.mirrored, Circular(0.5, 20.0, side="left"))
    hinges = [
        Joint(f"hinge {x}", (0, 1), x + 20j, np.pi / 2, profile, T)
        for x, profile in zip((-15, 5, 25), profiles, strict=True)
    ]
    plate = layout(bodies, hinges, (("output", Patch(1, 5 + 60j)),))
    C = respond(plate).compliance
    small = np.diag([1e-3, 1e-3, 1e-2])
    assert displaced(plate, small).motions == pytest.approx(small @ C, rel=1e-4, abs=1e-12)
    assert abs(C[0, 1]) > 1e-3 * np.sqrt(C[0, 0] * C[1, 1])


def test_an_eccentric_column_bows_by_the_secant_formula():
    """A cantilever 40 mm long, 0.3 mm to the left of the force P that pushes it: e (sec(L sqrt(P /
    EI)) - 1).
    """
    e = 0.3
    bar = Tabulated(tuple((x, T / 2 + e, T / 2 - e) for x in (0, 7, 40)))
    bodies = [box("wall", -9 - 9j, 0j, fixed=True), box("tip", 40 + 0j, 49 + 9j)]
    plate = layout(
        bodies, [Joint("bar", (0, 1), 20 + 0j, 0.0, bar, 2.2)], (("end", Patch(1, 40 + 0j)),)
    )
    share = np.array([0.1, 0.4, 0.7])
    push = share * np.pi**2 * EI / (4 * SPAN**2)
    found = displaced(plate, -push[:, None] * [1.0, 0, 0])
    expected = e * (1 / np.cos(np.pi / 2 * np.sqrt(share)) - 1)
    assert -found.motions[:, 1] == pytest.approx(expected, rel=SMALL_TURNS)


def test_parallelogram_moves_on_a_curve_and_stiffens():
    """The beam constraint model (Awtar, Slocum, Sevincer 2007): -0.6 u^2 / L, and 24 + 1.2 p for a
    pull p E I / L^2.
    """
    found = displaced(
        parallelogram(),
        np.array([[9.0, 0, 0], [0, 2 * EI / SPAN**2, 0], [0, -2 * EI / SPAN**2, 0]]),
    )
    assert found.motions[0, 0] == pytest.approx(9.0 / (24 * EI / SPAN**3), rel=0.01)
    assert found.motions[0, 1] == pytest.approx(-0.6 * found.motions[0, 0] ** 2 / SPAN, rel=5e-3)
    pulled = 1 / found.compliance[1:, 0, 0] / (EI / SPAN**3)
    assert pulled == pytest.approx([26.4, 21.6], rel=0.01)


def test_a_beam_between_walls_expands():
    """`N = -(alpha - alpha_g) T D / (2 c)`, D between the walls; a stage off the middle moves
    towards the middle.
    """
    bodies = [
        box("left", -70 - 5j, -50 + 5j, fixed=True),
        box("stage", -10 - 5j, 30 + 5j),
        box("right", 50 - 5j, 70 + 5j, fixed=True),
    ]
    hinges = [
        Joint("long", (0, 1), -30, 0.0, LEAF, T),
        Joint("short", (1, 2), 40, 0.0, Leaf(T, 20.0), T),
    ]
    strip = layout(
        bodies, hinges, (("output", Patch(1, 12 + 0j)), ("spot", Patch(1, 20 + 0j, 1.0)))
    )
    motions, wrenches = thermal_response(strip, 23e-6, 11e-6)
    N = -12e-6 * 100 / (60 / EA)
    assert wrenches[:, 0, 0] == pytest.approx([N, N], rel=DENSE)
    centre = (
        11e-6 * 10 + 12e-6 * 60 + N * 40 / EA
    )  # of the stage: with the ground, expanded, compressed
    assert motions[:, 0] == pytest.approx(
        [centre, 0, 0, centre + 23e-6 * 10, 0, 0], rel=DENSE, abs=1e-12
    )
    motions, wrenches = thermal_response(
        strip, 23e-6, 23e-6
    )  # free: a bar bows by alpha y x^2 / 2 by 1 K / mm along y
    assert wrenches == pytest.approx(0.0, abs=1e-9)
    mean = (
        23e-6 / 2 * (10**2 / 12 - 40**2 / 12 - 10**2),
        -23e-6 * 10,
    )  # over the stage, and rotation
    spot = 0, -23e-6 / 2 * 20**2, -23e-6 * 20
    assert motions[:, 2] == pytest.approx(
        [0, mean[0] + 2 * mean[1], mean[1], *spot], rel=DENSE, abs=1e-12
    )


def test_area_of_a_cut_body():
    """A bar drawn to the centre of a circular hinge: less the box, more half of the notch, and a
    hole.
    """
    hole = tuple(polyline(2j, 4 + 2j, 4 + 0j, 0j, 2j))
    bodies = [
        box("ground", -30 - 3j, -8 + 3j, fixed=True),
        box("bar", -8 - 3j, 10 + 3j, holes=(hole,)),
    ]
    found = body_moments(
        layout(bodies, [Joint("notch", (0, 1), -8, 0.0, Circular(1.0, 2.0), 6.0)], ()), 1
    )
    half_notch = 2 * 1.0 + 2 * (2 * 2 - np.pi)
    assert found[0].real == pytest.approx(18 * 6 - 2 * 6 + half_notch - 8, rel=1e-7)
    assert found[1].imag == pytest.approx(-8.0, rel=DENSE)


def test_a_body_that_is_not_held():
    bodies = [
        box("ground", -9 - 9j, 0j, fixed=True),
        box("stage", 0j, 9 + 9j),
        box("mass", 9 + 0j, 19 + 9j),
    ]
    hinges = [Joint("one", (1, 2), 9 + 4j, 0.0, LEAF, T)]
    with pytest.raises(ComputationFailed, match="'stage', 'mass' can move"):
        respond(layout(bodies, hinges, ()))
