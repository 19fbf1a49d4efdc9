"""Out of plane: what three-dimensional finite elements of one hinge say of its plane-stress compliances, interpolated.

The file `flexfem/data/thickness_chart.json` holds, on a grid of t/R, b/t and Poisson's ratio, the position p of a
hinge of thickness b between plane stress and plane strain, C = C_ps (1 - nu^2 p), made by
`python -m flexfem.fem.thick_chart`; `flexfem/fem/thick.py` defines it. It hardly depends on nu, is near 0 where the
neck is thin out of plane and near 1 where it is wide, in rotation; a pulled neck stays much nearer to plane stress.
"""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.chart import ROUND_OFF, Factors, beam_integrals, hinge_chart
from flexfem.arrays import Array
from flexfem.sources import read_data

FREEDOMS = ("rotation", "axial")
AXES = ("t/R", "b/t", "nu")


class Positions(NamedTuple):
    """Positions (...) between plane stress, 0, and plane strain, 1; nan outside the chart."""

    rotation: Array
    axial: Array


class ThicknessChart(NamedTuple):
    """Chebyshev series of the positions.

    ratios, widths, poissons : smallest and largest t/R, b/t and nu; beyond them the chart says nothing.
    series : (2, n, m, k), coefficients in sqrt(t/R), log(b/t) and nu for rotation and axial.
    bands : (2,), largest uncertainty of a sample in terms of the compliance, relative, for each.
    """

    ratios: tuple[float, float]
    widths: tuple[float, float]
    poissons: tuple[float, float]
    series: Array
    bands: Array

    def covers(self, ratio: ArrayLike, width: ArrayLike, poissons_ratio: ArrayLike) -> NDArray[np.bool_]:
        """Whether t/R, b/t and nu (broadcast against each other) are on the chart."""
        inside = [_within(*pair) for pair in zip((ratio, width, poissons_ratio), self[:3], strict=True)]
        return inside[0] & inside[1] & inside[2]

    def positions(self, ratio: ArrayLike, width: ArrayLike, poissons_ratio: ArrayLike) -> Positions:
        """Positions (...) at t/R, b/t and nu, broadcast against each other."""
        at = [np.asarray(values, dtype=float) for values in (ratio, width, poissons_ratio)]
        ends = (self.ratios, self.widths, self.poissons)
        along = [_vander(k, np.clip(at[k], *ends[k]), ends[k], self.series.shape[k + 1]) for k in range(3)]
        found = np.einsum("fijk,...i,...j,...k->f...", self.series, *along, optimize=True)
        return Positions(*np.where(self.covers(*at), found, np.nan))


def factors(radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike) -> Factors:
    """Factors (...) of the plane-stress compliances of hinges; lengths in mm, the arguments broadcast.

    Returns
    -------
    Factors, at most 1; nan where t/R, b/t or nu is not on the chart.

    Notes
    -----
    Shear is taken as far from plane stress to plane strain as rotation. Its plane-strain limit follows from its
    plane-stress value `S0 + 4.8 nu R/H` (`flexfem/fem/hinge.py`) with `E/(1 - nu^2)` and `nu/(1 - nu)` in place of E
    and nu: `(1 - nu^2) S0 + 4.8 nu (1 + nu) R/H`.
    """
    R, t, b, nu = (np.asarray(value, dtype=float) for value in (radius, neck, thickness, poissons_ratio))
    tau = t / R
    rotation, axial = thickness_chart().positions(tau, b / t, nu)
    slender = beam_integrals(tau)[2] * hinge_chart().factors(tau, 1.0).shear
    stretch = 4.0 * SHEAR_CORRECTION / (2.0 + tau)
    softening = (slender - stretch) / (slender + stretch * nu)
    return Factors(1.0 - nu**2 * rotation, 1.0 - nu**2 * axial, 1.0 - nu**2 * rotation * softening)


def covers(radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike) -> NDArray[np.bool_]:
    """Whether hinges are on the chart; arguments as for `factors`."""
    t = np.asarray(neck, dtype=float)
    return thickness_chart().covers(t / np.asarray(radius), np.asarray(thickness) / t, poissons_ratio)


@cache
def thickness_chart() -> ThicknessChart:
    """The chart in the package, read once."""
    return read_chart(read_data("thickness_chart.json"))


def read_chart(text: str) -> ThicknessChart:
    """The chart of a file's text: the polynomial through all samples, whose points must be Chebyshev's."""
    found = json.loads(text)
    ratios, widths, poissons = (tuple(found["range"][name]) for name in AXES)
    at = [np.array(found[name]) for name in AXES]
    inverses = [np.linalg.inv(_vander(k, at[k], ends, len(at[k]))) for k, ends in enumerate((ratios, widths, poissons))]
    samples = np.array([found[name] for name in FREEDOMS])
    series = np.einsum("fabc,ia,jb,kc->fijk", samples, *inverses, optimize=True)
    bands = np.array([found["largest_band"][name] for name in FREEDOMS])
    return ThicknessChart(ratios, widths, poissons, series, bands)


def _vander(axis: int, values: Array, ends: tuple[float, float], terms: int) -> Array:
    """Chebyshev polynomials (..., terms) of values on the scale of an axis: root, logarithm, linear."""
    measure = (np.sqrt, np.log, np.positive)[axis]
    low, high = measure(ends)
    return chebvander(2.0 * (measure(values) - low) / (high - low) - 1.0, terms - 1).reshape(*values.shape, terms)


def _within(values: ArrayLike, ends: tuple[float, float]) -> NDArray[np.bool_]:
    v = np.asarray(values, dtype=float)
    inside: NDArray[np.bool_] = (v >= ends[0] * (1 - ROUND_OFF)) & (v <= ends[1] * (1 + ROUND_OFF))
    return inside
