"""Couplings of stages whose nine necks scatter: their 95 % quantiles.

The compliance of a chain is the sum of those of its hinges, each a smooth function of its own neck.
The analytic model is evaluated for each hinge at a few necks; the compliances of the stages are
interpolated between these.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from flexfem.analytic.network import in_series
from flexfem.arrays import Array
from flexfem.design.requirements import Tolerance
from flexfem.design.scatter import LEVEL, OTHERS, coupling_sizes, deviations
from flexfem.hinges.chart import Compliance
from flexfem.paper.designs import Designs
from flexfem.paper.equations import freedoms_of
from flexfem.paper.frames import Frames
from flexfem.paper.model import hinge_compliances, network_of

BLOCKS = 10  # of these stages, one after the other: bounds the memory
NODES = 14  # necks of each hinge between which compliances are interpolated
WIDEST = 0.5  # deviation over neck up to which the interpolation error is 1e-6
# entries of a symmetric matrix: xx, xy, xt, yy, yt, tt
UPPER = ((0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2))
REFUSED = (
    "tolerance.neck_um: a scattered neck is outside the chart of its hinge, or deviates by over "
    f"{WIDEST:.0%}"
)


@dataclass(frozen=True, eq=False)
class NeckScatter:
    """Deviations (stages, 3, 3) of the nine necks, mm: `searched` in the search of all designs,
    `others` after it.
    """

    searched: Array
    others: Array

    @classmethod
    @lru_cache(maxsize=1)
    def drawn(
        cls,
        tolerance: Tolerance,
        seed: int,
    ) -> NeckScatter:
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

    def quantiles(
        self,
        designs: Designs,
        formula: str,
        mobility: int | None,
    ) -> Array:
        """Return the 95 % quantiles (n, 4) of n designs over the stages of the search; nan without
        a solution.
        """
        at_nodes = self._at_nodes(designs, formula, mobility)
        sizes = [coupling_sizes(_couplings(chains @ self._searched_basis)) for chains in at_nodes]
        return np.array([np.quantile(size, LEVEL, axis=-1) for size in sizes]).reshape(-1, 4)

    def couplings(
        self,
        designs: Designs,
        formula: str,
        mobility: int | None,
    ) -> Array:
        """Return the couplings (3, stages) of the other stages of one design."""
        (at_nodes,) = self._at_nodes(designs, formula, mobility)
        blocks = np.array_split(self.others, BLOCKS)
        return np.concatenate(
            [_couplings(at_nodes @ self._basis(block)) for block in blocks], axis=-1
        )

    def _at_nodes(
        self,
        designs: Designs,
        formula: str,
        mobility: int | None,
    ) -> Array:
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


def _couplings(chains: Array) -> Array:
    """Return `K_ij / sqrt(K_ii K_jj)` (3, stages) of xy, xt, yt from compliances (3 chains, 6
    entries, stages).
    """
    cofactors = _cofactors(chains)
    x, y, theta = (chains[:, k] * cofactors[:, k] for k in range(3))
    over = 1 / (x + y + theta)
    xx, xy, xt, yy, yt, tt = np.sum(cofactors * over[:, None], axis=0)
    return np.stack([xy / np.sqrt(xx * yy), xt / np.sqrt(xx * tt), yt / np.sqrt(yy * tt)])


def _cofactors(matrices: Array) -> Array:
    """Return the cofactors (n, 6, ...) of symmetric matrices (n, 6, ...), in the order of `UPPER`."""
    a, b, c, d, e, f = np.moveaxis(matrices, 1, 0)
    first_row = [d * f - e * e, c * e - b * f, b * e - c * d]
    others = [a * f - c * c, b * c - a * e, a * d - b * b]
    return np.stack([*first_row, *others], axis=1)
