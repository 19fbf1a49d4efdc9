"""Which designs a study asks for: factor values of any range of them, the same whatever range is asked."""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np

from flexfem.arrays import Array
from flexfem.study.factors import Factor
from flexfem.study.plan import LoadedStudy

BLOCK = 1024  # Monte Carlo designs drawn together, each block from a stream of its own
INSIDE = 2.0**-53  # keeps quantiles off 0 and 1, where a normal distribution is infinite


def sample(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Factor values (stop - start, columns) of the designs from `start` up to `stop`, in file units.

    Notes
    -----
    Memory is bounded by the range, except for Latin hypercubes and Saltelli's scheme, which hold the whole sample. A
    grid counts its last factor fastest.
    """
    factors = [column.factor for column in loaded.columns]
    start, stop = max(start, 0), min(stop, loaded.count)
    if loaded.study.sampling.method == "grid":
        points = [grid_points(factor) for factor in factors]
        places = np.unravel_index(np.arange(start, stop), [len(each) for each in points])
        return np.stack([each[place] for each, place in zip(points, places, strict=True)], axis=-1)
    quantiles = np.clip(_quantiles(loaded, start, stop), INSIDE, 1.0 - INSIDE)
    return np.stack([at_quantile(factor, u) for factor, u in zip(factors, quantiles.T, strict=True)], axis=-1)


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


def _quantiles(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Quantiles (stop - start, columns) of a sample, 0 <= u < 1."""
    sampling, columns = loaded.study.sampling, len(loaded.columns)
    assert sampling.seed is not None
    if sampling.method == "monte_carlo":
        return _monte_carlo(sampling.seed, columns, start, stop)
    if sampling.method == "sobol":
        return _sobol(sampling.seed, columns, start, stop)
    if sampling.method == "saltelli":
        assert sampling.base is not None
        return _saltelli(sampling.seed, columns, sampling.base)[start:stop]
    return _latin_hypercube(sampling.seed, columns, loaded.count)[start:stop]


def _monte_carlo(seed: int, columns: int, start: int, stop: int) -> Array:
    blocks = range(start // BLOCK, -(-stop // BLOCK))
    streams = (np.random.Philox(np.random.SeedSequence(seed, spawn_key=(block,))) for block in blocks)
    drawn = [np.random.Generator(stream).random((BLOCK, columns)) for stream in streams]
    return np.concatenate([np.empty((0, columns)), *drawn])[start % BLOCK :][: stop - start]


def _sobol(seed: int, columns: int, start: int, stop: int) -> Array:
    from scipy.stats import qmc

    engine = qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(seed))
    with warnings.catch_warnings():  # a range of a sequence need not be a power of two long
        warnings.simplefilter("ignore", UserWarning)
        if start:
            engine.fast_forward(start)
        return np.asarray(engine.random(stop - start))


@lru_cache(maxsize=1)
def _latin_hypercube(seed: int, columns: int, designs: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(columns, rng=np.random.default_rng(seed)).random(designs))


@lru_cache(maxsize=1)
def _saltelli(seed: int, columns: int, base: int) -> Array:
    from SALib.sample import sobol

    problem = {"num_vars": columns, "names": list(map(str, range(columns))), "bounds": [[0.0, 1.0]] * columns}
    rng = np.random.default_rng(seed)
    return np.asarray(sobol.sample(problem, base, calc_second_order=False, seed=rng))
