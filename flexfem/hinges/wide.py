"""Compliance of a hinge as wide as the plate is thick, between plane stress and plane strain.

A hinge that bends about the normal of the plate is a plate of its own, as wide as the mechanism is
thick, whose rigidity follows the height of the profile. Where it bends, it would curve the other
way across its width, as plane stress has it; its ends at the bodies, and the change of the height,
prevent this. Here the plate of Reissner and Mindlin is solved with Legendre polynomials across the
width and finite elements of degree 4 along the axis: deflection w, rotations a and c of the normal
along the axis and across it. The tension of the hinge is that of the membrane of the same height,
with displacements u along the axis and v across it. The ends are rigid. R. D. Mindlin, J. Appl.
Mech. 18 (1951) 31; the extension by polynomials across: L. V. Kantorovich.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array, Index
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_beam import SHEAR_CORRECTION

# polynomials of every field across the width; 8 change compliances by 0.05 % at b/t = 80
ACROSS = 6
DEGREE = 4  # of the elements along the axis
ALONG = 16  # elements, between which the integral of height^-1.5 is divided evenly
# power of the height: between elements of equal length and of equal share in the rotation
DENSITY = -1.5
# ends of smaller elements, of the thickness, but of the outermost element at most
AT_ENDS = (0.15, 0.5)
SMALLEST = 0.1  # of the outermost element: for thinner plates the thickness has no effect
FINE = 2048  # intervals for the integral that divides a hinge into elements
CONTRACTION = 0.8  # share by which the ends of thin plates contract
LONG_ENDS = 12.0  # thickness over height of the ends at which it is half of that
# height over that of the neck that counts, against round-off: higher parts hardly bend
HIGHEST = 100.0
MOST_BREAKS = 9  # of a profile that elements follow; a table has as many as rows


class _Across(NamedTuple):
    """Means (k, k) over the width of products of even and odd polynomials and of their slopes."""

    even: Array
    even_slopes: Array
    odd: Array
    odd_slopes: Array
    even_with_odd_slope: Array
    odd_with_even_slope: Array


class _Along(NamedTuple):
    """Quadrature along the axis: positions x, weights and heights (e, q), mm, of e elements.

    values, slopes : (e, q, n), of the shape functions, slopes in 1/mm.
    """

    x: Array
    weights: Array
    height: Array
    values: Array
    slopes: Array


class _Term(NamedTuple):
    """A part of twice the energy, a coefficient (e, q) times two fields or their slopes.

    rows, columns : (k,), numbers of the fields.
    left, right : (e, q, n), `_Along.values` or `slopes`.
    across : (k, k), means of the products of the polynomials.
    """

    rows: Index
    columns: Index
    coefficient: Array
    left: Array
    right: Array
    across: Array


@lru_cache(4096)
def wide_factors(
    profile: Profile, poissons_ratio: float, thickness: float
) -> tuple[float, float, float]:
    """Return the ratios of axial, transverse and rotational compliance to those in plane stress.

    They hold at the centre. Under tension the ends contract by the share of `contraction`.

    poissons_ratio : of the material.   thickness : of the plate, mm.

    Notes
    -----
    Both are solved on the same elements, plane stress with a beam. Against finite elements of
    single hinges in three dimensions: see "The analytic model" in docs/three-dimensions.md.
    """
    along = _along(profile, thickness)
    shear = 1 / (SHEAR_CORRECTION * 2 * (1 + poissons_ratio))
    ratios = list[float]()
    for solve in (_membrane, _plate):
        wide = solve(along, poissons_ratio, shear, thickness, ACROSS)
        narrow = solve(along, 0.0, shear, thickness, 1)
        ratios += (np.diag(wide) / np.diag(narrow)).tolist()
    held, transverse, rotation = ratios
    contracted = float(contraction(thickness / profile.end_height))
    return held + contracted * (1 - held), transverse, rotation


def contraction(ratio: ArrayLike) -> Array:
    """Return the share (...) by which ends contract along z, 0 for rigid and 1 for free ones.

    ratio : (...), thickness of the plate over the height of the ends, where the hinge meets its
        bodies.

    Notes
    -----
    Our own fit of hinges with bodies up to 2.5 heights from their ends; see "Ends of hinges" in
    docs/three-dimensions.md.
    """
    return np.asarray(CONTRACTION / (1 + np.asarray(ratio) / LONG_ENDS))


def _along(profile: Profile, thickness: float) -> _Along:
    """Return the elements along the axis of a profile, some near its ends."""
    marks = _ends_of_elements(profile, thickness)
    points, weights, values, slopes = _element()
    half = np.diff(marks)[:, None] / 2
    x = (marks[:-1, None] + marks[1:, None]) / 2 + half * points
    count = len(half)
    return _Along(
        x,
        half * weights,
        np.minimum(profile.height(x), HIGHEST * profile.neck),
        np.broadcast_to(values, (count, *values.shape)),
        slopes / half[:, :, None],
    )


def _ends_of_elements(profile: Profile, thickness: float) -> Array:
    """Return the ends (e + 1,) of elements along a profile, mm; they follow its breaks."""
    x = np.linspace(-profile.length / 2, profile.length / 2, FINE + 1)
    density = profile.height(x) ** DENSITY
    share = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    marks = np.interp(np.linspace(0.0, share[-1], ALONG + 1), share, x)
    outermost = min(marks[1] - marks[0], marks[-1] - marks[-2])
    from_end = np.array(AT_ENDS) * np.clip(thickness, SMALLEST * outermost, outermost)
    broken = profile.breaks if len(profile.breaks) <= MOST_BREAKS else x[[0, -1]]
    needed = np.concatenate([x[0] + from_end, x[-1] - from_end, broken])
    near = np.abs(marks[:, None] - needed).min(axis=1) < np.min(np.diff(marks)) / 4
    return np.unique(np.concatenate([marks[~near], needed]))


@cache
def _element() -> tuple[AnyArray, AnyArray, Array, Array]:
    """Points and weights (q,), and values and slopes (q, n) of shape functions by Lobatto."""
    highest = np.zeros(DEGREE + 1)
    highest[DEGREE] = 1.0
    inner = np.sort(legendre.legroots(legendre.legder(highest)).real)
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    points, weights = legendre.leggauss(DEGREE + 1)
    coefficients = np.linalg.inv(legendre.legvander(nodes, DEGREE))
    values = legendre.legval(points, coefficients).T
    slopes = legendre.legval(points, legendre.legder(coefficients)).T
    return points, weights, np.asarray(values), np.asarray(slopes)


@cache
def _across(count: int) -> _Across:
    """Return the means of products of the first `count` even and odd Legendre polynomials."""
    points, weights = legendre.leggauss(2 * count + 2)
    polynomials = np.eye(2 * count)
    values = legendre.legval(points, polynomials)
    slopes = legendre.legval(points, legendre.legder(polynomials))
    even = values[0::2]
    odd = values[1::2]
    even_slopes = slopes[0::2]
    odd_slopes = slopes[1::2]
    weights = weights / 2
    return _Across(
        even * weights @ even.T,
        even_slopes * weights @ even_slopes.T,
        odd * weights @ odd.T,
        odd_slopes * weights @ odd_slopes.T,
        even * weights @ odd_slopes.T,
        odd * weights @ even_slopes.T,
    )


def _in_plane_terms(
    along: _Along, rigidity: Array, ratio: float, thickness: float, first: Index, second: Index
) -> list[_Term]:
    """Terms of the stretching or bending of a plate.

    first, second : numbers of the fields, displacements or rotations, along the axis, which are
        even across the width, and across it, which are odd.
    """
    means = _across(len(first))
    scale = 2 / thickness
    N = along.values
    D = along.slopes
    twisting = (1 - ratio) / 2 * rigidity
    return [
        _Term(first, first, rigidity, D, D, means.even),
        _Term(second, second, rigidity, N, N, scale**2 * means.odd_slopes),
        _Term(first, second, ratio * rigidity, D, N, scale * means.even_with_odd_slope),
        _Term(first, first, twisting, N, N, scale**2 * means.even_slopes),
        _Term(second, second, twisting, D, D, means.odd),
        _Term(second, first, twisting, D, N, scale * means.odd_with_even_slope),
    ]


def _membrane(
    along: _Along,
    ratio: float,
    shear: float,
    thickness: float,
    count: int,
) -> Array:
    """Return the axial compliance (1, 1) times Young's modulus and thickness."""
    u = np.arange(count)
    v = count + np.arange(count)
    terms = _in_plane_terms(along, along.height / (1 - ratio**2), ratio, thickness, u, v)
    return _compliance(along, terms, 2 * count, np.eye(1))


def _plate(
    along: _Along,
    ratio: float,
    shear: float,
    thickness: float,
    count: int,
) -> Array:
    """Return the compliance (2, 2), transverse at the centre and rotational, times E and thickness.

    shear : modulus of transverse shear over Young's modulus.
    """
    means = _across(count)
    scale = 2 / thickness
    later = np.arange(1, count)
    w = np.append(0, 1 + later)
    a = np.append(1, count + later)  # those of the mean motion are first
    c = 2 * count + np.arange(count)
    N = along.values
    D = along.slopes
    rigidity = along.height**3 / (12 * (1 - ratio**2))
    sheared = shear * along.height
    terms = [
        *_in_plane_terms(along, rigidity, ratio, thickness, a, c),
        _Term(w, w, sheared, D, D, means.even),
        _Term(a, a, sheared, N, N, means.even),
        _Term(w, a, -sheared, D, N, means.even),
        _Term(w, w, sheared, N, N, scale**2 * means.even_slopes),
        _Term(c, c, sheared, N, N, means.odd),
        _Term(c, w, -sheared, N, N, scale * means.odd_with_even_slope),
    ]
    half = float(np.sum(along.weights)) / 2
    return _compliance(along, terms, 3 * count, np.array([[1.0, 0.0], [-half, 1.0]]))


def _compliance(
    along: _Along,
    terms: Sequence[_Term],
    fields: int,
    loads: Array,
) -> Array:
    """Return the compliance (d, d) for loads (d, d) on the first d fields at the far end.

    All others are held there, and all at the near end. The matrix is banded, and kept by the
    diagonals below the main one.
    """
    from scipy.linalg import solveh_banded  # takes a tenth of a second to import

    blocks = _element_matrices(along, terms, fields)
    count, width, _ = blocks.shape
    step = width - fields  # unknowns from one element to the next
    row, column = np.tril_indices(width)
    diagonals = np.zeros((width, count * step + fields))
    for number, block in enumerate(blocks):
        diagonals[row - column, number * step + column] += block[row, column]
    kept = diagonals[:, fields : diagonals.shape[1] - fields + len(loads)]
    force = np.zeros((kept.shape[1], len(loads)))
    force[-len(loads) :] = loads
    moved = solveh_banded(kept, force, lower=True, check_finite=False)
    return np.asarray(loads.T @ moved[-len(loads) :])


def _element_matrices(
    along: _Along,
    terms: Sequence[_Term],
    fields: int,
) -> Array:
    """Return the stiffness matrices (e, n * fields, n * fields) of the elements, node by node."""
    count, _, nodes = along.values.shape
    blocks = np.zeros((count, nodes, fields, nodes, fields))
    for term in terms:
        weighted = (along.weights * term.coefficient)[:, :, None] * term.left
        block = np.einsum("eqi,eqj,kl->kleij", weighted, term.right, term.across, optimize=True)
        blocks[:, :, term.rows[:, None], :, term.columns] += block
        if term.rows is not term.columns:
            blocks[:, :, term.columns[:, None], :, term.rows] += block.transpose(1, 0, 2, 4, 3)
    return blocks.reshape(count, nodes * fields, nodes * fields)
