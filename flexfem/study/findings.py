"""What a table of designs shows: cells of a map, percentiles, Sobol indices, the designs that no other beats."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from pydantic import ValidationError

from flexfem.arrays import AnyArray, Array, Index, wide
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.study.columns import COUPLINGS, CROSS, DRIFTS, PARTS, STIFFNESSES, round_off_of
from flexfem.study.loaded import LoadedStudy, sample, stage_of
from flexfem.study.plan import Figure

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable

PER_CELL, MOST_CELLS = 12, 25  # designs in a cell of a map, about; cells along one side
FEW = 3  # designs of a random sample, below which a mean says little
BROKEN = "breaks a constraint"
CONFIDENCE = 0.95
LEAST = 100  # designs, for indices from one plain sample; of 60, an interval of 95 % held in 86 %
MOST_BINS, FEW_LEVELS = 32, 12  # bins of a factor's range; values of a factor that are groups by themselves
FLAT = 1e-9  # spread over size: round-off of a value that no factor changes
MARKED = (2.5, 50.0, 97.5)  # percentiles
ATTEMPTS = 2000  # designs of a front that are drawn to see whether they can be; some 10 ms each
SIZE = "envelope_mm"


class Cells(NamedTuple):
    """Points of a map with values.

    Attributes
    ----------
    points, values : (n, 2), (n,)
        nan where there is no value.
    missing : mapping
        Which points have no value, bool (n,), by the reason.
    grid : bool
        Whether the points are all pairs of some values.
    averaged : tuple
        Columns that the values are means over, none where each value is a design's.
    scatter, size : float, int
        Median standard deviation of the designs about the means of their cells, and median designs in one.
    """

    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    averaged: tuple[str, ...] = ()
    scatter: float = 0.0
    size: int = 1


def cells_of(loaded: LoadedStudy, table: StudyTable, names: tuple[str, str], value: str) -> Cells:
    """The value over two factors; where other factors vary as well, its mean over them in cells of the two."""
    others = tuple(
        column.name for column in loaded.columns if column.name not in names and np.ptp(table.columns[column.name]) > 0
    )
    points = np.column_stack([table.columns[name] for name in names])
    kept, values = table.ok & ~table.infeasible, table.columns[value]
    grid = loaded.study.sampling.method == "grid"
    if not others:
        missing = dict(table.unanswered) | ({BROKEN: table.infeasible} if table.infeasible.any() else {})
        return Cells(points, np.where(kept, values, np.nan), missing, grid)
    bins = len(points) if grid else int(np.clip(np.sqrt(len(points) / PER_CELL), 2, MOST_CELLS))
    log = {column.name: column.factor.scale == "log" for column in loaded.columns}
    (xs, i), (ys, j) = (_binned(v, bins, log[name]) for v, name in zip(points.T, names, strict=True))
    cell = (i * len(ys) + j)[kept]
    count, found = np.bincount(cell, minlength=len(xs) * len(ys)), values[kept]
    enough = count >= (1 if grid else FEW)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(cell, found, len(count)) / count
        scatter = np.sqrt(np.bincount(cell, (found - mean[cell]) ** 2, len(count)) / (count - 1))
    several = enough & (count > 1)
    return Cells(
        np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2),
        np.where(enough, mean, np.nan),
        {"no design" if grid else f"fewer than {FEW} designs": ~enough} if not enough.all() else {},
        True,
        others,
        float(np.median(scatter[several])) if several.any() else 0.0,
        int(np.median(count[enough])) if enough.any() else 0,
    )


def _binned(column: Array, bins: int, log: bool) -> tuple[Array, Index]:
    """Centres of the bins of a factor (n,), and in which each design is; single values where they are few."""
    levels, group = np.unique(column, return_inverse=True)
    if len(levels) <= bins:
        return levels, np.asarray(group, dtype=np.int64)
    places = np.log(column) if log else column
    ends = np.linspace(places.min(), places.max(), bins + 1)
    group = np.clip(np.searchsorted(ends, places, side="right") - 1, 0, bins - 1)
    centres = (ends[1:] + ends[:-1]) / 2
    return np.asarray(np.exp(centres) if log else centres), np.asarray(group, dtype=np.int64)


class Front(NamedTuple):
    """The best designs among those that can be drawn.

    Attributes
    ----------
    places : (m,)
        Where they are in the sample, from the best in the first value to the best in the second.
    undrawable : (k,)
        Places of designs that would be on the front or beyond it, but cannot be drawn.
    unchecked : int
        How many of `places` were not tried, because the attempts were used up.
    """

    places: Index
    undrawable: Index
    unchecked: int


def non_dominated(x: Array, y: Array, x_larger: bool = True, y_larger: bool = True) -> Index:
    """Places (m,) of the designs that no other beats, from the best in x to the best in y.

    Parameters
    ----------
    x, y : (n,)
        Finite.
    x_larger, y_larger : bool
        Whether larger is better.

    Notes
    -----
    One design beats another when it is no worse in both values and better in one; equal designs stay together. Sorted
    from the best x on, a design is on the front when its y is better than all before: n log n, as H. T. Kung,
    F. Luccio, F. P. Preparata, J. ACM 22 (1975) 469.
    """
    gain_x, gain_y = x if x_larger else -x, y if y_larger else -y
    order = np.lexsort((-gain_y, -gain_x))
    sorted_x, sorted_y = gain_x[order], gain_y[order]
    best = np.maximum.accumulate(np.concatenate([[-np.inf], sorted_y]))
    opens = np.concatenate([[True], sorted_x[1:] != sorted_x[:-1]])[: len(order)]
    group = np.maximum.accumulate(np.where(opens, np.arange(len(order)), 0))  # where designs of the same x begin
    stays = (sorted_y > best[group]) & (sorted_y == sorted_y[group])
    return np.asarray(order[stays], dtype=np.int64)


def drawable_front(
    x: Array, y: Array, larger: tuple[bool, bool], drawable: Callable[[int], bool], attempts: int
) -> Front:
    """The front of the designs that can be drawn: those that cannot make room for the ones behind them.

    Parameters
    ----------
    x, y, larger
        As for `non_dominated`.
    drawable : callable
        Whether the design at a place can be drawn; called at most `attempts` times.
    """
    alive, known, lost = np.arange(len(x)), set[int](), list[int]()
    while True:
        places = alive[non_dominated(x[alive], y[alive], *larger)]
        fresh = [int(place) for place in places if int(place) not in known]
        tried = fresh[: attempts - len(known)]
        if not tried:
            return Front(places, np.array(sorted(lost), dtype=np.int64), len(fresh))
        known.update(tried)
        found = [place for place in tried if not drawable(place)]
        lost += found
        alive = alive[~np.isin(alive, found)]


def spread(x: Array, y: Array, count: int) -> Index:
    """Places (at most `count`,) along a front (m,) in order, ends included, about equally far apart along it.

    Distances are measured with both spans taken as one.
    """
    steps = np.hypot(*(np.diff(v) / (np.ptp(v) or 1.0) for v in (x, y)))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    targets = np.linspace(0.0, along[-1], count) if count > 1 else along[-1:] / 2
    return np.unique(np.abs(along[:, None] - targets).argmin(axis=0))


class Percentile(NamedTuple):
    """A percentile of a sample and its confidence interval; an end is infinite where the sample is too small for it."""

    percent: float
    value: float
    low: float
    high: float


def percentiles(
    values: Array, percent: Sequence[float], draws: Index | None = None, confidence: float = CONFIDENCE
) -> list[Percentile]:
    """Percentiles of a sample and their distribution-free confidence intervals.

    Parameters
    ----------
    values : (n,)
        At least one, finite, in any order.
    percent : sequence of float
        Between 0 and 100, both excluded.
    draws : (n,), optional
        Number of the independent draw that each value belongs to, from 0; None when each is its own.
    confidence : float
        Least probability that an interval holds the true percentile; about that with `draws`.

    Notes
    -----
    Of n draws, the number below the true percentile is binomial, so that the true percentile lies between two order
    statistics with a probability known for every continuous distribution (H. A. David, H. N. Nagaraja, Order
    Statistics, 3rd ed., Wiley 2003, section 7.1). Half of what is left is allowed on each side. Where values share a
    draw, the share below the percentile scatters from draw to draw (R. S. Woodruff, J. Am. Stat. Assoc. 47 (1952) 635).
    """
    from scipy.stats import binom, norm

    ordered, n, tail = np.sort(values), len(values), (1 - confidence) / 2
    found = []
    for p in percent:
        middle, share = float(np.percentile(ordered, p)), p / 100
        if draws is None:
            first, last = int(binom.ppf(tail, n, share)), int(binom.ppf(1 - tail, n, share)) + 1
        else:
            excess, m = np.bincount(draws, (values <= middle) - share), int(np.sum(np.bincount(draws) > 0))
            width = norm.ppf(1 - tail) * np.sqrt(m / (m - 1) * np.sum(excess**2)) if m > 1 else n
            first, last = int(np.floor(n * share - width)), int(np.ceil(n * share + width)) + 1
        low = -np.inf if first < 1 else float(ordered[first - 1])
        found.append(Percentile(p, middle, low, np.inf if last > n else float(ordered[last - 1])))
    return found


class Indices(NamedTuple):
    """Sobol indices of one value, (k,) in the order of the factors, and half-widths of their confidence intervals.

    `total` and `total_band` are None where the sample does not tell them.
    """

    first: Array
    first_band: Array
    total: Array | None = None
    total_band: Array | None = None


def sensitivity(loaded: LoadedStudy, table: StudyTable, value: str) -> Indices:
    """Sobol indices of an output column: first order, and total where Saltelli's scheme was sampled.

    Raises
    ------
    BadInput
        The study is not sampled for it; a design of Saltelli's scheme has no answer (each belongs to as many
        differences as there are factors, so that none can be left out); too few have one; or the value does not vary.
    """
    where, method = f"{loaded.path}: sensitivity of {value}", loaded.study.sampling.method
    if method == "saltelli":
        bad = np.flatnonzero(~table.ok)
        if missing := loaded.count - len(table.design):
            raise BadInput(f"{where}: {missing} of {loaded.count} designs are not computed, expected all")
        if len(bad):
            raise BadInput(
                f"{where}: {len(bad)} of {loaded.count} designs have no answer, expected all to have one; the first is "
                f"design {table.design[bad[0]]}: {table.status[bad[0]]}: {table.reason[bad[0]]}"
            )
    (answers,) = table.answered(value)
    if len(answers) < LEAST and method != "saltelli":
        raise BadInput(f"{where}: {len(answers)} designs have an answer, expected at least {LEAST}")
    if np.ptp(answers) <= FLAT * scale_of(table, value):
        raise BadInput(f"{where}: no factor changes it, expected a value that varies")
    if method == "saltelli":
        return sobol_indices(answers, len(loaded.columns))
    return first_order((table.answered(column.name)[0] for column in loaded.columns), answers)


def sobol_indices(answers: Array, factors: int) -> Indices:
    """First-order and total indices of answers (base * (factors + 2),) in the order of Saltelli's scheme in `sample`.

    Notes
    -----
    A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, table 2 (b) and (f); intervals as `_half_widths`.
    """
    groups = answers.reshape(-1, factors + 2)
    groups = groups - groups[:, [0, -1]].mean()
    A, AB, B = groups[:, 0], groups[:, 1:-1].T, groups[:, -1]
    variance = np.var([A, B])
    first, total = np.mean(B * (AB - A), axis=1) / variance, np.mean((A - AB) ** 2, axis=1) / (2 * variance)
    size = (A**2 + B**2) / 2
    return Indices(first, _half_widths(B * (AB - A), size, first), total, _half_widths((A - AB) ** 2 / 2, size, total))


def first_order(factors: Iterable[Array], answers: Array) -> Indices:
    """First-order indices from any sample: k `factors` (n,), of which one is held at a time, and answers (n,).

    Notes
    -----
    What a smooth curve in one factor alone explains of the variance (given-data estimation: E. Plischke, E. Borgonovo,
    C. L. Smith, Eur. J. Oper. Res. 226 (2013) 536; local polynomials: S. Da Veiga, F. Wahl, F. Gamboa, Technometrics 51
    (2009) 452). The curve is a straight line in each of about n^(1/3) equally filled bins, or the mean of each value of
    a list; `1 - s_r^2 / s^2`, both variances by their degrees of freedom, so that noise explains nothing on average.
    Of factors that depend on one another the shares overlap: what a factor explains through the others counts too.
    """
    n, size, found = len(answers), (answers - answers.mean()) ** 2, []
    for column in factors:
        residual, numbers = _residual(column, answers)
        left = residual**2 * (n / (n - numbers))
        share = np.asarray(1.0 - left.mean() / (size.sum() / (n - 1)))
        found.append((float(share), float(_half_widths(size - left, size, share))))
    return Indices(*(np.array(part) for part in zip(*found, strict=True)))


def _half_widths(parts: Array, size: Array, index: Array) -> Array:
    """Half-widths (k,) of confidence intervals of indices (k,): means of parts (k, n) over that of size (n,).

    Notes
    -----
    Normal, linearised: the variance of a ratio of means (W. G. Cochran, Sampling Techniques, 3rd ed., Wiley 1977).
    """
    from scipy.special import ndtri

    off = (parts - index[..., None] * size) / size.mean()
    return np.asarray(ndtri((1 + CONFIDENCE) / 2) * off.std(axis=-1, ddof=1) / np.sqrt(len(size)))


def _residual(column: Array, answers: Array) -> tuple[Array, int]:
    """What a curve in one factor (n,) leaves of the answers (n,), and how many numbers the curve has."""
    levels, group = np.unique(column, return_inverse=True)
    lines = len(levels) > FEW_LEVELS
    if lines:
        bins = min(MOST_BINS, max(2, round(len(column) ** (1 / 3))))
        group = np.searchsorted(np.quantile(column, np.linspace(0, 1, bins + 1)[1:-1]), column)
    counts = np.maximum(np.bincount(group), 1)
    x, y = (v - (np.bincount(group, v) / counts)[group] for v in (column, answers))
    if not lines:
        return y, len(levels)
    square = np.bincount(group, x * x)
    slope = np.bincount(group, x * y) / np.where(square > 0, square, 1.0)
    return y - slope[group] * x, 2 * len(counts)


def round_off_in(table: StudyTable, value: str) -> float:
    """Up to which size numbers of a column are round-off of what symmetry makes zero, beside medians of the others."""
    if value not in {*CROSS, *PARTS, *DRIFTS[:2]} or not table.ok.any():
        return 0.0
    beside = [name for name in (*STIFFNESSES[:3], *DRIFTS) if name in table.columns]
    medians = {n: np.median(np.abs(v), keepdims=True) for n, v in zip(beside, table.answered(*beside), strict=True)}
    return float(round_off_of(medians)[value].max())


def scale_of(table: StudyTable, value: str) -> float:
    """Size against which a change of an output is round-off or not: of what symmetry can make zero, what it couples."""
    if value in COUPLINGS:
        return 1.0
    if value in CROSS:
        one, other = CROSS[value]
        return float(np.sqrt(np.median(table.columns[one] * table.columns[other])))
    return float(np.abs(table.columns[value]).max())


class Extremes(NamedTuple):
    """Of a map: the least and the most of its value, (value, x, y) each, in file units; and its cells."""

    least: tuple[float, float, float]
    most: tuple[float, float, float]
    cells: Cells


class Marks(NamedTuple):
    """Of a distribution: the percentiles `MARKED` of every value."""

    percentiles: Mapping[str, Sequence[Percentile]]


class Shares(NamedTuple):
    """Of a sensitivity: the indices of every value, in the order of the columns `factors`."""

    factors: Sequence[str]
    indices: Mapping[str, Indices]


class Best(NamedTuple):
    """Of a Pareto figure: places are among the designs that have an answer.

    Attributes
    ----------
    front : Front
        The best designs.
    unchecked : int
        How many of them may turn out impossible to draw.
    chosen, values : mapping
        Some of them as stages, and their factors (columns,), by place, in the order of the front.
    power : float, optional
        Slope of log y over log x along the front, least squares; None where it has none.
    gain : float, optional
        y over the base stage's y, of the best design no worse in x and no larger; None where there is none.
    """

    front: Front
    unchecked: int
    chosen: Mapping[int, Stage]
    power: float | None
    gain: float | None
    values: Mapping[int, Array]


class Refused(NamedTuple):
    """Of a figure that cannot be drawn from this table: why, in one line."""

    reason: str


Shown: TypeAlias = Extremes | Marks | Shares | Best | Refused


def findings(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float]) -> list[Shown]:
    """What every figure of a study file shows.

    Parameters
    ----------
    nominal : mapping
        The base stage's values by column, where known.

    Raises
    ------
    BadInput
        Nothing has an answer; a figure that cannot be drawn for reasons of its own is `Refused`.
    """
    if not table.ok.any():
        raise BadInput(f"{loaded.path}: none of {len(table.design)} designs has an answer, expected some to draw")
    found = list[Shown]()
    for figure in loaded.study.figure:
        try:
            found.append(_finding(loaded, table, nominal, figure))
        except BadInput as error:
            found.append(Refused(str(error)))
    return found


def _finding(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> Shown:
    for name, _ in figure.columns.values():
        bad = np.flatnonzero(table.ok & ~np.isfinite(table.columns[name]))
        if len(bad):
            raise BadInput(
                f"{loaded.path}: {figure.kind} of {name}: no finite number for {len(bad)} of {int(table.ok.sum())} "
                f"designs with an answer, expected one for each; the first is design {table.design[bad[0]]}"
            )
    names = figure.values or ()
    match figure.kind:
        case "map":
            cells = cells_of(loaded, table, (figure.x or "", figure.y or ""), figure.value or "")
            known = np.isfinite(cells.values)
            if not known.any():
                raise BadInput(
                    f"{loaded.path}: map of {figure.value}: no design to show keeps all constraints, expected some"
                )
            value, (x, y) = cells.values[known], cells.points[known].T
            least, most = ((float(value[k]), float(x[k]), float(y[k])) for k in (value.argmin(), value.argmax()))
            return Extremes(least, most, cells)
        case "distribution":
            saltelli = loaded.study.sampling.method == "saltelli"  # whose rows of one Sobol point are one draw
            draws = table.design[table.ok] // (len(loaded.columns) + 2) if saltelli else None
            return Marks({name: percentiles(table.answered(name)[0], MARKED, draws) for name in names})
        case "sensitivity":
            factors = [column.name for column in loaded.columns]
            return Shares(factors, {name: sensitivity(loaded, table, name) for name in names})
        case "pareto":
            return _best(loaded, table.considered, nominal, figure)


def _best(loaded: LoadedStudy, table: StudyTable, nominal: Mapping[str, float], figure: Figure) -> Best:
    x, y = table.answered(figure.x or "", figure.y or "")
    if len(x) == 0:
        raise BadInput(f"{loaded.path}: pareto of {figure.y}: no design keeps all constraints, expected some")
    answered = table.design[table.ok]

    def values_at(place: int) -> Array:
        return np.asarray(sample(loaded, int(answered[place]), int(answered[place]) + 1)[0])

    def can_be_drawn(place: int) -> bool:
        return drawable(loaded, values_at(place)) is not None

    larger = (figure.x_better == "larger", figure.y_better == "larger")
    attempts = 0 if loaded.study.draws else ATTEMPTS  # what was drawn before it was answered can be drawn
    front = drawable_front(x, y, larger, can_be_drawn, attempts)
    log = {column.name for column in loaded.columns if column.factor.scale == "log"}
    one, other = (
        np.log(v[front.places]) if name in log or wide(v[front.places]) else v[front.places]
        for name, v in ((figure.x, x), (figure.y, y))
    )
    values = {int(place): values_at(int(place)) for place in front.places[spread(one, other, figure.drawn)]}
    chosen = {place: drawable(loaded, row) for place, row in values.items()}
    return Best(
        front,
        front.unchecked if attempts else 0,
        {place: stage for place, stage in chosen.items() if stage is not None},
        power_of(x[front.places], y[front.places]),
        _gain(table, nominal, figure, can_be_drawn),
        values,
    )


def drawable(loaded: LoadedStudy, values: Array) -> Stage | None:
    """The stage of factor values (columns,), None when it cannot be made."""
    try:
        stage = stage_of(loaded, values)
        check_feasible(stage)
    except (BadInput, ValidationError):
        return None
    return stage


def power_of(x: Array, y: Array) -> float | None:
    """Slope of log y over log x (m,), by least squares; None for one x alone, or values that are not positive."""
    if np.min(x) <= 0 or np.min(y) <= 0 or np.ptp(np.log(x)) == 0:
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def _gain(
    table: StudyTable, nominal: Mapping[str, float], figure: Figure, can_be_drawn: Callable[[int], bool]
) -> float | None:
    """What the best drawable design gains in y over the base stage, at no cost in x and size."""
    x, y = figure.x or "", figure.y or ""
    if not {x, y, SIZE} <= nominal.keys() or nominal[y] == 0:
        return None
    reached, gained, size = table.answered(x, y, SIZE)
    sign = {"larger": 1.0, "smaller": -1.0}
    fits = np.flatnonzero((sign[figure.x_better] * (reached - nominal[x]) >= 0) & (size <= nominal[SIZE]))
    ordered = fits[np.argsort(-sign[figure.y_better] * gained[fits], kind="stable")]
    best = next((place for place in ordered[:ATTEMPTS].tolist() if can_be_drawn(place)), None)
    return None if best is None else float(gained[best] / nominal[y])
