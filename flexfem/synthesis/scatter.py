"""Coupling of stages whose nine necks scatter: what 95 % of them keep, by the analytic model of many stages at once.

A chain's compliance is the sum of those of its hinges, each a smooth function of its own neck: each hinge is asked at a
few necks, and interpolated between them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import chain_compliance, hinge_compliances
from flexfem.arrays import Array
from flexfem.hinges.formulas import Compliance
from flexfem.mechanism.designs import Designs, Frames
from flexfem.mechanism.stage import HINGE_NAMES
from flexfem.study.factors import Column, Factor
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.plan import Sampling
from flexfem.synthesis.extra import freedoms
from flexfem.synthesis.tables import Tolerance

LEVEL = 0.95  # of stages whose coupling is at most the one that is asked
CONFIDENCE = 0.95  # of an interval of that coupling
OTHERS = 100_000  # stages that what is found is stated for
BLOCK = 10_000  # stages at a time: bounds the memory
NODES = 12  # necks that each hinge is asked at
WIDEST = 0.5  # deviation over neck up to which 12 nodes interpolate to 1e-6
UPPER = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)  # entries of a symmetric matrix: xx, xy, xt, yy, yt, tt
LOST = f"tolerance.neck_um: a neck that scatters is off the chart of its hinge, or by more than {WIDEST:.0%} of itself"


class QuantileInterval(NamedTuple):
    """The 95 % values (..., 4), and the interval that holds those of all stages with `CONFIDENCE`, each by itself."""

    value: Array
    low: Array
    high: Array


class ElementFit(NamedTuple):
    """Sizes (4, stages) as a factor (4,) times others of the same stages: by least squares, and the largest misfit."""

    factor: Array
    misfit: Array


def scattered_study(loaded: LoadedStudy, tolerance: Tolerance, stages: int, seed: int) -> LoadedStudy:
    """The study of a stage, that of `loaded`, with nine necks that scatter about its own."""
    columns = []
    for chain in (1, 2, 3):
        for name in HINGE_NAMES:
            path, neck = f"override.{chain}.{name}.neck_mm", loaded.stage.hinge(chain, name).neck
            about = {"distribution": "normal", "mean": neck, "sd": 1e-3 * tolerance.neck_um}
            columns.append(Column(path, (path,), Factor.model_validate({"key": path} | about)))
    sampling = Sampling(method="monte_carlo", designs=stages, seed=seed)
    changes = {"factor": tuple(column.factor for column in columns), "sampling": sampling, "drive": None}
    changes |= {"frequencies": None, "life": None, "drift": None}
    return replace(loaded, study=loaded.study.model_copy(update=changes), columns=tuple(columns), given=None)


def deviations(loaded: LoadedStudy, tolerance: Tolerance, stages: int, seed: int) -> Array:
    """Deviations (stages, 3, 3) of the nine necks, mm: those of `scattered_study`, whatever the stage."""
    study = scattered_study(loaded, tolerance, stages, seed)
    own = np.array([column.factor.mean for column in study.columns])
    return np.asarray((sample(study, 0, stages) - own).reshape(-1, 3, 3))


def seed_of_others(seed: int) -> int:
    """The seed of the stages that what is found is stated for."""
    return (seed + 1) % 2**63


@dataclass(frozen=True, eq=False)
class NeckScatter:
    """Deviations of the nine necks, mm.

    searched : (stages, 3, 3), the same for every design.   others : (OTHERS, 3, 3), which no search sees.
    """

    searched: Array
    others: Array

    @classmethod
    def of(cls, loaded: LoadedStudy, tolerance: Tolerance, seed: int) -> NeckScatter:
        """Draw both."""
        searched = deviations(loaded, tolerance, tolerance.stages, seed)
        return cls(searched, deviations(loaded, tolerance, OTHERS, seed_of_others(seed)))

    @cached_property
    def nodes(self) -> Array:
        """Deviations (NODES, 3, 3) that each hinge is asked at, from the least to the greatest of all."""
        low, high = self._ends
        return low + (high - low) * (_chebyshev()[:, None, None] + 1) / 2

    @cached_property
    def basis(self) -> Array:
        """Of `basis_at`, the stages that are searched with."""
        return self.basis_at(self.searched)

    @property
    def _ends(self) -> tuple[Array, Array]:
        both = self.searched, self.others
        return np.min([each.min(axis=0) for each in both], axis=0), np.max([each.max(axis=0) for each in both], axis=0)

    def basis_at(self, off: Array) -> Array:
        """Lagrange polynomials (3 chains, 3 hinges x NODES, stages) of the nodes at deviations (stages, 3, 3).

        Notes
        -----
        The barycentric formula for Chebyshev points: J.-P. Berrut, L. N. Trefethen, SIAM Rev. 46 (2004) 501, (5.4).
        """
        low, high = self._ends
        weights = (-1.0) ** np.arange(NODES)
        weights[[0, -1]] /= 2
        away = (2 * (off - low) / (high - low) - 1)[..., None] - _chebyshev()
        on_node = away == 0
        terms = weights / np.where(on_node, 1.0, away)
        found = np.where(on_node.any(axis=-1, keepdims=True), on_node, terms / terms.sum(axis=-1, keepdims=True))
        return np.ascontiguousarray(np.moveaxis(found, 0, -1).reshape(3, 3 * NODES, len(off)))

    def searched_values(self, loaded: LoadedStudy, designs: Designs) -> Array:
        """The 95 % values (n, 4) of n designs in the stages that are searched with; nan where a hinge has no answer."""
        at_nodes = self._at_nodes(loaded, designs)
        return np.array([quantiles_of(_couplings(each @ self.basis)) for each in at_nodes]).reshape(-1, 4)

    def couplings(self, loaded: LoadedStudy, designs: Designs, off: Array) -> Array:
        """Couplings (3, stages) of one design whose necks deviate by `off` (stages, 3, 3)."""
        (at_nodes,) = self._at_nodes(loaded, designs)
        blocks = [off[k : k + BLOCK] for k in range(0, len(off), BLOCK)]
        return np.concatenate([_couplings(at_nodes @ self.basis_at(block)) for block in blocks], axis=-1)

    def _at_nodes(self, loaded: LoadedStudy, designs: Designs) -> Array:
        """What each hinge at each node adds to its chain, (n, 3 chains, 6 entries, 3 hinges x NODES); nan if one has
        no answer."""
        n = len(designs.thickness)
        many = designs.chosen(np.repeat(np.arange(n), NODES))
        many.neck[:] += np.tile(self.nodes, (n, 1, 1))
        hinges = hinge_compliances(many, loaded.study.formula)
        alone = np.eye(3)[:, None, None, :]  # of the three hinges of each chain one
        each = Compliance(*(part.reshape(n, 1, NODES, 3, 3) * alone for part in hinges))
        frames = Frames(*(part[:, None, None] for part in designs.frames))
        found = chain_compliance(frames, each, freedoms(loaded, designs))[..., *UPPER]
        found[np.any(np.abs(self.nodes) > WIDEST * designs.neck[:, None], axis=(1, 2, 3))] = np.nan
        return np.ascontiguousarray(found.transpose(0, 3, 4, 1, 2).reshape(n, 3, len(UPPER[0]), 3 * NODES))


def sizes_of(couplings: Array) -> Array:
    """Sizes (..., 4, stages) of couplings (..., 3, stages): of each, and of the largest of the three."""
    size = np.abs(couplings)
    return np.concatenate([size, size.max(axis=-2, keepdims=True)], axis=-2)


def quantiles_of(couplings: Array) -> Array:
    """The 95 % values (..., 4) of couplings (..., 3, stages)."""
    return np.asarray(np.quantile(sizes_of(couplings), LEVEL, axis=-1))


def bounded(couplings: Array) -> QuantileInterval:
    """The 95 % values of couplings (..., 3, stages) with what the stages, drawn at random, leave open.

    Notes
    -----
    Order statistics: of n stages the number below the true value is binomial, whatever the distribution (H. A. David,
    H. N. Nagaraja, Order Statistics, 3rd ed., Wiley 2003, section 7.1). 72 stages are the fewest.
    """
    from scipy.stats import binom

    ordered = np.sort(sizes_of(couplings), axis=-1)
    low, high = binom.ppf(0.5 + np.array([-0.5, 0.5]) * CONFIDENCE, ordered.shape[-1], LEVEL).astype(int)
    return QuantileInterval(quantiles_of(couplings), ordered[..., low - 1], ordered[..., high])


def fitted(couplings: Array, to: Array) -> ElementFit:
    """Couplings (3, stages) of finite elements as a factor of those of the model, `to`, of the same stages.

    A quantile of the ones is off that of the others times the factor by no more than the misfit.
    """
    elements, model = sizes_of(couplings), sizes_of(to)
    factor = np.sum(elements * model, axis=-1) / np.sum(model**2, axis=-1)
    return ElementFit(factor, np.max(np.abs(elements - factor[:, None] * model), axis=-1))


def _chebyshev() -> Array:
    return np.asarray(np.cos(np.pi * np.arange(NODES) / (NODES - 1)))


def _couplings(chains: Array) -> Array:
    """`K_ij / sqrt(K_ii K_jj)` (3, stages) of xy, xt, yt, from the compliances (3 chains, 6 entries, stages)."""
    a, b, c, d, e, f = np.moveaxis(chains, 1, 0)
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    over = 1 / (a * A + b * B + c * C)
    xx, xy, xt, yy, yt, tt = (np.sum(cofactor * over, axis=0) for cofactor in (A, B, C, D, E, F))
    return np.stack([xy / np.sqrt(xx * yy), xt / np.sqrt(xx * tt), yt / np.sqrt(yy * tt)])
