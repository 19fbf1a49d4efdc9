"""Boundary elements: polynomial fields to round-off, rings in closed form, and copies as one."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from flexfem.mechanism.outlines import Segment, polyline
from flexfem.paper.links import Boundary, displacements, divided

from ..tolerances import DENSE

NU = 0.29
# of arcs turning by 0.1 rad in one element: 0.1^2 / 8, and its influence on the area within
CHORDS = 2e-3
CORNERS = (0.3 - 0.2j, 3.1 + 0.1j, 3.6 + 1.3j, 1.2 + 2.2j, 0.1 + 1.1j)


def block() -> Boundary:
    return divided(polyline(*CORNERS, CORNERS[0]), lambda z: 0.2 + 0.1 * abs(z), 1.0)


def normals(boundary: Boundary) -> np.ndarray:
    side = boundary.end - boundary.start
    return np.repeat(-1j * side / np.abs(side), 3)


def circle(radius: float, share: float, outwards: int = 1) -> list[Segment]:
    """Part of a circle about the origin, counter-clockwise or (-1) the other way."""
    ends = radius * np.exp(2j * np.pi * share * np.arange(4) / 3)[::outwards]
    return [Segment(complex(a), complex(b), 0j) for a, b in pairwise(ends)]


def ring(hub: float, rim: float, copies: int = 1) -> tuple[Boundary, np.ndarray, np.ndarray]:
    """A third or all of a ring held on its hub: boundary, nodes on the rim, nodes on the hub."""
    boundary = divided([*circle(rim, 1 / copies), *circle(hub, 1 / copies, -1)], lambda _: rim, 0.1)
    return (
        boundary,
        np.abs(boundary.nodes) > (hub + rim) / 2,
        np.abs(boundary.nodes) < (hub + rim) / 2,
    )


@pytest.mark.parametrize("field", ["pull along x", "shear", "bending"])
def test_a_free_block_takes_the_displacements_of_polynomial_stresses(field):
    """Shear modulus one, E = 2 (1 + nu); stresses sxx = 1, sxy = 1, and sxx = y."""
    boundary = block()
    E = 2 * (1 + NU)
    z = boundary.nodes
    n = normals(boundary)
    x = z.real
    y = z.imag
    moved, traction = {
        "pull along x": ((x - 1j * NU * y) / E, n.real + 0j),
        "shear": (1j * x, n.imag + 1j * n.real),
        "bending": ((x * y - 0.5j * (x**2 + NU * y**2)) / E, y * n.real + 0j),
    }[field]
    found = displacements(boundary, traction[:, None], np.zeros(len(z), dtype=bool), NU)[0, :, 0]
    rest = found - moved
    turn = ((rest[0] - rest[-1]) / (z[0] - z[-1])).imag
    assert np.max(np.abs(rest - rest[0] - 1j * turn * (z - z[0]))) < DENSE * np.max(np.abs(moved))
    mean = np.sum(boundary.weights * found)
    assert abs(mean) < DENSE * np.sum(boundary.weights * np.abs(moved))


@pytest.mark.parametrize("copies", [1, 3, 4])
def test_a_ring_on_its_hub_twists_and_widens_in_closed_form(copies):
    hub = 2.3
    rim = 6.1
    boundary, outer, held = ring(hub, rim, copies)
    z = boundary.nodes
    spoke = z / np.abs(z)
    loads = np.where(outer[:, None], np.stack([1j * spoke, spoke], axis=-1), 0.0)
    found = sum(displacements(boundary, loads, held, NU, copies))
    twisted = rim**2 * (1 / hub**2 - 1 / rim**2) * rim / 2  # shear stress (rim/r)^2
    kappa = (3 - NU) / (1 + NU)
    widened = (
        (rim - hub**2 / rim) * (kappa - 1) / 4 / (1 + (kappa - 1) / 2 * (hub / rim) ** 2)
    )  # Lame
    np.testing.assert_allclose(found[outer, 0] / (1j * spoke[outer]), twisted, rtol=CHORDS)
    np.testing.assert_allclose(found[outer, 1] / spoke[outer], widened, rtol=CHORDS)


def test_three_copies_are_the_whole():
    """A load on one third of a ring, in each third's own frame."""
    hub = 1.7
    rim = 4.9
    third, outer, held = ring(hub, rim, 3)
    spins = np.exp(2j * np.pi * np.arange(3) / 3)
    whole = Boundary(*(np.concatenate([spin * ends for spin in spins]) for ends in third))
    load = np.where(outer, np.exp(third.nodes), 0.0)[:, None]
    rest = np.zeros((2 * len(load), 1))
    expected = displacements(whole, np.concatenate([load, rest]), np.tile(held, 3), NU)[
        0, :, 0
    ].reshape(3, -1)
    found = displacements(third, load, held, NU, 3)[:, :, 0]
    np.testing.assert_allclose(
        found, expected / spins[:, None], atol=DENSE * np.max(np.abs(expected))
    )
