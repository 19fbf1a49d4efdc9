"""Pads, links and platform arms as beams along the path they are drawn on: what a rigid-link model leaves out."""

from __future__ import annotations

import cmath

import numpy as np
import shapely

from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.linear import inverse
from flexfem.analytic.mobility import freedoms_of
from flexfem.analytic.model import AnalyticResult, analyse, hinge_compliance
from flexfem.analytic.serial import chain_compliance
from flexfem.arrays import AnyArray, Array
from flexfem.design import Stage
from flexfem.layout.bodies import centrelines, draw_sector, necks
from flexfem.layout.frames import CHAIN_TURN, stage_frames
from flexfem.layout.outline import Segment, polygon_points

POINTS = 12  # Gauss points along each line or arc: their integrands are quadratics and trigonometric functions
ARM_POINTS = 24  # along a platform arm, whose width varies


def body_compliance(stage: Stage) -> Array:
    """Compliance (3 chains, 3, 3) at the platform that pads, links and arms add to each chain, order x, y, theta."""
    return np.array([_turned(_of_chain(stage, chain), (chain - 1) * CHAIN_TURN) for chain in (1, 2, 3)])


def _of_chain(stage: Stage, chain: int) -> Array:
    lines = [segment for line in centrelines(stage, chain) for segment in line]
    total = np.sum([_strip(stage, segment) for segment in lines], axis=0)
    return np.asarray(total + _arm(stage, chain))


def _strip(stage: Stage, segment: Segment) -> Array:
    """Compliance (3, 3) at the platform of one line or arc of a strip.

    Notes
    -----
    Timoshenko's beam; along an arc of radius R and section width w Winkler's, with the neutral radius
    `r_n = w / ln((R + w/2) / (R - w/2))`, `e = R - r_n` and the energy per length
    `M^2 / (2 E A e R) + N^2 / (2 E A) - M N / (E A R) + kappa V^2 / (2 G A)`, M positive where it straightens:
    S. Timoshenko, Strength of Materials, part II, 3rd ed., 1956, section 12.
    """
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    share = (nodes + 1) / 2
    if segment.centre is None:
        at = segment.start + share * (segment.end - segment.start)
        along = np.full(POINTS, (segment.end - segment.start) / segment.length)
    else:
        spoke = (segment.start - segment.centre) * np.exp(1j * segment.turn * share)
        at, along = segment.centre + spoke, 1j * np.sign(segment.turn) * spoke / np.abs(spoke)
    density = _density(stage, stage.chain.link_width, segment)
    return _integrated(at, along, weights / 2 * segment.length, np.broadcast_to(density, (POINTS, 3, 3)))


def _density(stage: Stage, width: float, segment: Segment | None = None) -> Array:
    """Compliance per length (3, 3) of a section: rotation, along, across; moments counter-clockwise."""
    E, nu = stage.elastic
    G = E / (2 * (1 + nu))
    A = stage.thickness * width
    density = np.diag([12 / (E * A * width**2), 1 / (E * A), SHEAR_CORRECTION / (G * A)])
    if segment is not None and segment.centre is not None:
        R = abs(segment.start - segment.centre)
        e = R - width / np.log((R + width / 2) / (R - width / 2))
        density[0, 0] = 1 / (E * A * e * R)
        density[0, 1] = density[1, 0] = np.sign(segment.turn) / (E * A * R)
    return density


def _arm(stage: Stage, chain: int) -> Array:
    """Compliance (3, 3) at the platform of the way from a platform hinge's face to the hub, as wide as the metal is."""
    face = necks(stage, chain)[2].ahead(stage.hinge(chain, "platform").radius).point
    hub = stage.platform.hub_radius * face / abs(face)
    along = (hub - face) / abs(hub - face)
    metal = shapely.Polygon(polygon_points(draw_sector(stage, chain)["platform"].loop))
    nodes, weights = np.polynomial.legendre.leggauss(ARM_POINTS)
    at = face + (nodes + 1) / 2 * (hub - face)
    density = np.array([_density(stage, _width(metal, point, along)) for point in at])
    return _integrated(at, np.full(ARM_POINTS, along), weights / 2 * abs(hub - face), density)


def _width(metal: shapely.Polygon, point: complex, along: complex) -> float:
    """Width of the metal across a direction at a point inside it, mm."""
    reach = 1e5 * 1j * along
    ends = [point - reach, point + reach]
    cut = metal.intersection(shapely.LineString([(z.real, z.imag) for z in ends]))
    here = shapely.Point(point.real, point.imag)
    return float(min(shapely.get_parts(cut), key=lambda piece: piece.distance(here)).length)


def _integrated(at: AnyArray, along: AnyArray, lengths: AnyArray, density: AnyArray) -> Array:
    """Sum over points of `J density J^T` times length, J the platform's motion for rotation, stretch, slide there."""
    zero = np.zeros(len(at))
    rotation = np.stack([at.imag, -at.real, zero + 1], axis=-1)  # the centre of the platform is the origin
    stretch = np.stack([along.real, along.imag, zero], axis=-1)
    slide = np.stack([-along.imag, along.real, zero], axis=-1)
    J = np.stack([rotation, stretch, slide], axis=-1)
    return np.asarray(np.einsum("q,qia,qab,qjb->ij", lengths, J, density, J))


def _turned(compliance: Array, angle: float) -> Array:
    spin = cmath.exp(1j * angle)
    R = np.array([[spin.real, -spin.imag, 0.0], [spin.imag, spin.real, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(R @ compliance @ R.T)


def linked(stage: Stage, formula: str) -> AnalyticResult:
    """As `model.analyse` with mobility 21, and pads, links and arms as beams. Raises BadInput as it does."""
    compliance = linked_compliance(stage, formula)
    return analyse(stage, 21, formula)._replace(compliance=compliance, stiffness=inverse(compliance))


def linked_compliance(stage: Stage, formula: str) -> Array:
    """Platform compliance (3, 3) at rest with every hinge's three freedoms, and pads, links and arms as beams.

    Raises BadInput as `model.hinge_compliance` does.
    """
    hinges = hinge_compliance(stage, formula)
    chains = chain_compliance(stage_frames(stage), hinges, freedoms_of(21)) + body_compliance(stage)
    return np.asarray(inverse(np.sum(inverse(chains), axis=0)))
