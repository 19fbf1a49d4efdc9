"""Couplings of stages whose nine necks scatter: what 95 % of them keep.

A chain's compliance is the sum of those of its hinges, each a smooth function of its own neck: the analytic model
answers each hinge at a few necks, and the stages are interpolated between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.special import ndtri

from flexfem.analytic.model import chain_compliance, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import Array
from flexfem.design.requirements import Tolerance
from flexfem.hinges.chart import Compliance
from flexfem.mechanism.designs import Designs, Frames
from flexfem.study.loaded import INSIDE, monte_carlo

LEVEL = 0.95  # of stages whose coupling is at most the one that is asked
CONFIDENCE = 0.95  # of an interval of that coupling
OTHERS = 100_000  # stages that what is found is stated for
BLOCK = 10_000  # stages at a time: bounds the memory
NODES = 12  # necks that each hinge is answered at
CHEBYSHEV = np.cos(np.pi * np.arange(NODES) / (NODES - 1))
LAGRANGE = np.linalg.inv(chebvander(CHEBYSHEV, NODES - 1))  # Lagrange polynomials as sums of Chebyshev polynomials
WIDEST = 0.5  # deviation over neck up to which 12 nodes interpolate to 1e-6
UPPER = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)  # entries of a symmetric matrix: xx, xy, xt, yy, yt, tt
REFUSED = f"tolerance.neck_um: a neck that scatters is off the chart of its hinge, or by more than {WIDEST:.0%}"


def deviations(tolerance: Tolerance, stages: int, seed: int) -> Array:
    """Deviations (stages, 3 chains, 3 hinges) of the nine necks, mm."""
    quantiles = np.clip(monte_carlo(seed, 9, 0, stages), INSIDE, 1.0 - INSIDE)
    return np.asarray(1e-3 * tolerance.neck_um * ndtri(quantiles).reshape(-1, 3, 3))


@dataclass(frozen=True, eq=False)
class NeckScatter:
    """Deviations (stages, 3, 3) of the nine necks, mm: those `searched`, the same for every design, and `others`, which
    no search sees and what is found is stated for.
    """

    searched: Array
    others: Array

    @classmethod
    @lru_cache(maxsize=1)
    def of(cls, tolerance: Tolerance, seed: int) -> NeckScatter:
        """Draw both, for all searches of one design once."""
        return cls(deviations(tolerance, tolerance.stages, seed), deviations(tolerance, OTHERS, (seed + 1) % 2**63))

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        both = self.searched, self.others
        return np.min([each.min(axis=0) for each in both], axis=0), np.max([each.max(axis=0) for each in both], axis=0)

    @cached_property
    def nodes(self) -> Array:
        """Deviations (NODES, 3, 3) that each hinge is answered at, from the least to the greatest of all."""
        low, high = self._ends
        return np.asarray(low + (high - low) * (CHEBYSHEV[:, None, None] + 1) / 2)

    @cached_property
    def _searched_basis(self) -> Array:
        return self._basis(self.searched)

    def _basis(self, off: Array) -> Array:
        """Lagrange polynomials (3 chains, 3 hinges x NODES, stages) of the nodes at deviations (stages, 3, 3)."""
        low, high = self._ends
        found = chebvander(2 * (off - low) / (high - low) - 1, NODES - 1) @ LAGRANGE
        return np.ascontiguousarray(np.moveaxis(found, 0, -1).reshape(3, 3 * NODES, len(off)))

    def quantiles(self, designs: Designs, formula: str, mobility: int | None) -> Array:
        """The 95 % values (n, 4) of n designs in the stages that are searched with; nan where a hinge has no answer."""
        at_nodes = self._at_nodes(designs, formula, mobility)
        return np.array([_quantiles(_couplings(each @ self._searched_basis)) for each in at_nodes]).reshape(-1, 4)

    def couplings(self, designs: Designs, formula: str, mobility: int | None, off: Array) -> Array:
        """Couplings (3, stages) of one design whose necks deviate by `off` (stages, 3, 3)."""
        (at_nodes,) = self._at_nodes(designs, formula, mobility)
        blocks = [off[k : k + BLOCK] for k in range(0, len(off), BLOCK)]
        return np.concatenate([_couplings(at_nodes @ self._basis(block)) for block in blocks], axis=-1)

    def _at_nodes(self, designs: Designs, formula: str, mobility: int | None) -> Array:
        """What each hinge at each node adds to its chain, (n, 3 chains, 6 entries, 3 hinges x NODES), or nan."""
        n = len(designs.thickness)
        many = designs.chosen(np.repeat(np.arange(n), NODES))
        many.neck[:] += np.tile(self.nodes, (n, 1, 1))
        one_of_three = np.eye(3)[:, None, None, :]
        hinges = hinge_compliances(many, formula)
        each = Compliance(*(part.reshape(n, 1, NODES, 3, 3) * one_of_three for part in hinges))
        frames = Frames(*(part[:, None, None] for part in designs.frames))
        found = chain_compliance(frames, each, freedoms_of(mobility, designs.prismatic))[..., *UPPER]
        found[np.any(np.abs(self.nodes) > WIDEST * designs.neck[:, None], axis=(1, 2, 3))] = np.nan
        return np.ascontiguousarray(found.transpose(0, 3, 4, 1, 2).reshape(n, 3, len(UPPER[0]), 3 * NODES))


class ScatteredStages(NamedTuple):
    """The couplings of `requirements.SCATTERED` (4,) of a design, of stages that no search has seen.

    By the model: of the stages that the design was `searched` with, and of the `others` with their 95 % interval.
    `factors` (meshes, 4), coarse to fine, are those by which finite elements differ from the model in the stages that
    both solve, 1 without them; `misfit` (4,) is the largest difference that the last leaves in one of these stages.
    """

    searched: Array
    others: Array
    low: Array
    high: Array
    factors: Array
    misfit: Array

    @property
    def elements(self) -> Array:
        """The couplings (meshes, 4) of the others by finite elements, by the model without them."""
        return self.factors * self.others

    @property
    def half_widths(self) -> Array:
        """By how much sampling may be off (4,): half the interval of the stages, and the misfit of those checked."""
        half = np.maximum(self.high - self.others, self.others - self.low)
        return np.asarray(half * self.factors[-1] + self.misfit)


def stated(searched: Array, couplings: Array, checked: list[Array]) -> ScatteredStages:
    """What is stated of couplings (3, stages) of the others by the model, the first of them `checked` on each mesh.

    `searched` (4,) are the 95 % values of the stages that were searched with.

    Notes
    -----
    Order statistics: of n stages the number below the true value is binomial, whatever the distribution (H. A. David,
    H. N. Nagaraja, Order Statistics, 3rd ed., Wiley 2003, section 7.1). The factor is by least squares; a quantile of
    finite elements is off that of the model times it by no more than the misfit.
    """
    from scipy.stats import binom

    ordered = np.sort(_sizes(couplings), axis=-1)
    low, high = binom.ppf(0.5 + np.array([-0.5, 0.5]) * CONFIDENCE, ordered.shape[-1], LEVEL).astype(int)
    factors, misfit = [np.ones(4)], np.zeros(4)
    for of_mesh in checked:
        elements, model = _sizes(of_mesh), _sizes(couplings[:, : of_mesh.shape[-1]])
        factors.append(np.sum(elements * model, axis=-1) / np.sum(model**2, axis=-1))
        misfit = np.max(np.abs(elements - factors[-1][:, None] * model), axis=-1)
    interval = ordered[..., low - 1], ordered[..., high]
    return ScatteredStages(searched, _quantiles(couplings), *interval, np.array(factors[1:] or factors), misfit)


def _sizes(couplings: Array) -> Array:
    """Sizes (4, stages) of couplings (3, stages): of each, and of the largest of the three."""
    size = np.abs(couplings)
    return np.concatenate([size, size.max(axis=0, keepdims=True)])


def _quantiles(couplings: Array) -> Array:
    """The 95 % values (4,) of couplings (3, stages)."""
    return np.asarray(np.quantile(_sizes(couplings), LEVEL, axis=-1))


def _couplings(chains: Array) -> Array:
    """`K_ij / sqrt(K_ii K_jj)` (3, stages) of xy, xt, yt, from the compliances (3 chains, 6 entries, stages)."""
    a, b, c, d, e, f = np.moveaxis(chains, 1, 0)
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    over = 1 / (a * A + b * B + c * C)
    xx, xy, xt, yy, yt, tt = (np.sum(cofactor * over, axis=0) for cofactor in (A, B, C, D, E, F))
    return np.stack([xy / np.sqrt(xx * yy), xt / np.sqrt(xx * tt), yt / np.sqrt(yy * tt)])
