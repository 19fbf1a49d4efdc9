"""The hinge chart: what plane-stress finite elements of one hinge say of the beam integrals, interpolated.

The file `flexfem/data/hinge_chart.json` holds the finite elements' compliances on a grid of t/R and H/h (H the height
of the blocks beside the notch, h = 2R + t the notch's), made by `python -m flexfem.fem.chart`; it says with which
versions, meshes and uncertainties. Read here, every sample is divided by the beam integral at its t/R: the quotient is
near one and smooth in sqrt(t/R), in whose powers the two differ for thin necks, and in log(H/h).
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic import beam
from flexfem.arrays import Array

FREEDOMS = ("rotation", "axial", "shear")
ROUND_OFF = 1e-9  # relative; a block as high as the notch, added up in another order, is still on the chart


class Factors(NamedTuple):
    """Compliances (...) over their beam integrals, shear at nu = 0; nan outside the chart."""

    rotation: Array
    axial: Array
    shear: Array


class HingeChart(NamedTuple):
    """Chebyshev series of the factors.

    ratios, heights : smallest and largest t/R and H/h; beyond them the chart says nothing.
    series : (3, n, m), coefficients in sqrt(t/R) and log(H/h) for rotation, axial, shear.
    bands : (3,), largest relative uncertainty of a sample, for each.
    """

    ratios: tuple[float, float]
    heights: tuple[float, float]
    series: Array
    bands: Array

    def covers(self, ratio: ArrayLike, height: ArrayLike) -> NDArray[np.bool_]:
        """Whether t/R and H/h (broadcast against each other) are on the chart."""
        return _within(ratio, self.ratios) & _within(height, self.heights)

    def factors(self, ratio: ArrayLike, height: ArrayLike) -> Factors:
        """Factors (...) at t/R and H/h, broadcast against each other."""
        tau, eta = np.broadcast_arrays(np.asarray(ratio, dtype=float), np.asarray(height, dtype=float))
        inside = self.covers(tau, eta)
        across = _vander(np.clip(tau, *self.ratios), self.ratios, np.sqrt, self.series.shape[1])
        along = _vander(np.clip(eta, *self.heights), self.heights, np.log, self.series.shape[2])
        found = (np.einsum("...m,...m->...", across @ series, along) for series in self.series)
        return Factors(*(np.where(inside, factor, np.nan) for factor in found))


def beam_integrals(tau: Array) -> Array:
    """Beam integrals (3, ...) that the factors multiply: E b R^2 theta/M, E b dx/F_x, E b dy/F_y at nu = 0."""
    axial = beam.axial_paros_weisbord(tau)
    shear = beam.bending_closed(tau) + 2.0 * beam.SHEAR_CORRECTION * axial
    return np.stack([beam.rotation_paros_weisbord(tau), axial, shear])


@cache
def hinge_chart() -> HingeChart:
    """The chart in the package, read once."""
    return read_chart((files("flexfem") / "data" / "hinge_chart.json").read_text(encoding="utf-8"))


def read_chart(text: str) -> HingeChart:
    """The chart of a file's text: the polynomial through all samples, whose points must be Chebyshev's."""
    found = json.loads(text)
    ratios, heights = (tuple(found["range"][name]) for name in ("t/R", "H/h"))
    tau, eta = np.array(found["t/R"]), np.array(found["H/h"])
    factors = np.array([found[name] for name in FREEDOMS]) / beam_integrals(tau)[:, :, None]
    across = np.linalg.inv(_vander(tau, ratios, np.sqrt, len(tau)))
    along = np.linalg.inv(_vander(eta, heights, np.log, len(eta)))
    bands = np.array([found["largest_band"][name] for name in FREEDOMS])
    return HingeChart(ratios, heights, across @ factors @ along.T, bands)


def _vander(values: Array, ends: tuple[float, float], measure: np.ufunc, terms: int) -> Array:
    """Chebyshev polynomials (..., terms) of values measured on a root or logarithmic scale between its ends."""
    low, high = measure(ends)
    scaled = np.asarray(2.0 * (measure(values) - low) / (high - low) - 1.0)
    return np.asarray(chebvander(scaled, terms - 1)).reshape(*scaled.shape, terms)  # numpy makes a row of a number


def _within(values: ArrayLike, ends: tuple[float, float]) -> NDArray[np.bool_]:
    v = np.asarray(values, dtype=float)
    inside: NDArray[np.bool_] = (v >= ends[0] * (1 - ROUND_OFF)) & (v <= ends[1] * (1 + ROUND_OFF))
    return inside
