"""Dimensionless compliances of the circular notch as functions of t/R, after each author and by quadrature.

With tau = t/R every author's compliance is a pure number of tau over a dimensional factor:

    rotation  theta/M  = rotation(tau) / (E b R^2)
    axial     dx/F_x   = axial(tau)    / (E b)
    bending   dy/F_y   = bending(tau)  / (E b),  the part of the shear compliance that bending makes

Integrals run over the notch, x = R sin(theta) in -R..R, depth h(x) = t + 2 R - 2 sqrt(R^2 - x^2).
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)  # 1e-12 or better for t/R from 1e-4 upwards


def quadrature(tau: Array, power_of_x: int, power_of_depth: int) -> Array:
    """Integral of (x/R)^m (h/R)^-n d(x/R) over the notch by Gauss quadrature; shape of `tau`.

    Notes
    -----
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

    Notes
    -----
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


def rotation_paros_weisbord_short(tau: Array) -> Array:
    """Limit of (2) for t << R: theta/M = 9 pi sqrt(R) / (2 E b t^(5/2))."""
    return 4.5 * np.pi * tau**-2.5


def axial_paros_weisbord_short(tau: Array) -> Array:
    """Limit of (3) for t << R as printed, dx/F_x = (pi sqrt(R/t) - 2.57)/(E b); 2.57 stands for 1 + pi/2."""
    return np.pi / np.sqrt(tau) - 2.57


def rotation_wu_zhou(tau: Array) -> Array:
    """E b R^2 theta/M in s = R/t."""
    s = 1.0 / tau
    root = np.sqrt(4.0 * s + 1.0)
    rational = 2.0 * s**3 * (6.0 * s**2 + 4.0 * s + 1.0) / ((2.0 * s + 1.0) * root**4)
    transcendental = 12.0 * s**4 * (2.0 * s + 1.0) / root**5 * np.arctan(root)
    value: Array = 12.0 * (rational + transcendental)
    return value


def axial_wu_zhou(tau: Array) -> Array:
    """E b dx/F_x in s = R/t."""
    s = 1.0 / tau
    root = np.sqrt(4.0 * s + 1.0)
    return 2.0 * (2.0 * s + 1.0) / root * np.arctan(root) - 0.5 * np.pi


def rotation_lobontiu(tau: Array) -> Array:
    """E b R^2 theta/M of the symmetric circular hinge, with r = 1 and t = tau."""
    m = tau * (4.0 + tau)
    rational = m * (6.0 + 4.0 * tau + tau**2)
    angle = np.arctan(np.sqrt(1.0 + 4.0 / tau))
    return 24.0 / (m**3 * (2.0 + tau)) * (rational + 6.0 * (2.0 + tau) ** 2 * np.sqrt(m) * angle)


def axial_lobontiu(tau: Array) -> Array:
    """E b dx/F_x of the symmetric circular hinge."""
    m = tau * (4.0 + tau)
    return 2.0 * (2.0 + tau) / np.sqrt(m) * np.arctan(np.sqrt(1.0 + 4.0 / tau)) - 0.5 * np.pi


def bending_lobontiu(tau: Array) -> Array:
    """E b dy/F_y about the centre: the form printed for a force at the hinge's end, minus R^2 theta/M.

    Notes
    -----
    The difference of two numbers 1/tau times larger: 2e-11 of rounding at t/R = 1e-4, 1e-13 from 0.005 upwards.
    """
    m = tau * (4.0 + tau)
    quartic = -80.0 + 24.0 * tau + 8.0 * (3.0 + 2.0 * np.pi) * tau**2 + 4.0 * (1.0 + 2.0 * np.pi) * tau**3
    rational = 2.0 * (2.0 + np.pi) + np.pi * tau + 8.0 * (44.0 + 28.0 * tau + 5.0 * tau**2) / m**2
    rational = rational + (2.0 + tau) * (quartic + np.pi * tau**4) / m**2
    angle = np.arctan(np.sqrt(1.0 + 4.0 / tau))
    transcendental = 8.0 * (2.0 + tau) ** 4 * (-6.0 + 4.0 * tau + tau**2) / m**2.5 * angle
    at_end = 0.75 / (2.0 + tau) * (rational - transcendental)
    return at_end - rotation_lobontiu(tau)


def rotation_smith_chetwynd(tau: Array) -> Array:
    """theta/M = 24 K R/(E b t^3) with K = 0.565 t/R + 0.166."""
    return 24.0 * (0.565 * tau + 0.166) * tau**-3.0


def rotation_koster(tau: Array) -> Array:
    """M/theta = 0.093 sqrt(t/(2R)) E b t^2."""
    return 1.0 / (0.093 * np.sqrt(0.5 * tau) * tau**2)


def rotation_schotborgh(tau: Array) -> Array:
    """M/theta = (E b t^2/12) (-0.0089 + 1.3556 sqrt(t/(2R)) - 0.5227 t/(2R)); not positive below t/R of 1e-4."""
    return 12.0 / (tau**2 * (-0.0089 + 1.3556 * np.sqrt(0.5 * tau) - 0.5227 * 0.5 * tau))
