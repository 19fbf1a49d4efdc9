"""Which designs a study asks for: factor values of any range of them, the same whatever range is asked."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.study.columns import Factor
from flexfem.study.given import rows_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.tables import normal_correlation

BLOCK = 1024  # Monte Carlo designs drawn together, each block from a stream of its own
BITS = 30  # of a Sobol point, so that 2^30 differ
INSIDE = 2.0**-53  # keeps quantiles off 0 and 1, where a normal distribution is infinite


def sample(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Factor values (stop - start, columns) of the designs from `start` up to `stop`, in file units.

    Notes
    -----
    Memory and time go with the range, wherever it lies, except for Latin hypercubes, which hold the whole sample. A
    grid counts its last factor fastest. Samples of methods that are `EXTENSIBLE` begin alike however large they are.
    """
    factors = [column.factor for column in loaded.columns]
    start, stop = max(start, 0), min(stop, loaded.count)
    if loaded.given is not None:
        return rows_of(loaded.given, tuple(column.name for column in loaded.columns), start, stop)
    if loaded.study.sampling.method == "grid":
        points = [grid_points(factor) for factor in factors]
        places = np.unravel_index(np.arange(start, stop), [len(each) for each in points])
        return np.stack([each[place] for each, place in zip(points, places, strict=True)], axis=-1)
    quantiles = correlated(loaded, np.clip(_quantiles(loaded, start, stop), INSIDE, 1.0 - INSIDE))
    return np.stack([at_quantile(factor, u) for factor, u in zip(factors, quantiles.T, strict=True)], axis=-1)


def correlated(loaded: LoadedStudy, quantiles: Array) -> Array:
    """Quantiles (n, columns) with the rank correlations of the study, from independent ones between 0 and 1.

    Notes
    -----
    A Gaussian copula (R. B. Nelsen, An Introduction to Copulas, 2nd ed., Springer 2006): normal deviates `L z` with
    `L L' = R` of `tables.normal_correlation`; every factor keeps its own distribution.
    """
    names = [column.name for column in loaded.columns]
    pairs = loaded.study.correlation
    among = sorted({names.index(name) for each in pairs for name in each.factors})
    if not among or not len(quantiles):
        return quantiles
    from scipy.special import ndtr, ndtri

    L = np.linalg.cholesky(normal_correlation([names[place] for place in among], pairs))
    found = quantiles.copy()
    found[:, among] = ndtr(np.einsum("ij,nj->ni", L, ndtri(quantiles[:, among])))  # row by row: no BLAS blocking
    return np.clip(found, INSIDE, 1.0 - INSIDE)


def grid_points(factor: Factor) -> Array:
    """Points (k,) of a factor in a grid."""
    if factor.values is not None:
        return np.array(factor.values)
    assert factor.start is not None and factor.end is not None and factor.points is not None
    if factor.scale == "log":
        return np.geomspace(factor.start, factor.end, factor.points)
    return np.linspace(factor.start, factor.end, factor.points)


def at_quantile(factor: Factor, u: Array) -> Array:
    """Values (n,) of a factor at quantiles `u` (n,) of its distribution, 0 < u < 1."""
    from scipy import stats

    if factor.values is not None:
        return np.array(factor.values)[(u * len(factor.values)).astype(np.int64)]
    if factor.kind == "normal" and factor.lower is factor.upper is None:
        return np.asarray(stats.norm.ppf(u, factor.mean, factor.sd))
    if factor.kind == "normal":
        assert factor.mean is not None and factor.sd is not None
        lower = -np.inf if factor.lower is None else factor.lower
        upper = np.inf if factor.upper is None else factor.upper
        ends = (lower - factor.mean) / factor.sd, (upper - factor.mean) / factor.sd
        return np.asarray(stats.truncnorm.ppf(u, *ends, loc=factor.mean, scale=factor.sd))
    low, high = (factor.start, factor.end) if factor.kind == "range" else (factor.lower, factor.upper)
    assert low is not None and high is not None
    if factor.scale == "log":
        return np.asarray(stats.loguniform.ppf(u, low, high))
    return np.asarray(stats.uniform.ppf(u, low, high - low))


def monte_carlo(seed: int, columns: int, start: int, stop: int) -> Array:
    """Independent quantiles (stop - start, columns) of the designs from `start` up to `stop`, 0 <= u < 1."""
    blocks = range(start // BLOCK, -(-stop // BLOCK))
    streams = (np.random.Philox(np.random.SeedSequence(seed, spawn_key=(block,))) for block in blocks)
    drawn = [np.random.Generator(stream).random((BLOCK, columns)) for stream in streams]
    return np.concatenate([np.empty((0, columns)), *drawn])[start % BLOCK :][: stop - start]


def _quantiles(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Quantiles (stop - start, columns) of a sample, 0 <= u < 1."""
    sampling, columns = loaded.study.sampling, len(loaded.columns)
    assert sampling.seed is not None
    if sampling.method == "monte_carlo":
        return monte_carlo(sampling.seed, columns, start, stop)
    if sampling.method == "sobol":
        return _sobol(sampling.seed, columns, start, stop)
    if sampling.method == "saltelli":
        return _saltelli(sampling.seed, columns, start, stop)
    return _latin_hypercube(sampling.seed, columns, loaded.count)[start:stop]


def _sobol(seed: int, columns: int, start: int, stop: int) -> Array:
    """Points `start` up to `stop` of the scrambled sequence that `scipy.stats.qmc.Sobol` draws, whatever comes before.

    Notes
    -----
    I. A. Antonov, V. M. Saleev, USSR Comput. Math. Math. Phys. 19(1) (1979) 252: point n differs from the one before
    in the direction number of the lowest bit set in n; from the first in those of the bits of the Gray code of n.
    """
    first, directions = _directions(seed, columns)
    gray = start ^ (start >> 1)
    bits = [k for k in range(BITS) if gray >> k & 1]
    begin = first ^ np.bitwise_xor.reduce(directions[bits], axis=0)
    after = np.arange(start + 1, stop)
    steps = directions[np.bitwise_count((after & -after) - 1)]
    return np.bitwise_xor.accumulate(np.concatenate([begin[None], steps]))[: stop - start] / 2.0**BITS


@lru_cache(maxsize=4)
def _directions(seed: int, columns: int) -> tuple[AnyArray, AnyArray]:
    """First point (columns,) and direction numbers (BITS, columns) of a scrambled sequence, in units of 2^-BITS.

    The engine adds direction number k to its last point when it has drawn 2^k points, so it is told that it has.
    """
    from scipy.stats import qmc

    engine = qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(seed))
    drawn = [engine.random(1)]
    for k in range(BITS):
        engine.num_generated = 2**k
        drawn.append(engine.random(1))
    numbers = (np.concatenate(drawn) * 2.0**BITS).astype(np.uint32)
    return numbers[0], numbers[1:] ^ numbers[:-1]


def _saltelli(seed: int, columns: int, start: int, stop: int) -> Array:
    """Rows of A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: of every Sobol point (A, B) in turn the designs
    A, A with one column of B at a time, and B."""
    group, k = columns + 2, np.arange(columns)
    first = start // group
    points = _sobol(seed, 2 * columns, first, -(-stop // group))
    rows = np.repeat(points[:, None, :columns], group, axis=1)
    rows[:, 1 + k, k] = rows[:, -1] = points[:, columns:]
    return rows.reshape(-1, columns)[start - group * first :][: stop - start]


@lru_cache(maxsize=1)
def _latin_hypercube(seed: int, columns: int, designs: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(columns, rng=np.random.default_rng(seed)).random(designs))
