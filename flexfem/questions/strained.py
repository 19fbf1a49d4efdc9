"""Stress at the surfaces of necks that a motion of the platform repeats: its amplitude, its mean, and their life."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq

from flexfem.analytic.model import AnalyticResult
from flexfem.arrays import Array, Index
from flexfem.hinges.strength import (
    Basquin,
    Wrench,
    amplitude_at,
    counted,
    cycles_at,
    equivalent,
    stress_raised,
    surface_stress,
)
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.drives import contacts
from flexfem.mechanism.stage import Stage

if TYPE_CHECKING:
    from flexfem.fem.response import Response

LARGEST_FACTOR = 1e9  # by which an amplitude is multiplied in search of a life


class Oscillation(NamedTuple):
    """What the platform repeats: amplitude and mean pose (3,), mm, mm, rad; whether the mean grows with it."""

    amplitude: Array
    mean: Array
    proportional: bool


def scaled(motion: Array, mean: Array | None, ratio: float) -> Oscillation:
    """A motion of an amplitude (3,) about a mean (3,), or with a ratio of its least to its greatest displacement."""
    if mean is None:
        return Oscillation(motion, motion * (1.0 + ratio) / (1.0 - ratio), True)
    return Oscillation(motion, mean, not mean.any())


class Repeated(NamedTuple):
    """What is asked of a motion: the wanted life, cycles, with a notch sensitivity from 0 to 1."""

    motion: Oscillation
    wanted: float
    sensitivity: float = 1.0


class Strained(NamedTuple):
    """Points at the necks: neck (p,), from 0 to 8, chain by chain; amplitude and mean (..., p) of the stress, MPa.

    counted : (..., p), part of the stress that counts for fatigue.   Leading axes are designs.
    Stress is von Mises', the mean with the sign of the stress along the surface. The surface of a notch is free, so
    that the stress there is uniaxial, and the highest principal stress in plane stress.
    """

    neck: Index
    amplitude: Array
    mean: Array
    counted: Array

    def equivalent(self, walker: float | Array, factor: float = 1.0, proportional: bool = True) -> Array:
        """Fully reversed amplitude (..., p) of the same life by Walker's exponent, or one a design (..., 1).

        factor : of the amplitude, and of the mean too where it is proportional.
        """
        mean = self.mean * factor if proportional else self.mean
        return self.counted * equivalent(factor * self.amplitude, mean, walker)

    def peak(self, factor: float = 1.0, proportional: bool = True) -> Array:
        """Largest magnitude of the stress (..., p), with the amplitude multiplied, the mean too or not."""
        return np.asarray(np.abs(self.mean) * (factor if proportional else 1.0) + factor * self.amplitude)


def by_wrenches(designs: Designs, wrench: Wrench, of: Repeated) -> Strained:
    """Both sides of every neck of n designs, by what the necks carry (n, 3, 3, 3)."""
    bending, along = surface_stress(wrench, designs.neck, designs.thickness, stress_raised(designs))
    sides = np.stack([along + bending, along - bending], axis=3).reshape(len(along), 18, 3)
    part = np.repeat(counted(designs.neck / designs.radius, of.sensitivity).reshape(len(along), 9), 2, axis=1)
    return Strained(np.repeat(np.arange(9), 2), np.abs(sides @ of.motion.amplitude), sides @ of.motion.mean, part)


def by_model(stage: Stage, result: AnalyticResult, of: Repeated) -> Strained:
    """Both sides of every neck, by the analytic model."""
    found = by_wrenches(lower(stage), Wrench(*(part[None] for part in result.wrench)), of)
    return Strained(found.neck, *(part[0] for part in found[1:]))


def by_elements(stage: Stage, response: Response, of: Repeated) -> Strained:
    """The nodes in every notch, by finite elements in the plane."""
    from flexfem.fem.elements import von_mises
    from flexfem.fem.fields import notch_fields
    from flexfem.fem.structure import out_of_plane_ratio_of

    pull, stiffness, design = out_of_plane_ratio_of(stage), np.linalg.inv(response.compliance), lower(stage)
    part = counted(design.neck[0] / design.radius[0], of.sensitivity)
    loads = np.array([of.motion.amplitude, of.motion.mean]) @ stiffness.T
    parts = []
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        amplitude, mean = von_mises(stress, pull)
        sign = np.sign(np.trace(stress[1], axis1=1, axis2=2))
        place = np.full(len(mean), 3 * chain + hinge)
        parts.append(Strained(place, amplitude, sign * mean, np.full(len(mean), part[chain, hinge])))
    return Strained(*(np.concatenate(column) for column in zip(*parts, strict=True)))


class Lives(NamedTuple):
    """Of n designs: cycles (n,) at the amplitude, the size (n, 3) of that for the wanted life, mm, mm, rad, and safety
    (n,), yield strength over the largest stress at a neck. moved : (3,), whether the amplitude has that direction."""

    cycles: Array
    largest: Array
    safety: Array
    moved: tuple[bool, ...]


def lives(of: Strained, fatigue: Array, yield_strength: Array, asked: Repeated) -> Lives:
    """Lives of n designs whose mean grows with the amplitude, by their constants (n, 3) as of `Designs.fatigue`."""
    coefficient, exponent, walker = fatigue.T
    highest = np.max(of.equivalent(walker[:, None]), axis=-1)
    factor = amplitude_at(asked.wanted, coefficient, exponent) / highest
    return Lives(
        cycles_at(highest, coefficient, exponent),
        factor[:, None] * np.abs(asked.motion.amplitude),
        yield_strength / np.max(of.peak(), axis=-1),
        tuple((asked.motion.amplitude != 0).tolist()),
    )


def of_preloads(stage: Stage) -> list[str]:
    """Of preloads that stress the necks, which those of pairs do not: that no life counts them."""
    if all(len(contacts(stage, 1, k)) == 2 or not one.preload for k, one in enumerate(stage.actuator)):
        return []
    return ["the mean stress by preloads of single stacks is not in this life"]


def factor_at(of: Strained, law: Basquin, cycles: float, proportional: bool) -> float:
    """By what the amplitude may be multiplied for a life of `cycles` at the first neck; inf where none is pulled."""
    wanted = float(law.amplitude(cycles))
    if proportional:
        highest = float(np.max(of.equivalent(law.walker)))
        return wanted / highest if highest > 0 else float("inf")

    def beyond(factor: float) -> float:
        return float(np.max(of.equivalent(law.walker, factor, False))) - wanted

    end = 1.0
    while beyond(end) < 0 and end < LARGEST_FACTOR:
        end *= 2.0
    return float(brentq(beyond, 0.0, end, xtol=1e-14, rtol=1e-13)) if end < LARGEST_FACTOR else float("inf")
