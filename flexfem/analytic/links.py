"""Pads and links as straight and curved bars along the path they are drawn on: what a rigid-link model leaves out.

The platform, which is no bar, is in `platform`.
"""

from __future__ import annotations

import cmath

import numpy as np

from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.inverse import inverse
from flexfem.analytic.mobility import freedoms_of
from flexfem.analytic.model import AnalyticResult, analyse, hinge_compliance
from flexfem.analytic.platform import motions, platform_compliance
from flexfem.analytic.serial import chain_compliance, chain_wrenches
from flexfem.arrays import Array
from flexfem.stage.bodies import centrelines
from flexfem.stage.frames import CHAIN_TURN, stage_frames
from flexfem.stage.outline import Segment
from flexfem.stage.schema import CHAINS, Stage

POINTS = 12  # Gauss points along each line or arc: their integrands are quadratics and trigonometric functions
RADII = 32  # Gauss points across a curved bar, in the logarithm of the radius


def body_compliance(stage: Stage) -> Array:
    """Compliance (9, 9) that pads, links and platform add to the three chains: x, y, theta of chain 1, 2 and 3."""
    chain, links = np.arange(3), np.zeros((3, 3, 3, 3))
    links[chain, :, chain] = link_compliance(stage)
    return links.reshape(9, 9) + platform_compliance(stage)


def link_compliance(stage: Stage) -> Array:
    """Compliance (3 chains, 3, 3) at the platform that pads and links add to each chain, order x, y, theta."""
    return np.array([_turned(_of_chain(stage, chain), (chain - 1) * CHAIN_TURN) for chain in CHAINS])


def _of_chain(stage: Stage, chain: int) -> Array:
    bars = [_bar(stage, segment) for line in centrelines(stage, chain) for segment in line]
    return np.asarray(np.sum(bars, axis=0))


def _bar(stage: Stage, segment: Segment) -> Array:
    """Compliance (3, 3) at the platform of one line or arc of a strip as wide as the link."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    share = (nodes + 1) / 2
    if segment.centre is None:
        at = segment.start + share * (segment.end - segment.start)
        along, density = np.full(POINTS, (segment.end - segment.start) / segment.length), _straight(stage)
    else:
        side = float(np.sign(segment.turn))
        spoke = (segment.start - segment.centre) * np.exp(1j * segment.turn * share)
        at, along = np.full(POINTS, segment.centre), 1j * side * spoke / np.abs(spoke)
        density = _curved(stage, abs(segment.start - segment.centre)) * np.outer([side, 1, 1], [side, 1, 1])
    J = motions(at, along)
    return np.asarray(np.einsum("q,qia,ab,qjb->ij", weights / 2 * segment.length, J, density, J))


def _straight(stage: Stage) -> Array:
    """Compliance per length (3, 3) of Timoshenko's beam: rotation, stretch, slide."""
    E, nu = stage.elastic
    A = stage.thickness * stage.chain.link_width
    stretch = 1 / (E * A)
    return np.diag([12 * stretch / stage.chain.link_width**2, stretch, SHEAR_CORRECTION * 2 * (1 + nu) * stretch])


def _curved(stage: Stage, radius: float) -> Array:
    """Compliance per length of the middle line (3, 3) of a curved bar, for loads at the centre of curvature.

    Moment, pull and shear of the bar counter-clockwise about its centre; a force through the centre bends it too.

    Notes
    -----
    The plane stresses are exact: those of a moment by Golovin, with
    `q = (a b / r)^2 ln(b/a)`, `sr ~ q + b^2 ln(r/b) + a^2 ln(a/r)`, `st ~ sr - 2 q + b^2 - a^2`;
    those of a force through the centre `sr ~ r + a^2 b^2/r^3 - (a^2 + b^2)/r`, `st ~ 3 r - a^2 b^2/r^3 - (a^2 + b^2)/r`
    where it pulls, and a shear stress as `sr` where it shears: S. Timoshenko, J. N. Goodier, Theory of Elasticity,
    3rd ed., 1970, sections 29 and 33. A sharp bend (b/a = 9) is 44 % softer than Winkler's bar.
    """
    (E, nu), width = stage.elastic, stage.chain.link_width
    a, b = radius - width / 2, radius + width / 2
    nodes, weights = np.polynomial.legendre.leggauss(RADII)
    r = a * (b / a) ** ((nodes + 1) / 2)
    dr = weights / 2 * np.log(b / a) * r
    q = (a * b / r) ** 2 * np.log(b / a)
    bent = q + b**2 * np.log(r / b) + a**2 * np.log(a / r)
    pulled = r + (a * b) ** 2 / r**3 - (a**2 + b**2) / r
    moment = np.stack([bent, bent - 2 * q + b**2 - a**2])
    pull = np.stack([pulled, 3 * r - (a * b) ** 2 / r**3 - (a**2 + b**2) / r])
    stress = np.stack([moment / np.sum(moment[1] * r * dr), pull / np.sum(pull[1] * dr)])
    material = np.array([[1, -nu], [-nu, 1]])
    density = np.zeros((3, 3))
    density[:2, :2] = np.einsum("ian,ab,jbn,n->ij", stress, material, stress, r * dr)
    density[2, 2] = 2 * (1 + nu) * np.sum((pulled / np.sum(pulled * dr)) ** 2 * r * dr)
    return density / (E * stage.thickness * radius)


def _turned(compliance: Array, angle: float) -> Array:
    spin = cmath.exp(1j * angle)
    R = np.array([[spin.real, -spin.imag, 0.0], [spin.imag, spin.real, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(R @ compliance @ R.T)


def linked(stage: Stage, formula: str) -> AnalyticResult:
    """As `model.analyse` with mobility 21, and elastic pads, links and platform. Raises BadInput as it does."""
    compliance = linked_compliance(stage, formula)
    return analyse(stage, 21, formula)._replace(compliance=compliance, stiffness=inverse(compliance))


def linked_compliance(stage: Stage, formula: str) -> Array:
    """Platform compliance (3, 3) at rest with every hinge's three freedoms, and elastic pads, links and platform.

    Raises BadInput as `model.hinge_compliance` does.
    """
    chains = chain_compliance(stage_frames(stage), hinge_compliance(stage, formula), freedoms_of(21))
    return inverse(np.sum(chain_wrenches(chains, body_compliance(stage)), axis=0))
