"""Compliance of a notch: beam integrals, and charts of their corrections from finite elements.

The beam integrals are dimensionless functions of tau = t/R: rotation theta/M times E b R^2, axial
dx/F_x and bending dy/F_y (the bending part of the shear compliance) times E b, over x = R
sin(theta) in -R..R, where the depth is h(x) = t + 2 R - 2 sqrt(R^2 - x^2).

`benchmarks/hinge_charts.py` makes the files in `flexfem/data`, which state their versions, meshes
and uncertainties. `hinge_chart.json` and `hinge_chart_high.json` hold plane-stress compliances on
grids of t/R and H/h (H is the height of the blocks beside the notch, h = 2R + t that of the notch)
for H/h from 1 to 3 and from 3 to 60. Divided by the beam integrals they are smooth in sqrt(t/R) and
log(H/h). For large H/h the blocks act as half-planes: rotation tends to a limit, axial and shear
compliance grow by `SPREADING ln(H/h) / (E b)` (Flamant; K. L. Johnson, Contact Mechanics, 1985,
sections 2.2 and 2.3), and the remainder is a polynomial in h/H, valid for every H/h from 3.

`thickness_chart.json` holds, over t/R, b/t and Poisson's ratio, the position p of a hinge of
thickness b between plane stress and plane strain, C = C_ps (1 - nu^2 p), and the ratio of its
highest von Mises stress to that in plane stress."""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import Array
from flexfem.mechanism.profile_beam import SHEAR_CORRECTION as SHEAR_CORRECTION
from flexfem.sources import read_data

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)  # 1e-12 or better for t/R from 1e-4 upwards


def quadrature(
    tau: Array,
    power_of_x: int,
    power_of_depth: int,
) -> Array:
    """Integral of (x/R)^m (h/R)^-n d(x/R) over the notch by Gauss quadrature; shape of `tau`.

    x = R sin(theta) removes the vertical tangent of h at the ends. theta = sqrt(tau) sinh(w) moves
    the poles of 1/h, which approach the neck as +- i sqrt(tau), to the fixed distance pi/2."""
    scale = np.sqrt(np.asarray(tau, dtype=float))[..., None]
    end = np.arcsinh(0.5 * np.pi / scale)
    theta = scale * np.sinh(end * NODES)
    depth = scale**2 + 4.0 * np.sin(0.5 * theta) ** 2
    jacobian = np.cos(theta) * scale * np.cosh(end * NODES) * end
    integrand = np.sin(theta) ** power_of_x * depth**-power_of_depth
    return np.asarray(np.sum(WEIGHTS * integrand * jacobian, axis=-1))


def rotation_paros_weisbord(tau: Array) -> Array:
    """E b R^2 alpha_z/M_z by (2), which holds for any depth gamma; here gamma = 1 + beta."""
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

    With h = 2 R (c - cos theta), c = 1 + beta, and J_n = int (c - cos theta)^-n d theta over
    -pi/2..pi/2, integration by parts of sin theta * sin theta cos theta / (c - cos theta)^3 leaves
    J_1 and J_2. Cancellation costs two digits at t/R = 2 and none for thin necks."""
    beta = 0.5 * tau
    c = 1.0 + beta
    q = 2.0 * beta + beta**2
    J1 = 4.0 / np.sqrt(q) * np.arctan(np.sqrt((2.0 + beta) / beta))
    J2 = (2.0 / c + c * J1) / q
    return 0.75 * ((2.0 * c**2 - 1.0) * J2 - 4.0 * c * J1 + 2.0 * np.pi)


FREEDOMS = ("rotation", "axial", "shear")
SPREADING = 4.0 / np.pi  # of two half-planes
GROWTH = np.array([0.0, SPREADING, SPREADING])  # of rotation, axial, shear, per ln(H/h)
ROUND_OFF = 1e-9  # relative; a block as high as the notch is on the chart in spite of rounding


class Compliance(NamedTuple):
    """Uncoupled compliances of a hinge about its neck centre in its own frame, or factors on them.

    rotation : 1/(N mm), relative angle of the two bodies per moment.
    axial : mm/N, elongation per axial force.
    shear : mm/N, transverse displacement per transverse force at the neck centre.
    """

    rotation: Array
    axial: Array
    shear: Array


class Series(NamedTuple):
    """Chebyshev series of several functions over a box.

    ends : smallest and largest sampled value of each of d coordinates.
    scales : transformations of the coordinates in which the functions are smooth.
    coefficients : (functions, n, m, ...).
    """

    ends: tuple[tuple[float, float], ...]
    scales: tuple[np.ufunc, ...]
    coefficients: Array

    @classmethod
    def through(
        cls,
        ends: tuple[tuple[float, float], ...],
        scales: tuple[np.ufunc, ...],
        points: list[Array],
        samples: Array,
    ) -> Series:
        """Interpolate samples (functions, n, m, ...) at Chebyshev points."""
        coefficients = samples
        for axis, nodes in enumerate(points):
            inverse = np.linalg.inv(_vander(nodes, ends[axis], scales[axis], len(nodes)))
            along_axis = np.tensordot(inverse, coefficients, axes=(1, axis + 1))
            coefficients = np.moveaxis(along_axis, 0, axis + 1)
        return cls(ends, scales, coefficients)

    def covers(self, *point: ArrayLike) -> NDArray[np.bool_]:
        """Return whether coordinates (broadcast against each other) are in the box."""
        inside = [_within(*pair) for pair in zip(point, self.ends, strict=True)]
        return np.asarray(np.logical_and.reduce(np.broadcast_arrays(*inside)))

    def at(self, *point: ArrayLike) -> Array:
        """Return the values (functions, ...) at coordinates (...); nan outside the box."""
        clipped = list[Array]()
        for x, (low, high) in zip(point, self.ends, strict=True):
            clipped.append(np.clip(np.asarray(x, dtype=float), low, high))
        return np.where(self.covers(*point), self.extrapolated(*clipped), np.nan)

    def extrapolated(self, *point: Array) -> Array:
        """Return the values (functions, ...) at coordinates (...), also outside the box."""
        arguments = zip(point, self.ends, self.scales, self.coefficients.shape[1:], strict=True)
        bases = [_vander(*each) for each in arguments]
        axes = "ijk"[: len(bases)]
        terms = ",".join(f"...{axis}" for axis in axes)
        sums = f"f{axes},{terms}->f..."
        return np.asarray(np.einsum(sums, self.coefficients, *bases, optimize=True))


class HingeChart(NamedTuple):
    """Factors over t/R and H/h.

    `low` holds up to its largest H/h, `high` above it without the logarithmic growth.
    """

    low: Series
    high: Series

    def covers(
        self,
        ratio: ArrayLike,
        height: ArrayLike,
    ) -> NDArray[np.bool_]:
        """Return whether t/R and H/h, which broadcast, are on the chart; H/h has no upper limit."""
        ratios, (lowest, _) = self.low.ends
        is_high_enough = _within(height, (lowest, np.inf)) & np.isfinite(height)
        return _within(ratio, ratios) & is_high_enough

    def factors(
        self,
        ratio: ArrayLike,
        height: ArrayLike,
    ) -> Compliance:
        """Return the factors (...) at t/R and H/h, broadcast against each other."""
        tau = np.asarray(ratio, dtype=float)
        eta = np.asarray(height, dtype=float)
        tau, eta = np.broadcast_arrays(tau, eta)
        factors = self.low.at(tau, eta)
        ratios, (_, highest) = self.low.ends
        is_high = self.covers(tau, eta) & (eta > highest * (1 + ROUND_OFF))
        if np.any(is_high):
            high_tau = np.clip(tau[is_high], *ratios)
            high_eta = eta[is_high]
            growth = GROWTH[:, None] * np.log(high_eta) / beam_integrals(high_tau)
            factors[:, is_high] = self.high.extrapolated(high_tau, high_eta) + growth
        return Compliance(*factors)


def beam_integrals(tau: Array) -> Array:
    """Beam integrals (3, ...): E b R^2 theta/M, E b dx/F_x and E b dy/F_y at nu = 0."""
    axial = axial_paros_weisbord(tau)
    shear = bending_closed(tau) + 2.0 * SHEAR_CORRECTION * axial
    return np.stack([rotation_paros_weisbord(tau), axial, shear])


@cache
def hinge_chart() -> HingeChart:
    """Return the hinge chart of the package."""
    low = _chart_of("hinge_chart.json", np.log, np.zeros(3))
    high = _chart_of("hinge_chart_high.json", np.reciprocal, GROWTH)
    return HingeChart(low, high)


def _chart_of(
    name: str,
    scale: np.ufunc,
    growth: Array,
) -> Series:
    """Return the factors in a file over t/R and H/h, less their growth (3,) per ln(H/h).

    scale : transformation of H/h in which they are smooth.
    """
    data = json.loads(read_data(name))
    tau = np.array(data["t/R"])
    eta = np.array(data["H/h"])
    compliances = np.array([data[freedom] for freedom in FREEDOMS])
    samples = compliances - growth[:, None, None] * np.log(eta)
    ends = tuple(data["range"]["t/R"]), tuple(data["range"]["H/h"])
    factors = samples / beam_integrals(tau)[:, :, None]
    return Series.through(ends, (np.sqrt, scale), [tau, eta], factors)


@cache
def thickness_chart() -> Series:
    """Return the thickness chart of the package, over t/R, b/t and nu.

    Its functions are the positions of the rotational and the axial compliance, 0 in plane stress
    and 1 in plane strain, and the ratios of the highest von Mises stress in bending and in tension
    to that in plane stress."""
    data = json.loads(read_data("thickness_chart.json"))
    axes = ("t/R", "b/t", "nu")
    points = [np.array(data[axis]) for axis in axes]
    ends = tuple(tuple(data["range"][axis]) for axis in axes)
    stress = data["stress"]
    samples = np.array([data["rotation"], data["axial"], stress["bending"], stress["tension"]])
    return Series.through(ends, (np.sqrt, np.log, np.positive), points, samples)


def thickness_factors(
    radius: ArrayLike, neck: ArrayLike, thickness: ArrayLike, poissons_ratio: ArrayLike
) -> Compliance:
    """Return the factors (...), at most 1, on the plane-stress compliances of hinges.

    The arguments, in mm, broadcast. It is nan where t/R, b/t or nu is not on the chart.

    Notes
    -----
    Shear has the position of rotation between plane stress and plane strain. Its plane-strain limit
    follows from its plane-stress value `S0 + 4.8 nu R/H` (`benchmarks/hinge_charts.py`) with `E/(1
    - nu^2)` and `nu/(1 - nu)` in place of E and nu: `(1 - nu^2) S0 + 4.8 nu (1 + nu) R/H`.
    """
    t = np.asarray(neck, dtype=float)
    tau = t / np.asarray(radius, dtype=float)
    depth_ratio = np.asarray(thickness, dtype=float) / t
    nu = np.asarray(poissons_ratio, dtype=float)
    rotation, axial = thickness_chart().at(tau, depth_ratio, nu)[:2]
    slender = beam_integrals(tau)[2] * hinge_chart().factors(tau, 1.0).shear
    stretch = 4.0 * SHEAR_CORRECTION / (2.0 + tau)
    softening = (slender - stretch) / (slender + stretch * nu)
    return Compliance(
        rotation=1.0 - nu**2 * rotation,
        axial=1.0 - nu**2 * axial,
        shear=1.0 - nu**2 * rotation * softening,
    )


def _vander(
    values: Array,
    ends: tuple[float, float],
    scale: np.ufunc,
    terms: int,
) -> Array:
    """Return Chebyshev polynomials (..., terms) of values (...), scaled from ends to -1 and 1."""
    low, high = scale(ends)
    scaled = np.asarray(2.0 * (scale(values) - low) / (high - low) - 1.0)
    polynomials = np.asarray(chebvander(scaled, terms - 1))
    return polynomials.reshape(*scaled.shape, terms)  # numpy gives a scalar an axis


def _within(values: ArrayLike, ends: tuple[float, float]) -> NDArray[np.bool_]:
    low, high = ends
    v = np.asarray(values, dtype=float)
    return np.asarray((v >= low * (1 - ROUND_OFF)) & (v <= high * (1 + ROUND_OFF)))
