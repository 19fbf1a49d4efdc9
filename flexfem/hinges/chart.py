"""The notch as a beam and by finite elements: beam integrals, and charts of what elements and thickness change of them.

With tau = t/R the beam integrals are pure numbers of tau: rotation theta/M times E b R^2, axial dx/F_x and bending
dy/F_y (the part of shear that bending makes) times E b, over x = R sin(theta) in -R..R, where the depth is
h(x) = t + 2 R - 2 sqrt(R^2 - x^2).

`python -m flexfem.fem.chart` makes the files in `flexfem/data`; they say with which versions, meshes and uncertainties.
`hinge_chart.json` and `hinge_chart_high.json` hold compliances in plane stress on grids of t/R and H/h (H the height of
the blocks beside the notch, h = 2R + t the notch's), H/h 1 to 3 and 3 to 60. Over the beam integrals they are smooth in
sqrt(t/R) and in log(H/h). As H/h grows the notch sees two half-planes: the rotation has a limit, axial and shear
compliance grow by `SPREADING ln(H/h) / (E b)` (Flamant; K. L. Johnson, Contact Mechanics, 1985, sections 2.2 and 2.3),
and what remains is a polynomial in h/H, which holds for every H/h from 3 on.

`thickness_chart.json` holds, over t/R, b/t and Poisson's ratio, the position p of a hinge of thickness b between plane
stress and plane strain, C = C_ps (1 - nu^2 p), and the highest von Mises stress over that in plane stress.
"""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import Array
from flexfem.sources import read_data

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)  # 1e-12 or better for t/R from 1e-4 upwards


def quadrature(tau: Array, power_of_x: int, power_of_depth: int) -> Array:
    """Integral of (x/R)^m (h/R)^-n d(x/R) over the notch by Gauss quadrature; shape of `tau`.

    x = R sin(theta) and theta = sqrt(tau) sinh(w): the first removes the vertical tangent of h at the ends, the
    second moves the poles of 1/h, which close in on the neck as +- i sqrt(tau), to the fixed distance pi/2.
    """
    scale = np.sqrt(np.asarray(tau, dtype=float))[..., None]
    end = np.arcsinh(0.5 * np.pi / scale)
    theta = scale * np.sinh(end * NODES)
    depth = scale**2 + 4.0 * np.sin(0.5 * theta) ** 2
    jacobian = np.cos(theta) * scale * np.cosh(end * NODES) * end
    value: Array = np.sum(WEIGHTS * np.sin(theta) ** power_of_x * depth**-power_of_depth * jacobian, axis=-1)
    return value


def rotation_paros_weisbord(tau: Array) -> Array:
    """E b R^2 alpha_z/M_z (2), for any depth gamma; here the full notch, gamma = 1 + beta."""
    beta = 0.5 * tau
    gamma = 1.0 + beta
    q = 2.0 * beta + beta**2
    s = np.sqrt(1.0 - (1.0 + beta - gamma) ** 2)
    A = np.arctan(np.sqrt((2.0 + beta) / beta) * (gamma - beta) / s)
    short = ((1.0 + beta) / gamma**2 + (3.0 + 2.0 * beta + beta**2) / (gamma * q)) * s
    return 1.5 / q * (short + 6.0 * (1.0 + beta) / q**1.5 * A)  # (2)


def axial_paros_weisbord(tau: Array) -> Array:
    """E b dx/F_x (3) of the full notch."""
    beta = 0.5 * tau
    q = 2.0 * beta + beta**2
    A = np.arctan(np.sqrt((2.0 + beta) / beta))
    return 2.0 * (1.0 + beta) / np.sqrt(q) * A - 0.5 * np.pi  # (3)


def bending_closed(tau: Array) -> Array:
    """E b int x^2 dx/(E I) in closed form; our own algebra.

    With h = 2 R (c - cos theta), c = 1 + beta, and J_n = int (c - cos theta)^-n d theta over -pi/2..pi/2, integration
    by parts of sin theta * sin theta cos theta / (c - cos theta)^3 leaves J_1 and J_2. It loses two digits to
    cancellation at t/R = 2 and none for thin necks.
    """
    beta = 0.5 * tau
    c = 1.0 + beta
    q = 2.0 * beta + beta**2
    J1 = 4.0 / np.sqrt(q) * np.arctan(np.sqrt((2.0 + beta) / beta))
    J2 = (2.0 / c + c * J1) / q
    return 0.75 * ((2.0 * c**2 - 1.0) * J2 - 4.0 * c * J1 + 2.0 * np.pi)


FREEDOMS = ("rotation", "axial", "shear")
SPREADING = 4.0 / np.pi  # of two half-planes
GROWTH = np.array([0.0, SPREADING, SPREADING])  # of rotation, axial, shear, per ln(H/h)
ROUND_OFF = 1e-9  # relative; a block as high as the notch, added up in another order, is still on the chart


class Compliance(NamedTuple):
    """Compliances of a hinge about its neck centre in its own frame, where they are uncoupled; or factors on them.

    rotation : 1/(N mm), angle of the two bodies per moment.   axial : mm/N, stretch along the neck per force along it.
    shear : mm/N, sideways displacement per force across the neck at its centre.
    """

    rotation: Array
    axial: Array
    shear: Array


class Series(NamedTuple):
    """Chebyshev series of some numbers over a box.

    ends : smallest and largest of each of d coordinates that was sampled.
    scales : of these, on which the numbers are smooth.
    coefficients : (numbers, n, m, ...).
    """

    ends: tuple[tuple[float, float], ...]
    scales: tuple[np.ufunc, ...]
    coefficients: Array

    @classmethod
    def through(
        cls, ends: tuple[tuple[float, float], ...], scales: tuple[np.ufunc, ...], points: list[Array], samples: Array
    ) -> Series:
        """The polynomial through all samples (numbers, n, m, ...), whose points must be Chebyshev's."""
        for axis, at in enumerate(points, start=1):
            inverse = np.linalg.inv(_vander(at, ends[axis - 1], scales[axis - 1], len(at)))
            samples = np.moveaxis(np.tensordot(inverse, samples, axes=(1, axis)), 0, axis)
        return cls(ends, scales, samples)

    def covers(self, *point: ArrayLike) -> NDArray[np.bool_]:
        """Whether coordinates (broadcast against each other) are in the box."""
        inside = [_within(*pair) for pair in zip(point, self.ends, strict=True)]
        return np.asarray(np.logical_and.reduce(np.broadcast_arrays(*inside)))

    def at(self, *point: ArrayLike) -> Array:
        """The numbers (numbers, ...) at coordinates (...), broadcast; nan outside the box."""
        nearest = [np.clip(np.asarray(at, dtype=float), *ends) for at, ends in zip(point, self.ends, strict=True)]
        return np.where(self.covers(*point), self.continued(*nearest), np.nan)

    def continued(self, *point: Array) -> Array:
        """The numbers (numbers, ...) at coordinates (...), broadcast, outside the box too."""
        parts = zip(point, self.ends, self.scales, self.coefficients.shape[1:], strict=True)
        along = [_vander(at, ends, scale, terms) for at, ends, scale, terms in parts]
        axes = "ijk"[: len(along)]
        terms = ",".join(f"...{axis}" for axis in axes)
        return np.asarray(np.einsum(f"f{axes},{terms}->f...", self.coefficients, *along, optimize=True))


class HingeChart(NamedTuple):
    """The factors in t/R and H/h for every height: `low` up to its largest H/h, `high` beyond, less its growth."""

    low: Series
    high: Series

    def covers(self, ratio: ArrayLike, height: ArrayLike) -> NDArray[np.bool_]:
        """Whether t/R and H/h (broadcast against each other) are on the chart; there is no largest H/h."""
        return _within(ratio, self.low.ends[0]) & _within(height, (self.low.ends[1][0], np.inf)) & np.isfinite(height)

    def factors(self, ratio: ArrayLike, height: ArrayLike) -> Compliance:
        """Factors (...) at t/R and H/h, broadcast against each other."""
        tau, eta = np.broadcast_arrays(np.asarray(ratio, dtype=float), np.asarray(height, dtype=float))
        found = self.low.at(tau, eta)
        beyond = self.covers(tau, eta) & (eta > self.low.ends[1][1] * (1 + ROUND_OFF))
        if np.any(beyond):
            within, high = np.clip(tau[beyond], *self.low.ends[0]), eta[beyond]
            grown = GROWTH[:, None] * np.log(high) / beam_integrals(within)
            found[:, beyond] = self.high.continued(within, high) + grown
        return Compliance(*found)


def beam_integrals(tau: Array) -> Array:
    """Beam integrals (3, ...) that the factors multiply: E b R^2 theta/M, E b dx/F_x, E b dy/F_y at nu = 0."""
    axial = axial_paros_weisbord(tau)
    shear = bending_closed(tau) + 2.0 * SHEAR_CORRECTION * axial
    return np.stack([rotation_paros_weisbord(tau), axial, shear])


@cache
def hinge_chart() -> HingeChart:
    """The chart in the package, read once."""
    parts = []
    for name, measure, growth in (("hinge_chart", np.log, 0.0), ("hinge_chart_high", np.reciprocal, GROWTH)):
        found = json.loads(read_data(f"{name}.json"))
        tau, eta = np.array(found["t/R"]), np.array(found["H/h"])
        samples = np.array([found[freedom] for freedom in FREEDOMS]) - np.reshape(growth, (-1, 1, 1)) * np.log(eta)
        ends = tuple(found["range"]["t/R"]), tuple(found["range"]["H/h"])
        factors = samples / beam_integrals(tau)[:, :, None]
        parts.append(Series.through(ends, (np.sqrt, measure), [tau, eta], factors))
    return HingeChart(*parts)


@cache
def thickness_chart() -> Series:
    """The chart in the package, read once, over t/R, b/t and nu.

    Positions in rotation and axially, 0 in plane stress and 1 in plane strain, and the highest von Mises stress by a
    moment and by a pull over that in plane stress.
    """
    found, axes = json.loads(read_data("thickness_chart.json")), ("t/R", "b/t", "nu")
    points, ends = [np.array(found[axis]) for axis in axes], tuple(tuple(found["range"][axis]) for axis in axes)
    stress = found["stress"]
    samples = np.array([found["rotation"], found["axial"], stress["bending"], stress["tension"]])
    return Series.through(ends, (np.sqrt, np.log, np.positive), points, samples)


def thickness_factors(
    radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike
) -> Compliance:
    """Factors (...), at most 1, of the plane-stress compliances of hinges; lengths in mm, the arguments broadcast.

    nan where t/R, b/t or nu is not on the chart.

    Shear is taken as far from plane stress to plane strain as rotation. Its plane-strain limit follows from its
    plane-stress value `S0 + 4.8 nu R/H` (`flexfem/fem/chart.py`) with `E/(1 - nu^2)` and `nu/(1 - nu)` in place of E
    and nu: `(1 - nu^2) S0 + 4.8 nu (1 + nu) R/H`.
    """
    R, t, b, nu = (np.asarray(value, dtype=float) for value in (radius, neck, thickness, poissons_ratio))
    tau = t / R
    rotation, axial = thickness_chart().at(tau, b / t, nu)[:2]
    slender = beam_integrals(tau)[2] * hinge_chart().factors(tau, 1.0).shear
    stretch = 4.0 * SHEAR_CORRECTION / (2.0 + tau)
    softening = (slender - stretch) / (slender + stretch * nu)
    return Compliance(1.0 - nu**2 * rotation, 1.0 - nu**2 * axial, 1.0 - nu**2 * rotation * softening)


def _vander(values: Array, ends: tuple[float, float], measure: np.ufunc, terms: int) -> Array:
    """Chebyshev polynomials (..., terms) of values on the scale of a measure between its ends."""
    low, high = measure(ends)
    scaled = np.asarray(2.0 * (measure(values) - low) / (high - low) - 1.0)
    return np.asarray(chebvander(scaled, terms - 1)).reshape(*scaled.shape, terms)  # numpy makes a row of a number


def _within(values: ArrayLike, ends: tuple[float, float]) -> NDArray[np.bool_]:
    v = np.asarray(values, dtype=float)
    inside: NDArray[np.bool_] = (v >= ends[0] * (1 - ROUND_OFF)) & (v <= ends[1] * (1 + ROUND_OFF))
    return inside
