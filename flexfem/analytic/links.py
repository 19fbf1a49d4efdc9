"""Pads and links as straight and curved bars along the path they are drawn on: what a rigid-link model leaves out.

The platform, which is no bar, is in `platform`.
"""

from __future__ import annotations

import cmath
from functools import cache

import numpy as np

from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.platform import motions, platform_compliance
from flexfem.arrays import Array
from flexfem.stage.bodies import centrelines
from flexfem.stage.cache import once
from flexfem.stage.designs import CHAIN_TURN, Elastic, elastic
from flexfem.stage.outline import Segment
from flexfem.stage.schema import CHAINS, Stage
from flexfem.stage.tables import Plane

POINTS = 12  # Gauss points along each line or arc: their integrands are quadratics and trigonometric functions
RADII = 32  # Gauss points across a curved bar, in the logarithm of the radius


@once
def body_compliance(stage: Stage, plane: Plane | None = None) -> Array:
    """Compliance (9, 9) that pads, links and platform add to the three chains: x, y, theta of chain 1, 2 and 3.

    Parameters
    ----------
    plane : of the bodies; None takes the stage's own.

    Raises BadInput when they cannot be drawn.
    """
    material = elastic(plane or stage.model, stage.material.youngs_modulus, stage.material.poissons_ratio)
    return bars_compliance(stage, material) + platform_compliance(stage, material)


def bars_compliance(stage: Stage, material: Elastic) -> Array:
    """What pads and links alone add, as `body_compliance`."""
    bodies = np.zeros((3, 3, 3, 3))
    for chain in CHAINS:
        bars = [_bar(stage, material, segment) for line in centrelines(stage, chain) for segment in line]
        bodies[chain - 1, :, chain - 1] = _turned(np.sum(bars, axis=0), (chain - 1) * CHAIN_TURN)
    return bodies.reshape(9, 9)


def _bar(stage: Stage, material: Elastic, segment: Segment) -> Array:
    """Compliance (3, 3) at the platform of one line or arc of a strip as wide as the link."""
    return np.asarray(np.sum(bar_density(stage, material, segment)[0], axis=0))


def bar_density(
    stage: Stage, material: Elastic, segment: Segment, first: float = 0.0, last: float = 1.0
) -> tuple[Array, Array]:
    """Compliances (q, 3, 3) at the platform of pieces of one line or arc, and where they are: shares (q,) of it.

    The strip is as wide as the link; `first` and `last` are the shares between which it is taken.
    """
    nodes, weights = _gauss(POINTS)
    share = first + (last - first) * (nodes + 1) / 2
    if segment.centre is None:
        at = segment.start + share * (segment.end - segment.start)
        along, density = np.full(POINTS, (segment.end - segment.start) / segment.length), _straight(stage, material)
    else:
        side = float(np.sign(segment.turn))
        spoke = (segment.start - segment.centre) * np.exp(1j * segment.turn * share)
        at, along = np.full(POINTS, segment.centre), 1j * side * spoke / np.abs(spoke)
        density = _curved(stage, material, abs(segment.start - segment.centre)) * np.outer([side, 1, 1], [side, 1, 1])
    J = motions(at, along)
    pieces = weights / 2 * segment.length * (last - first)
    return np.asarray(np.einsum("q,qia,ab,qjb->qij", pieces, J, density, J)), share


def _straight(stage: Stage, material: Elastic) -> Array:
    """Compliance per length (3, 3) of Timoshenko's beam: rotation, axial, shear."""
    E, nu = material
    A = stage.thickness * stage.chain.link_width
    axial = 1 / (E * A)
    return np.diag([12 * axial / stage.chain.link_width**2, axial, SHEAR_CORRECTION * 2 * (1 + nu) * axial])


def _curved(stage: Stage, material: Elastic, radius: float) -> Array:
    """Compliance per length of the middle line (3, 3) of a curved bar, for loads at the centre of curvature.

    Moment, axial force and shear of a bar counter-clockwise about its centre; a force through the centre bends it too.

    Notes
    -----
    The plane stresses are exact: those of a moment by Golovin, with
    `q = (a b / r)^2 ln(b/a)`, `sr ~ q + b^2 ln(r/b) + a^2 ln(a/r)`, `st ~ sr - 2 q + b^2 - a^2`;
    those of a force through the centre `sr ~ r + a^2 b^2/r^3 - (a^2 + b^2)/r`, `st ~ 3 r - a^2 b^2/r^3 - (a^2 + b^2)/r`
    where it pulls, and a shear stress as `sr` where it shears: S. Timoshenko, J. N. Goodier, Theory of Elasticity,
    3rd ed., 1970, sections 29 and 33. A sharp bend (b/a = 9) is 44 % softer than Winkler's bar.
    """
    (E, nu), width = material, stage.chain.link_width
    a, b = radius - width / 2, radius + width / 2
    nodes, weights = _gauss(RADII)
    r = a * (b / a) ** ((nodes + 1) / 2)
    dr = weights / 2 * np.log(b / a) * r
    q = (a * b / r) ** 2 * np.log(b / a)
    bent = q + b**2 * np.log(r / b) + a**2 * np.log(a / r)
    pulled = r + (a * b) ** 2 / r**3 - (a**2 + b**2) / r
    moment = np.stack([bent, bent - 2 * q + b**2 - a**2])
    pull = np.stack([pulled, 3 * r - (a * b) ** 2 / r**3 - (a**2 + b**2) / r])
    stress = np.stack([moment / np.sum(moment[1] * r * dr), pull / np.sum(pull[1] * dr)])
    hooke = np.array([[1, -nu], [-nu, 1]])
    density = np.zeros((3, 3))
    density[:2, :2] = np.einsum("ian,ab,jbn,n->ij", stress, hooke, stress, r * dr)
    density[2, 2] = 2 * (1 + nu) * np.sum((pulled / np.sum(pulled * dr)) ** 2 * r * dr)
    return density / (E * stage.thickness * radius)


_gauss = cache(np.polynomial.legendre.leggauss)


def _turned(compliance: Array, angle: float) -> Array:
    spin = cmath.exp(1j * angle)
    R = np.array([[spin.real, -spin.imag, 0.0], [spin.imag, spin.real, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(R @ compliance @ R.T)
