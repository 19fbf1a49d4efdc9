"""Couplings of stages whose nine necks scatter: their 95 % quantiles.

The compliance of a chain is the sum of those of its hinges, each a smooth function of its own neck.
The analytic model is evaluated for each hinge at a few necks; the compliances of the stages are
interpolated between these."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.special import ndtri

from flexfem.analytic.network import in_series
from flexfem.arrays import Array
from flexfem.design.requirements import Tolerance
from flexfem.hinges.chart import Compliance
from flexfem.paper.designs import Designs
from flexfem.paper.equations import freedoms_of
from flexfem.paper.frames import Frames
from flexfem.paper.model import hinge_compliances, network_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES
from flexfem.study.factors import Factor, columns_of
from flexfem.study.loaded import INSIDE, LoadedStudy, monte_carlo, stage_of

LEVEL = 0.95  # of the quantiles
CONFIDENCE = 0.95  # of the intervals of the quantiles
OTHERS = 100_000  # stages, not seen by the search, for the final quantiles
BLOCKS = 10  # of these stages, one after the other: bounds the memory
NODES = 14  # necks of each hinge between which compliances are interpolated
WIDEST = 0.5  # deviation over neck up to which the interpolation error is 1e-6
UPPER = (
    (0, 0, 0, 1, 1, 2),
    (0, 1, 2, 1, 2, 2),
)  # entries of a symmetric matrix: xx, xy, xt, yy, yt, tt
REFUSED = (
    "tolerance.neck_um: a scattered neck is outside the chart of its hinge, or deviates by over "
    f"{WIDEST:.0%}"
)


def deviations(tolerance: Tolerance, stages: int, seed: int) -> Array:
    """Draw the deviations (stages, 3 chains, 3 hinges) of the nine necks, mm."""
    quantiles = np.clip(monte_carlo(seed, 9, 0, stages), INSIDE, 1.0 - INSIDE)
    return np.asarray(1e-3 * tolerance.neck_um * ndtri(quantiles).reshape(-1, 3, 3))


def scattered(loaded: LoadedStudy, values: Array, off: Array) -> tuple[LoadedStudy, Array]:
    """Return the study of the nine necks of a design (d,), and its designs (n, 9) for deviations
    (n, 3, 3).
    """
    stage = stage_of(loaded, values)
    hinges = list(product(CHAINS, HINGE_NAMES))
    columns = columns_of(
        Factor(key=f"override.{k}.{name}.neck_mm", values=(0.5,)) for k, name in hinges
    )
    necks = [stage.hinge(*hinge).neck for hinge in hinges]
    return replace(loaded, base=stage, columns=columns), off.reshape(-1, 9) + necks


@dataclass(frozen=True, eq=False)
class NeckScatter:
    """Deviations (stages, 3, 3) of the nine necks, mm: `searched` in the search of all designs,
    `others` after it.
    """

    searched: Array
    others: Array

    @classmethod
    @lru_cache(maxsize=1)
    def drawn(cls, tolerance: Tolerance, seed: int) -> NeckScatter:
        """Draw both, once for all searches of a design."""
        return cls(
            deviations(tolerance, tolerance.stages, seed),
            deviations(tolerance, OTHERS, (seed + 1) % 2**63),
        )

    @cached_property
    def nodes(self) -> Array:
        """Deviations (NODES,) of the interpolation nodes, from the least to the greatest deviation."""
        low = min(self.searched.min(), self.others.min())
        high = max(self.searched.max(), self.others.max())
        return np.asarray(
            low + (high - low) * (1 + np.cos(np.pi * np.arange(NODES) / (NODES - 1))) / 2
        )

    def _basis(self, off: Array) -> Array:
        """Return the Lagrange polynomials (3 chains, 3 hinges x NODES, stages) at deviations
        (stages, 3, 3).
        """
        polynomials = BarycentricInterpolator(self.nodes, np.eye(NODES), rng=0)(off)
        return np.ascontiguousarray(np.moveaxis(polynomials, 0, -1).reshape(3, 3 * NODES, len(off)))

    @cached_property
    def _searched_basis(self) -> Array:
        return self._basis(self.searched)

    def quantiles(self, designs: Designs, formula: str, mobility: int | None) -> Array:
        """Return the 95 % quantiles (n, 4) of n designs over the stages of the search; nan without
        a solution.
        """
        at_nodes = self._at_nodes(designs, formula, mobility)
        sizes = [_sizes(_couplings(chains @ self._searched_basis)) for chains in at_nodes]
        return np.array([np.quantile(size, LEVEL, axis=-1) for size in sizes]).reshape(-1, 4)

    def couplings(self, designs: Designs, formula: str, mobility: int | None) -> Array:
        """Return the couplings (3, stages) of the other stages of one design."""
        (at_nodes,) = self._at_nodes(designs, formula, mobility)
        blocks = np.array_split(self.others, BLOCKS)
        return np.concatenate(
            [_couplings(at_nodes @ self._basis(block)) for block in blocks], axis=-1
        )

    def _at_nodes(self, designs: Designs, formula: str, mobility: int | None) -> Array:
        """Return what each hinge at each node adds to its chain, (n, 3 chains, 6 entries, 3 hinges
        x NODES), or nan.
        """
        n = len(designs.thickness)
        varied = designs.chosen(np.repeat(np.arange(n), NODES))
        varied.neck[:] += np.tile(self.nodes, n)[:, None, None]
        one_of_three = np.eye(3)[:, None, None, :]
        hinges = hinge_compliances(varied, formula)
        single = Compliance(*(part.reshape(n, 1, NODES, 3, 3) * one_of_three for part in hinges))
        frames = Frames(*(part[:, None, None] for part in designs.frames))
        parts = in_series(network_of(frames, single, freedoms_of(mobility, designs.prismatic)))[
            ..., *UPPER
        ]
        parts[np.abs(self.nodes).max() > WIDEST * designs.neck.min(axis=(1, 2))] = np.nan
        return np.ascontiguousarray(
            parts.transpose(0, 3, 4, 1, 2).reshape(n, 3, len(UPPER[0]), 3 * NODES)
        )


class CouplingQuantiles(NamedTuple):
    """Quantiles (4,) of the couplings of a design over the other stages, in the order of
    `requirements.SCATTERED`.

    `others`, and from `low` to `high` their 95 % interval, are by the model. `factors` (meshes, 4),
    coarse to fine, are the ratios of finite elements to the model in stages solved by both, 1
    without any; `misfit` (4,) is the largest residual of the last ratio in one of these stages."""

    others: Array
    low: Array
    high: Array
    factors: Array
    misfit: Array

    @property
    def elements(self) -> Array:
        """Quantiles (meshes, 4) by finite elements, or by the model without them."""
        return self.factors * self.others

    @property
    def half_widths(self) -> Array:
        """Half-widths (4,) of the sampling uncertainty: of the interval, plus the misfit of the
        checked stages.
        """
        half = np.maximum(self.high - self.others, self.others - self.low)
        return np.asarray(half * self.factors[-1] + self.misfit)


def coupling_quantiles(couplings: Array, checked: list[Array]) -> CouplingQuantiles:
    """Return the quantiles of couplings (3, stages) by the model; `checked` are those of the first
    stages on each mesh.

    Notes
    -----
    The number of stages below the true quantile is binomial for any distribution (order statistics:
    H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., Wiley 2003, section 7.1). The factor is
    a least-squares fit; the misfit bounds the difference between a finite-element quantile and the
    factor times that of the model."""
    from scipy.stats import binom

    sizes = _sizes(couplings)
    low, high = binom.ppf(0.5 + np.array([-0.5, 0.5]) * CONFIDENCE, sizes.shape[-1], LEVEL).astype(
        int
    )
    ordered = np.sort(sizes, axis=-1)
    factors = [np.ones(4)]
    misfit = np.zeros(4)
    for elements in map(_sizes, checked):
        model = sizes[:, : elements.shape[-1]]
        factors.append(np.sum(elements * model, axis=-1) / np.sum(model**2, axis=-1))
        misfit = np.max(np.abs(elements - factors[-1][:, None] * model), axis=-1)
    interval = ordered[..., low - 1], ordered[..., high]
    return CouplingQuantiles(
        np.quantile(sizes, LEVEL, axis=-1), *interval, np.array(factors[1:] or factors), misfit
    )


def _sizes(couplings: Array) -> Array:
    """Return the magnitudes (4, stages) of couplings (3, stages), the last row being the largest of
    the three.
    """
    size = np.abs(couplings)
    return np.concatenate([size, size.max(axis=0, keepdims=True)])


def _couplings(chains: Array) -> Array:
    """Return `K_ij / sqrt(K_ii K_jj)` (3, stages) of xy, xt, yt from compliances (3 chains, 6
    entries, stages).
    """
    a, b, c, d, e, f = np.moveaxis(chains, 1, 0)
    A = d * f - e * e
    B = c * e - b * f
    C = b * e - c * d
    D = a * f - c * c
    E = b * c - a * e
    F = a * d - b * b
    over = 1 / (a * A + b * B + c * C)
    xx, xy, xt, yy, yt, tt = (np.sum(cofactor * over, axis=0) for cofactor in (A, B, C, D, E, F))
    return np.stack([xy / np.sqrt(xx * yy), xt / np.sqrt(xx * tt), yt / np.sqrt(yy * tt)])
