"""Stress at the surfaces of necks that a motion of the platform repeats: its amplitude, its mean, and their life."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from flexfem.analytic.chains import surface_stress
from flexfem.analytic.fatigue import Basquin, equivalent
from flexfem.analytic.model import AnalyticResult
from flexfem.arrays import Array, Index
from flexfem.fem.cyclic_fields import notch_fields
from flexfem.fem.plane_stress import von_mises
from flexfem.fem.response import out_of_plane_ratio_of
from flexfem.stage.designs import lower
from flexfem.stage.schema import Stage
from flexfem.verify.protocol import Solved

LARGEST_FACTOR = 1e9  # by which an amplitude is multiplied in search of a life


class Oscillation(NamedTuple):
    """What the platform repeats: amplitude and mean pose (3,), mm, mm, rad; whether the mean grows with it."""

    amplitude: Array
    mean: Array
    proportional: bool


class Strained(NamedTuple):
    """Points at the necks: neck (p,), from 0 to 8, chain by chain; amplitude and mean (p,) of the stress, MPa.

    Stress is von Mises', the mean with the sign of the stress along the surface. The surface of a notch is free, so
    that the stress there is uniaxial, and the highest principal stress in plane stress.
    """

    neck: Index
    amplitude: Array
    mean: Array

    def equivalent(self, law: Basquin, factor: float = 1.0, proportional: bool = True) -> Array:
        """Fully reversed amplitude (p,) of the same life, with the amplitude multiplied, the mean too or not."""
        mean = self.mean * factor if proportional else self.mean
        return equivalent(factor * self.amplitude, mean, law.walker)

    def peak(self, factor: float = 1.0, proportional: bool = True) -> Array:
        """Largest magnitude of the stress (p,), with the amplitude multiplied, the mean too or not."""
        return np.asarray(np.abs(self.mean) * (factor if proportional else 1.0) + factor * self.amplitude)


def by_model(stage: Stage, result: AnalyticResult, motion: Oscillation) -> Strained:
    """Both sides of every neck, by the analytic model."""
    design = lower(stage)
    sizes = design.radius[0], design.neck[0], design.thickness[0], design.out_of_plane[0]
    bending, along = surface_stress(result.wrench, *sizes)
    sides = np.stack([along + bending, along - bending], axis=2).reshape(18, 3)
    return Strained(np.repeat(np.arange(9), 2), np.abs(sides @ motion.amplitude), sides @ motion.mean)


def by_elements(stage: Stage, solved: Solved, motion: Oscillation) -> Strained:
    """The nodes in every notch, by finite elements in the plane."""
    pull, stiffness = out_of_plane_ratio_of(stage), np.linalg.inv(solved.response.compliance)
    loads = np.array([motion.amplitude, motion.mean]) @ stiffness.T
    parts = []
    for (chain, hinge), stress in notch_fields(stage, solved.response, loads):
        amplitude, mean = von_mises(stress, pull)
        sign = np.sign(stress[1, :, 0] + stress[1, :, 1])
        parts.append(Strained(np.full(len(mean), 3 * chain + hinge), amplitude, sign * mean))
    return Strained(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def factor_at(of: Strained, law: Basquin, cycles: float, proportional: bool) -> float:
    """By what the amplitude may be multiplied for a life of `cycles` at the first neck; inf where none is pulled."""
    wanted = float(law.amplitude(cycles))
    if proportional:
        highest = float(np.max(of.equivalent(law)))
        return wanted / highest if highest > 0 else float("inf")

    def beyond(factor: float) -> float:
        return float(np.max(of.equivalent(law, factor, False))) - wanted

    end = 1.0
    while beyond(end) < 0 and end < LARGEST_FACTOR:
        end *= 2.0
    return float(brentq(beyond, 0.0, end, xtol=1e-14, rtol=1e-13)) if end < LARGEST_FACTOR else float("inf")
