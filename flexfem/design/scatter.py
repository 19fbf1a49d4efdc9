"""Quantiles of couplings under scatter, from a sample by the model and a few of it by finite
elements.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from flexfem.arrays import Array
from flexfem.design.requirements import SCATTERED, Tolerance
from flexfem.study.sampling import INSIDE, monte_carlo

LEVEL = 0.95  # of the quantiles
CONFIDENCE = 0.95  # of the intervals of the quantiles
OTHERS = 100_000  # stages, not seen by the search, for the final quantiles


def deviations(
    tolerance: Tolerance,
    stages: int,
    seed: int,
) -> Array:
    """Draw the deviations (stages, 3 chains, 3 hinges) of the nine necks, mm."""
    quantiles = np.clip(monte_carlo(seed, 9, 0, stages), INSIDE, 1.0 - INSIDE)
    return np.asarray(1e-3 * tolerance.neck_um * ndtri(quantiles).reshape(-1, 3, 3))


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

    sizes = coupling_sizes(couplings)
    low, high = binom.ppf(0.5 + np.array([-0.5, 0.5]) * CONFIDENCE, sizes.shape[-1], LEVEL).astype(
        int
    )
    ordered = np.sort(sizes, axis=-1)
    factors = [np.ones(4)]
    misfit = np.zeros(4)
    for elements in map(coupling_sizes, checked):
        model = sizes[:, : elements.shape[-1]]
        factors.append(np.sum(elements * model, axis=-1) / np.sum(model**2, axis=-1))
        misfit = np.max(np.abs(elements - factors[-1][:, None] * model), axis=-1)
    interval = ordered[..., low - 1], ordered[..., high]
    return CouplingQuantiles(
        np.quantile(sizes, LEVEL, axis=-1), *interval, np.array(factors[1:] or factors), misfit
    )


def coupling_sizes(couplings: Array) -> Array:
    """Return the magnitudes (4, stages) of couplings (3, stages), the last row being the largest of
    the three.
    """
    size = np.abs(couplings)
    return np.concatenate([size, size.max(axis=0, keepdims=True)])


def named(couplings: Array) -> dict[str, float]:
    """Return couplings under scatter (4,) by their columns."""
    return dict(zip(SCATTERED, map(float, couplings), strict=True))
