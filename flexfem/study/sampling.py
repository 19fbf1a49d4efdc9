"""Factor values of the designs of a study: grids, random samples, and tables of the user."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from flexfem.arrays import Array
from flexfem.files.refusals import one_line, place_of, shown, suggestion
from flexfem.files.toml import read_bytes
from flexfem.mechanism.keys import keys
from flexfem.refused import BadInput
from flexfem.study.factors import Column, Factor
from flexfem.study.plan import Study
from flexfem.study.tables import Correlation, normal_correlation

# size of a table of designs, which is held in memory
MOST_BYTES = {".csv": 2**26, ".parquet": 2**31}
BLOCK = 1024  # Monte Carlo designs in a block, which has its own random stream
# least distance of a quantile from 0 and 1, where a normal distribution is infinite
INSIDE = 2.0**-53


class DesignTable(NamedTuple):
    """A checked table of designs: its file, the SHA-256 of its content, and its number of rows."""

    path: Path
    digest: str
    rows: int


class _TableContent(NamedTuple):
    """SHA-256 of a file, and its numbers (rows, columns)."""

    digest: str
    values: Array


def sample(
    study: Study, columns: Sequence[Column], table: DesignTable | None, start: int, stop: int
) -> Array:
    """Return the factor values (stop - start, columns) of designs, in file units.

    The last factor of a grid varies fastest. A sample of an `EXTENSIBLE` method begins with every
    smaller one. Raises BadInput where the table of designs has changed.
    """
    if table is not None:
        return _rows_of_table(table, columns)[start:stop]
    method = study.sampling.method
    if method == "grid":
        return _grid(columns, start, stop)
    seed = study.sampling.seed or 0
    factors = len(columns)
    if method == "latin_hypercube":
        quantiles = _latin_hypercube(study.sampling.seed, factors, study.count)[start:stop]
    elif method == "monte_carlo":
        quantiles = monte_carlo(seed, factors, start, stop)
    elif method == "sobol":
        quantiles = _sobol(seed, factors, start, stop)
    else:
        quantiles = _saltelli(seed, factors, start, stop)
    return _values_at(columns, study.correlation, quantiles)


# tables of the user


def design_table_of(path: Path, columns: Sequence[Column]) -> DesignTable:
    """Read a table of designs and check every value.

    Raises BadInput, one line with file, row, column, value and what was expected: the file is
    missing, not CSV or Parquet, or has no rows; a column is missing or repeated; a value is not
    finite or outside the limits of its key.
    """
    path = Path(os.path.abspath(path))
    where = place_of(path)
    if path.suffix not in MOST_BYTES:
        raise BadInput(f"{where}, expected a file name that ends in {' or '.join(MOST_BYTES)}")
    digest, values = _content_of(path, columns)
    if len(values) == 0:
        raise BadInput(f"{where}: no rows, expected one for each design")
    for column, numbers in zip(columns, values.T, strict=True):
        _check_numbers(where, column, numbers)
    return DesignTable(path, digest, len(values))


def _check_numbers(
    where: str,
    column: Column,
    numbers: Array,
) -> None:
    for key in (keys()[path] for path in column.keys):
        bad = np.flatnonzero(~np.isfinite(numbers) | key.number.refuses(numbers))
        if len(bad):
            value = float(numbers[bad[0]])
            raise BadInput(
                f"{where}: row {bad[0] + 1}, column {shown(column.name)} = {value:g}, expected "
                f"{key.number.expected(value)} for {key.path}"
            )


def _rows_of_table(table: DesignTable, columns: Sequence[Column]) -> Array:
    digest, values = _content_of(table.path, columns)
    if digest != table.digest:
        raise BadInput(f"{place_of(table.path)}: changed since the study was read: run again")
    return values


def _content_of(path: Path, columns: Sequence[Column]) -> _TableContent:
    """Return the content of a table of designs, cached until the file changes."""
    version: tuple[int, ...] = ()
    if path.exists():
        stat = os.stat(path)
        version = (stat.st_ino, stat.st_size, stat.st_mtime_ns)
    return _read_table(path, version, tuple(column.name for column in columns))


@lru_cache(maxsize=2)
def _read_table(
    path: Path,
    version: tuple[int, ...],
    names: tuple[str, ...],
) -> _TableContent:
    import pyarrow as pa

    content = read_bytes(path, MOST_BYTES[path.suffix])
    table = _arrow_table(path, content, names)
    for name in names:
        _check_column(place_of(path), name, table)
    # empty cells are nan
    columns = [table[name].cast(pa.float64(), safe=False).to_numpy() for name in names]
    return _TableContent(hashlib.sha256(content).hexdigest(), np.column_stack(columns))


def _arrow_table(
    path: Path,
    content: bytes,
    names: tuple[str, ...],
) -> Any:
    """Return the content of a CSV or Parquet file. Raises BadInput for another one."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    kind = "a Parquet file, or damaged"
    try:
        if path.suffix != ".csv":
            table = pq.read_table(pa.BufferReader(content))
        else:
            kind = "CSV with commas between numbers"
            one_thread = pyarrow.csv.ReadOptions(use_threads=False)  # so that errors name the row
            types = dict.fromkeys(names, pa.float64())
            numbers = pyarrow.csv.ConvertOptions(column_types=types, null_values=[])
            table = pyarrow.csv.read_csv(
                pa.BufferReader(content), one_thread, convert_options=numbers
            )
        _ = table.column_names  # which may fail, too
    except (pa.ArrowException, OSError, ValueError) as error:
        raise BadInput(f"{place_of(path)}: not {kind}: {one_line(str(error), 160)}") from None
    return table


def _check_column(
    where: str,
    name: str,
    table: Any,
) -> None:
    """Raise BadInput for a column that is missing, repeated or not of numbers."""
    import pyarrow as pa

    present = table.column_names
    column = f"{where}: column {shown(name)}"
    if name not in present:
        close = suggestion(name, present) or f", found {one_line(', '.join(present), 160)}"
        raise BadInput(f"{column} is missing, expected one for each factor{close}")
    if present.count(name) > 1:
        raise BadInput(f"{column} appears twice, expected one for each factor")
    kind = table[name].type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise BadInput(f"{column} of type {kind}, expected numbers")


# grids and distributions


def _grid(
    columns: Sequence[Column],
    start: int,
    stop: int,
) -> Array:
    points = [grid_points(column.factor) for column in columns]
    places = np.unravel_index(np.arange(start, stop), [len(values) for values in points])
    chosen = [values[place] for values, place in zip(points, places, strict=True)]
    return np.stack(chosen, axis=-1)


def grid_points(factor: Factor) -> Array:
    """Return the points (k,) of a factor in a grid."""
    if factor.values is not None:
        return np.array(factor.values)
    assert factor.start is not None
    assert factor.end is not None
    assert factor.points is not None
    spaced = np.geomspace if factor.scale == "log" else np.linspace
    return spaced(factor.start, factor.end, factor.points)


def _values_at(
    columns: Sequence[Column], correlations: tuple[Correlation, ...], quantiles: Array
) -> Array:
    """Return the factor values (n, columns) at independent quantiles (n, columns).

    Correlations are those of a Gaussian copula (R. B. Nelsen, An Introduction to Copulas, 2nd ed.,
    Springer 2006): normal deviates `L z` with `L L' = R` of `normal_correlation`; every factor
    keeps its own distribution.
    """
    names = [column.name for column in columns]
    dependent = sorted({names.index(name) for pair in correlations for name in pair.factors})
    result = np.clip(quantiles, INSIDE, 1.0 - INSIDE)
    if dependent and len(result):
        R = normal_correlation([names[index] for index in dependent], correlations)
        deviates = ndtri(result[:, dependent]) @ np.linalg.cholesky(R).T
        result[:, dependent] = np.clip(ndtr(deviates), INSIDE, 1.0 - INSIDE)
    values = [at_quantile(column.factor, u) for column, u in zip(columns, result.T, strict=True)]
    return np.stack(values, axis=-1)


def at_quantile(factor: Factor, u: Array) -> Array:
    """Return the values (n,) of a factor at quantiles `u` (n,) of its distribution, 0 < u < 1."""
    if factor.values is not None:
        values = np.array(factor.values)
        return values[(u * len(values)).astype(np.int64)]
    if factor.kind == "normal":
        return _normal_at(factor, u)
    if factor.kind == "range":
        low, high = factor.start, factor.end
    else:
        low, high = factor.lower, factor.upper
    assert low is not None
    assert high is not None
    if factor.scale == "log":
        return np.asarray(low * (high / low) ** u)
    return np.asarray(low + u * (high - low))


def _normal_at(factor: Factor, u: Array) -> Array:
    """Return the quantiles (n,) of a normal distribution, truncated where it has limits."""
    mean = factor.mean or 0.0
    sd = factor.sd or 1.0
    if factor.lower is None and factor.upper is None:
        return np.asarray(mean + sd * ndtri(u))
    from scipy.stats import truncnorm

    low = -np.inf if factor.lower is None else (factor.lower - mean) / sd
    high = np.inf if factor.upper is None else (factor.upper - mean) / sd
    return np.asarray(truncnorm.ppf(u, low, high, loc=mean, scale=sd))


# random samples


def monte_carlo(
    seed: int,
    columns: int,
    start: int,
    stop: int,
) -> Array:
    """Return independent quantiles (stop - start, columns) of designs, 0 <= u < 1."""
    blocks = [np.empty((0, columns))]
    for block in range(start // BLOCK, -(-stop // BLOCK)):
        stream = np.random.Philox(np.random.SeedSequence(seed, spawn_key=(block,)))
        blocks.append(np.random.Generator(stream).random((BLOCK, columns)))
    return np.concatenate(blocks)[start % BLOCK :][: stop - start]


@lru_cache(maxsize=1)
def _sobol_engine(seed: int, columns: int) -> Any:
    """Return a scrambled Sobol sequence, cached with its position: most parts are in order."""
    from scipy.stats import qmc

    return qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(seed))


def _sobol(
    seed: int,
    columns: int,
    start: int,
    stop: int,
) -> Array:
    """Return the points `start` up to `stop` of the Sobol sequence."""
    engine = _sobol_engine(seed, columns)
    if engine.num_generated > start:
        engine.reset()
    if start > engine.num_generated:
        engine.fast_forward(start - engine.num_generated)
    with warnings.catch_warnings():
        # it warns of a number of points that is no power of two
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(engine.random(stop - start))


def _saltelli(
    seed: int,
    columns: int,
    start: int,
    stop: int,
) -> Array:
    """Return rows of the scheme of A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259.

    For every Sobol point (A, B) these are the designs A, A with one column of B at a time, and B.
    """
    group = columns + 2
    k = np.arange(columns)
    first = start // group
    points = _sobol(seed, 2 * columns, first, -(-stop // group))
    rows = np.repeat(points[:, None, :columns], group, axis=1)
    B = points[:, columns:]
    rows[:, 1 + k, k] = B
    rows[:, -1] = B
    return rows.reshape(-1, columns)[start - group * first :][: stop - start]


@lru_cache(maxsize=1)
def _latin_hypercube(
    seed: int | None,
    columns: int,
    designs: int,
) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(columns, rng=np.random.default_rng(seed)).random(designs))
