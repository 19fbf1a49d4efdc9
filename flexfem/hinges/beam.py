"""Dimensionless compliances of the circular notch as functions of t/R, in closed form and by quadrature.

With tau = t/R every compliance is a pure number of tau over a dimensional factor:

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
