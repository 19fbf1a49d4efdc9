"""Smooth functions of a few variables by least squares in Chebyshev polynomials, with their error.

A function that takes milliseconds is computed at some points and interpolated at many. The error is
the largest difference at points that the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

DEGREES = (2, 4, 6, 8, 10, 12, 15, 18)  # total, one after the other until the error is small
OVERSAMPLED = 1.6  # points per coefficient
CHECKED = 12  # points that a fit has not seen
MOST_POINTS = 1200
STALLED = 0.5  # ratio of two errors above which a higher degree does not help: round-off is left
MOST_OF_CORNERS = 6  # variables
SINGULAR = 1e-13  # relative: smaller singular values of a fit are zero
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)  # bases of the points of J. H. Halton (1960)


class SmoothFit(NamedTuple):
    """A function of k variables in the box from `low` to `high` (k,).

    degrees : (terms, k), of the Chebyshev polynomials in each product.
    coefficients : (terms, f), of f values.
    error : largest relative difference from the function.
    """

    low: Array
    high: Array
    degrees: Index
    coefficients: Array
    error: float

    def inside(self, points: Array) -> AnyArray:
        """Return which points (n, k) lie in the box."""
        return np.asarray(np.all((points >= self.low) & (points <= self.high), axis=-1))

    def __call__(self, points: Array) -> Array:
        """Return the values (n, f) at points (n, k)."""
        return np.asarray(_terms(self._scaled(points), self.degrees) @ self.coefficients)

    def _scaled(self, points: Array) -> Array:
        return _scaled(points, self.low, self.high)


def chebyshev_points(variables: int, count: int) -> Array:
    """Return points (count, variables) of [0, 1], dense at the ends; more begin with the same ones.

    The first ones are the corners, of few variables.
    """
    halton = np.column_stack([_radical_inverse(count, base) for base in PRIMES[:variables]])
    points = (1 - np.cos(np.pi * halton)) / 2
    if variables <= MOST_OF_CORNERS:
        corners = list(product((0.0, 1.0), repeat=variables))
        points = np.concatenate([np.reshape(corners, (-1, variables)), points])
    return points[:count]


def _radical_inverse(count: int, base: int) -> Array:
    """Return the sequence (count,) of J. G. van der Corput in a base."""
    left = np.arange(1, count + 1)
    found = np.zeros(count)
    share = 1.0
    while np.any(left):
        share /= base
        found += share * (left % base)
        left = left // base
    return found


def fitted(
    points_of: Callable[[int], Array],
    function: Callable[[Array], Array],
    accuracy: float,
    coarsest: float,
) -> SmoothFit | None:
    """Return the fit of a function to a relative accuracy, None where worse than `coarsest`.

    points_of : returns k variables (m, k) of a number of points, perhaps without some of them. More
        points begin with the same ones.
    function : returns values (f,) of variables (k,).
    """
    variables = points_of(1).shape[1]
    if variables > len(PRIMES):
        return None
    values = list[Array]()
    before = np.inf
    best: SmoothFit | None = None
    for degree in DEGREES:
        degrees = _total_degree(variables, degree)
        count = int(np.ceil(OVERSAMPLED * len(degrees)))
        if count + CHECKED > MOST_POINTS:
            break
        points = points_of(count + CHECKED)
        if len(points) - CHECKED < len(degrees):
            break
        values += [function(point) for point in points[len(values) :]]
        found = _least_squares(points, np.array(values), degrees, len(points) - CHECKED)
        if best is None or found.error < best.error:
            best = found
        is_stalled = found.error > STALLED * before
        if found.error <= accuracy or (found.error <= coarsest and is_stalled):
            break
        before = found.error
    if best is None or best.error > coarsest:
        return None
    return best


def _least_squares(
    points: Array,
    values: Array,
    degrees: Index,
    seen: int,
) -> SmoothFit:
    """Return the fit to the first points that are `seen`, and its error at the others."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    terms = _terms(_scaled(points, low, high), degrees)
    solution = np.linalg.lstsq(terms[:seen], values[:seen], rcond=SINGULAR)
    coefficients = np.asarray(solution[0], np.float64)
    off = terms[seen:] @ coefficients / values[seen:] - 1
    return SmoothFit(low, high, degrees, coefficients, float(np.max(np.abs(off))))


def _scaled(
    points: Array,
    low: Array,
    high: Array,
) -> Array:
    """Return points (n, k) scaled to -1 to 1."""
    width = np.where(high > low, high - low, 1.0)
    return np.asarray(2 * (points - low) / width - 1)


def _total_degree(variables: int, degree: int) -> Index:
    """Return the degrees (terms, variables) of all products up to a total degree."""
    found: Sequence[tuple[int, ...]] = [()]
    for _ in range(variables):
        found = [(*one, k) for one in found for k in range(degree + 1 - sum(one))]
    return np.array(found, dtype=np.int64).reshape(len(found), variables)


def _terms(scaled: Array, degrees: Index) -> Array:
    """Return the products (n, terms) of Chebyshev polynomials at scaled points (n, k)."""
    found = np.ones((len(scaled), len(degrees)))
    highest = int(degrees.max(initial=0))
    for variable in range(degrees.shape[1]):
        x = scaled[:, variable]
        polynomials = np.ones((highest + 1, len(x)))
        if highest:
            polynomials[1] = x
        for k in range(2, highest + 1):
            polynomials[k] = 2 * x * polynomials[k - 1] - polynomials[k - 2]
        found *= polynomials.T[:, degrees[:, variable]]
    return found
