"""Many small linear programs at once: the largest c z with A z <= b, exactly.

The simplex method on the inequalities themselves, all programs one step at a time. A point is held by d constraints,
at first by d equations z_j = start_j that a step only ever drops. Their multipliers (c = sum of multiplier times row)
say which one to leave; the ratio test says which one stops the way. Every point is solved for anew from its d
constraints, so that round-off does not gather. Of equal ratios the largest slope is taken, and after `PATIENCE` steps
of no length Bland's rule, which does not cycle.

Exact: an answer is a vertex whose constraints hold and whose multipliers have the right signs, both checked with the
program as it was given. What does not pass the check is left to HiGHS, one program after the other.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index
from flexfem.refused import ComputationFailed

FLAT = 1e-11  # of a unit row: slopes and multipliers that are round-off
KEPT = 1e-9  # by which a constraint of a unit row may be broken, relative to the point
PATIENCE = 3  # steps of no length before Bland's rule

Holds: TypeAlias = NDArray[np.bool_]


class Optimum(NamedTuple):
    """Answers of p programs in d unknowns.

    value : (p,), the largest c z; inf where there is none, nan where nothing keeps the constraints.
    at : (p, d), where; nan where there is no value.
    """

    value: Array
    at: Array


def maximise(c: Array, A: Array, b: Array) -> Optimum:
    """The largest c z with A z <= b: c (p, d), A (p, k, d), k at least 1, b (p, k), all finite.

    Notes
    -----
    Columns, then rows, are scaled to largest entries and norms of one, and b to a largest entry of one. Where some
    b < 0, the start is the point that breaks the constraints least: the same method with one more unknown.
    """
    unit = _scale(np.max(np.abs(A), axis=1))
    rows = A * unit[:, None, :]
    norm = _scale(np.linalg.norm(rows, axis=2))
    rows, ends, slope = rows * norm[..., None], b * norm, c * unit
    slope = slope * _scale(np.max(np.abs(slope), axis=1))[:, None]
    span = _scale(np.max(np.abs(ends), axis=1))[:, None]
    ends = ends * span
    start, lost = np.zeros_like(slope), np.zeros(len(c), dtype=bool)
    lost |= np.any((np.max(np.abs(rows), axis=2) == 0) & (ends < 0), axis=1)
    broken = np.flatnonzero(np.any(ends < 0, axis=1) & ~lost)
    if len(broken):
        start[broken], lost[broken] = _least_broken(rows[broken], ends[broken])
    here = np.flatnonzero(~lost)
    value, at = np.full(len(c), np.nan), np.full(c.shape, np.nan)
    z, sure, unbounded = _ascend(slope[here], rows[here], ends[here], start[here])
    for place in here[~sure & ~unbounded]:
        z_one, infinite = _by_highs(slope[place], rows[place], ends[place])
        z[here == place], unbounded[here == place] = z_one, infinite
    at[here] = np.where(unbounded[:, None], np.nan, z * unit[here] / span[here])
    value[here] = np.where(unbounded, np.inf, np.sum(c[here] * at[here], axis=1))
    return Optimum(value, at)


def _scale(size: Array) -> Array:
    return np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 1.0)


def _least_broken(A: Array, b: Array) -> tuple[Array, Holds]:
    """Points (p, d) that keep A z <= b, and which programs (p,) have none."""
    p, k, d = A.shape
    worst = np.maximum(np.max(-b, axis=1), 0.0)
    wide = np.zeros((p, k + 1, d + 1))
    wide[:, :k, :d], wide[:, :, d] = A, -1.0
    start = np.zeros((p, d + 1))
    start[:, d] = worst
    slope = np.broadcast_to(-np.eye(d + 1)[d], (p, d + 1))
    ends = np.concatenate([b, np.zeros((p, 1))], axis=1)
    z, sure, _ = _ascend(slope, wide, ends, start)
    for place in np.flatnonzero(~sure):
        z[place] = _by_highs(slope[place], wide[place], ends[place])[0]
    return z[:, :d], z[:, d] > KEPT * np.maximum(worst, np.max(np.abs(z[:, :d]), axis=1, initial=0.0))


def _ascend(c: Array, A: Array, b: Array, start: Array) -> tuple[Array, Holds, Holds]:
    """Points (p, d) from a start that keeps the constraints; which are optimal for sure, and which have no end."""
    p, k, d = A.shape
    z, held = start.copy(), np.tile(-1 - np.arange(d), (p, 1))  # places of rows, -1 - j for the start's coordinate j
    sure, unbounded, idle = np.zeros(p, dtype=bool), np.zeros(p, dtype=bool), np.zeros(p, dtype=np.int64)
    todo = np.arange(p)
    for _ in range(20 + 4 * (k + d)):
        if not len(todo):
            break
        A_, b_, W = A[todo], b[todo], held[todo]
        inverted = np.asarray(np.linalg.inv(_held_rows(A_, W)), dtype=np.float64)
        z_ = np.einsum("pij,pj->pi", inverted, _held_ends(b_, W, start[todo]))
        multiplier = np.einsum("pi,pij->pj", c[todo], inverted)
        bland = idle[todo] >= PATIENCE
        leaving, gain = _leaving(multiplier, W, inverted, bland)
        slack = b_ - np.einsum("pkd,pd->pk", A_, z_)
        size = 1 + np.max(np.abs(z_), axis=1, initial=0.0)
        done = gain <= FLAT
        each = np.arange(len(todo))
        way = -np.where((W[each, leaving] < 0) & (multiplier[each, leaving] > 0), -1.0, 1.0)[:, None]
        way = way * inverted[each, :, leaving]
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        entering, step = _entering(np.einsum("pkd,pd->pk", A_, way), slack, W, bland)
        endless = ~done & np.isinf(step)
        z[todo] = z_
        kept = np.min(slack, axis=1, initial=np.inf) >= -KEPT * size
        sure[todo[done]] = kept[done]
        unbounded[todo[endless]] = kept[endless]
        on = ~done & ~endless & (np.min(slack, axis=1, initial=np.inf) >= -1e-6 * size)
        idle[todo] = np.where(step <= FLAT * size, idle[todo] + 1, 0)
        held[todo[on], leaving[on]] = entering[on]
        todo = todo[on]
    return z, sure, unbounded


def _held_rows(A: Array, W: Index) -> Array:
    """The d constraints (p, d, d) that hold each point."""
    found = (
        np.take_along_axis(A, np.maximum(W, 0)[..., None], axis=1) if A.shape[1] else np.zeros((*W.shape, W.shape[1]))
    )
    return np.where((W < 0)[..., None], np.eye(W.shape[1])[np.where(W < 0, -1 - W, 0)], found)


def _held_ends(b: Array, W: Index, start: Array) -> Array:
    """What those constraints are equal to, (p, d)."""
    found = np.take_along_axis(b, np.maximum(W, 0), axis=1)
    return np.where(W < 0, np.take_along_axis(start, np.where(W < 0, -1 - W, 0), axis=1), found)


def _leaving(multiplier: Array, W: Index, inverted: Array, bland: Holds) -> tuple[Index, Array]:
    """Which constraint (p,) to leave, and what that gains per length; by Bland's rule the first that gains."""
    gain = np.where(W < 0, np.abs(multiplier), -multiplier) / np.linalg.norm(inverted, axis=1)
    first = np.argmin(np.where(gain > FLAT, W, np.iinfo(np.int64).max), axis=1)
    best = np.where(bland, first, np.argmax(gain, axis=1))
    return best, np.max(gain, axis=1)


def _entering(slopes: Array, slack: Array, W: Index, bland: Holds) -> tuple[Index, Array]:
    """Which constraint (p,) stops the way first, and after which length; inf for none."""
    if not slopes.shape[1]:
        return np.zeros(len(W), dtype=np.int64), np.full(len(W), np.inf)
    ahead = slopes > FLAT
    np.put_along_axis(
        ahead, np.maximum(W, 0), np.where(W < 0, np.take_along_axis(ahead, np.maximum(W, 0), 1), False), 1
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(ahead, np.maximum(slack, 0.0) / slopes, np.inf)
    step = np.min(ratio, axis=1)
    tied = ahead & (ratio <= step[:, None] * (1 + FLAT) + FLAT)
    steepest = np.argmax(np.where(tied, slopes, -np.inf), axis=1)
    return np.where(bland, np.argmax(tied, axis=1), steepest), step


def _by_highs(c: Array, A: Array, b: Array) -> tuple[Array, bool]:
    """One program by HiGHS: where, and whether it has no end."""
    from scipy.optimize import linprog

    found = linprog(-c, A_ub=A, b_ub=b, bounds=(None, None), method="highs")
    if found.status == 3:
        return np.full(len(c), np.nan), True
    if found.status != 0:
        raise ComputationFailed(f"linear program: {found.message}")
    return np.asarray(found.x), False
