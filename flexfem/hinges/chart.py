"""Charts of finite elements of one hinge, interpolated: compliances over beam integrals, and what thickness changes.

The files `flexfem/data/hinge_chart.json` and `hinge_chart_high.json` hold the compliances in plane stress on grids of
t/R and H/h (H the height of the blocks beside the notch, h = 2R + t the notch's), H/h 1 to 3 and 3 to 60, made by
`python -m flexfem.fem.chart`; they say with which versions, meshes and uncertainties. Read here, every sample is
divided by the beam integral at its t/R: the quotient is near one and smooth in sqrt(t/R), in whose powers the two
differ for thin necks, and in log(H/h).

As H/h grows, the notch sees two half-planes. A moment's field there fades as 1/r^2, so the rotation has a limit; a
force's fades as 1/r, and the point where it acts moves by `2 F ln(r) / (pi E b)` more, whether it pulls or shears
(Flamant; K. L. Johnson, Contact Mechanics, 1985, sections 2.2 and 2.3), so that axial and shear compliance grow by
`SPREADING ln(H/h) / (E b)`. What remains is smooth in h/H down to zero: a polynomial in h/H through the samples of the
second file holds for every H/h from 3 on.

The file `flexfem/data/thickness_chart.json` holds, on a grid of t/R, b/t and Poisson's ratio, the position p of a
hinge of thickness b between plane stress and plane strain, C = C_ps (1 - nu^2 p), made by
`python -m flexfem.fem.chart`; `flexfem/fem/hinge.py` defines it. It hardly depends on nu, is near 0 where the
neck is thin out of plane and near 1 where it is wide, in rotation; a pulled neck stays much nearer to plane stress.
On the same grid it holds the highest von Mises stress in the notch over that in plane stress, by a moment and a pull.
"""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import Array
from flexfem.hinges import beam
from flexfem.hinges.beam import SHEAR_CORRECTION
from flexfem.sources import read_data

FREEDOMS = ("rotation", "axial", "shear")
SPREADING = 4.0 / np.pi  # of two half-planes
GROWTH = np.array([0.0, SPREADING, SPREADING])  # of rotation, axial, shear, per ln(H/h)
AXES, SCALES = ("t/R", "b/t", "nu"), (np.sqrt, np.log, np.positive)  # of the thickness chart, and what it is smooth in
ROUND_OFF = 1e-9  # relative; a block as high as the notch, added up in another order, is still on the chart


class Factors(NamedTuple):
    """Compliances (...) over their beam integrals, shear at nu = 0; nan outside the chart."""

    rotation: Array
    axial: Array
    shear: Array


class Patch(NamedTuple):
    """Chebyshev series of the factors over a range of heights.

    ratios, heights : smallest and largest t/R and H/h of the range that was sampled.
    measure : of H/h, the scale on which the factors, less their growth with it, are smooth.
    series : (3, n, m), coefficients in sqrt(t/R) and the measured H/h for rotation, axial, shear.
    bands : (3,), largest relative uncertainty of a sample, for each.
    """

    ratios: tuple[float, float]
    heights: tuple[float, float]
    measure: np.ufunc
    series: Array
    bands: Array

    def at(self, tau: Array, eta: Array) -> Array:
        """The series (3, ...) at t/R and H/h (...)."""
        across = _vander(tau, self.ratios, np.sqrt, self.series.shape[1])
        along = _vander(eta, self.heights, self.measure, self.series.shape[2])
        return np.array([np.einsum("...m,...m->...", across @ series, along) for series in self.series])


class HingeChart(NamedTuple):
    """The factors for every height: `low` up to its largest H/h, `high` beyond."""

    low: Patch
    high: Patch

    @property
    def ratios(self) -> tuple[float, float]:
        """Smallest and largest t/R; beyond them the chart says nothing."""
        return self.low.ratios

    @property
    def least_height(self) -> float:
        """Smallest H/h; there is no largest."""
        return self.low.heights[0]

    @property
    def bands(self) -> Array:
        """Largest relative uncertainty of a sample (3,), for rotation, axial, shear."""
        return np.maximum(self.low.bands, self.high.bands)

    def covers(self, ratio: ArrayLike, height: ArrayLike) -> NDArray[np.bool_]:
        """Whether t/R and H/h (broadcast against each other) are on the chart."""
        return _within(ratio, self.ratios) & _within(height, (self.least_height, np.inf)) & np.isfinite(height)

    def factors(self, ratio: ArrayLike, height: ArrayLike) -> Factors:
        """Factors (...) at t/R and H/h, broadcast against each other."""
        tau, eta = np.broadcast_arrays(np.asarray(ratio, dtype=float), np.asarray(height, dtype=float))
        inside, within = self.covers(tau, eta), np.clip(tau, *self.ratios)
        found = self.low.at(within, np.clip(eta, *self.low.heights))
        beyond = inside & (eta > self.low.heights[1] * (1 + ROUND_OFF))
        if np.any(beyond):
            stout, high = within[beyond], eta[beyond]
            found[:, beyond] = self.high.at(stout, high) + _growth(stout, high)
        return Factors(*np.where(inside, found, np.nan))


def beam_integrals(tau: Array) -> Array:
    """Beam integrals (3, ...) that the factors multiply: E b R^2 theta/M, E b dx/F_x, E b dy/F_y at nu = 0."""
    axial = beam.axial_paros_weisbord(tau)
    shear = beam.bending_closed(tau) + 2.0 * SHEAR_CORRECTION * axial
    return np.stack([beam.rotation_paros_weisbord(tau), axial, shear])


@cache
def hinge_chart() -> HingeChart:
    """The chart in the package, read once."""
    low, high = (read_data(f"{name}.json") for name in ("hinge_chart", "hinge_chart_high"))
    return HingeChart(read_patch(low, np.log, 0.0 * GROWTH), read_patch(high, np.reciprocal, GROWTH))


def read_patch(text: str, measure: np.ufunc, growth: Array) -> Patch:
    """The chart of a file's text: the polynomial through all samples, whose points must be Chebyshev's.

    growth : (3,), of the compliances per ln(H/h), taken off them.
    """
    found = json.loads(text)
    ratios, heights = (tuple(found["range"][name]) for name in ("t/R", "H/h"))
    tau, eta = np.array(found["t/R"]), np.array(found["H/h"])
    samples = np.array([found[name] for name in FREEDOMS]) - growth[:, None, None] * np.log(eta)
    factors = samples / beam_integrals(tau)[:, :, None]
    across = np.linalg.inv(_vander(tau, ratios, np.sqrt, len(tau)))
    along = np.linalg.inv(_vander(eta, heights, measure, len(eta)))
    bands = np.array([found["largest_band"][name] for name in FREEDOMS])
    return Patch(ratios, heights, measure, across @ factors @ along.T, bands)


class Positions(NamedTuple):
    """Positions (...) between plane stress, 0, and plane strain, 1; nan outside the chart."""

    rotation: Array
    axial: Array


class StressFactors(NamedTuple):
    """Highest von Mises stress (...) over that in plane stress; nan outside the chart."""

    bending: Array
    tension: Array


class ThicknessChart(NamedTuple):
    """Chebyshev series of the positions and of the stress factors.

    ratios, widths, poissons : smallest and largest t/R, b/t and nu; beyond them the chart says nothing.
    series : (4, n, m, k), coefficients in sqrt(t/R), log(b/t) and nu for rotation, axial, bending stress and tension's.
    bands : (2,), largest uncertainty of a sample in terms of the compliance, relative, for rotation and axial.
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
        return Positions(*self._at(ratio, width, poissons_ratio)[:2])

    def stress_factors(self, ratio: ArrayLike, width: ArrayLike, poissons_ratio: ArrayLike) -> StressFactors:
        """Stress factors (...) at t/R, b/t and nu, broadcast against each other."""
        return StressFactors(*self._at(ratio, width, poissons_ratio)[2:])

    def _at(self, *point: ArrayLike) -> Array:
        at = [np.asarray(values, dtype=float) for values in point]
        ends = (self.ratios, self.widths, self.poissons)
        along = [_vander(np.clip(at[k], *ends[k]), ends[k], SCALES[k], self.series.shape[k + 1]) for k in range(3)]
        found = np.einsum("fijk,...i,...j,...k->f...", self.series, *along, optimize=True)
        return np.where(self.covers(*at), found, np.nan)


def thickness_factors(radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike) -> Factors:
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


def on_thickness_chart(
    radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike
) -> NDArray[np.bool_]:
    """Whether hinges are on the chart; arguments as for `thickness_factors`."""
    t = np.asarray(neck, dtype=float)
    return thickness_chart().covers(t / np.asarray(radius), np.asarray(thickness) / t, poissons_ratio)


@cache
def thickness_chart() -> ThicknessChart:
    """The chart in the package, read once."""
    return read_thickness_chart(read_data("thickness_chart.json"))


def read_thickness_chart(text: str) -> ThicknessChart:
    """The chart of a file's text: the polynomial through all samples, whose points must be Chebyshev's."""
    found = json.loads(text)
    ends = [tuple(found["range"][name]) for name in AXES]
    at = [np.array(found[name]) for name in AXES]
    inverses = [np.linalg.inv(_vander(*each, len(each[0]))) for each in zip(at, ends, SCALES, strict=True)]
    samples = [found["rotation"], found["axial"], found["stress"]["bending"], found["stress"]["tension"]]
    bands = np.array([found["largest_band"][name] for name in FREEDOMS[:2]])
    series = np.einsum("fabc,ia,jb,kc->fijk", np.array(samples), *inverses, optimize=True)
    ratios, widths, poissons = ends
    return ThicknessChart(ratios, widths, poissons, series, bands)


def _growth(tau: Array, eta: Array) -> Array:
    """What the height of the blocks adds to the factors (3, n) at t/R and H/h (n,)."""
    return GROWTH[:, None] * np.log(eta) / beam_integrals(tau)


def _vander(values: Array, ends: tuple[float, float], measure: np.ufunc, terms: int) -> Array:
    """Chebyshev polynomials (..., terms) of values on the scale of a measure between its ends."""
    low, high = measure(ends)
    scaled = np.asarray(2.0 * (measure(values) - low) / (high - low) - 1.0)
    return np.asarray(chebvander(scaled, terms - 1)).reshape(*scaled.shape, terms)  # numpy makes a row of a number


def _within(values: ArrayLike, ends: tuple[float, float]) -> NDArray[np.bool_]:
    v = np.asarray(values, dtype=float)
    inside: NDArray[np.bool_] = (v >= ends[0] * (1 - ROUND_OFF)) & (v <= ends[1] * (1 + ROUND_OFF))
    return inside
