"""Hinge profiles: the height along the axis, the edge as exact curves, and the beam integrals by quadrature.

A profile is symmetric about its axis, the local x axis, and lies between x = -length / 2 and length / 2, mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.outlines import SHORTEST, Segment

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
GAUSS = np.polynomial.legendre.leggauss(64)  # on each smooth part of an edge


class Spline(NamedTuple):
    """A smooth curve through complex points (n,), mm, in their order."""

    points: tuple[complex, ...]


class Ellipse(NamedTuple):
    """An arc of an ellipse of at most a quarter turn; `major` is the vector of its major half-axis, mm."""

    start: complex
    end: complex
    centre: complex
    major: complex


Curve = Segment | Spline | Ellipse


@dataclass(frozen=True)
class Profile:
    """A hinge profile; length and smallest height `neck` in mm."""

    neck: float

    @property
    def length(self) -> float:
        """Length along the axis, mm."""
        raise NotImplementedError

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions on the axis, mm, ascending from end to end, between which the height is smooth."""
        return (-self.length / 2, 0.0, self.length / 2)

    def height(self, x: Array) -> Array:
        """Height (...), mm, at positions (...) on the axis."""
        raise NotImplementedError

    def edge(self) -> list[Curve]:
        """Return the upper edge from -length / 2 to length / 2; the lower edge is its mirror image."""
        raise NotImplementedError

    @property
    def end_height(self) -> float:
        """Height at the ends, mm."""
        return float(self.height(np.array(self.length / 2)))

    def compliance(self, youngs_modulus: float, poissons_ratio: float, thickness: float) -> Array:
        """Compliance (3, 3) of the far end relative to the near one, at the centre: axial, transverse, rotation.

        Notes
        -----
        A Timoshenko beam of the local height: `int dx / (E A)`, `int x^2 / (E I) dx + kappa int dx / (G A)` and
        `int dx / (E I)`. A force at the centre and a moment are uncoupled for a profile symmetric about its centre.
        """
        E, b = youngs_modulus, thickness
        axial, bending, moment, rotation = (self._integral(n, m) for n, m in ((0, 1), (2, 3), (1, 3), (0, 3)))
        shear = SHEAR_CORRECTION * 2 * (1 + poissons_ratio) * axial
        return np.array([[axial, 0, 0], [0, 12 * bending + shear, -12 * moment], [0, -12 * moment, 12 * rotation]]) / (
            E * b
        )

    def _integral(self, power: int, of_height: int) -> float:
        """Integral of `x^power / height^of_height` over the length."""
        total = 0.0
        for low, high in zip(self.breaks[:-1], self.breaks[1:], strict=True):
            x = low + (high - low) * (GAUSS[0] + 1) / 2
            total += float(np.sum(GAUSS[1] * x**power / self.height(x) ** of_height)) * (high - low) / 2
        return total


@dataclass(frozen=True)
class Circular(Profile):
    """A right circular hinge of notch radius `radius`, mm."""

    radius: float

    @property
    def length(self) -> float:
        return 2 * self.radius

    def height(self, x: Array) -> Array:
        return np.asarray(self.neck + 2 * self.radius - 2 * np.sqrt(np.maximum(self.radius**2 - x**2, 0.0)))

    def edge(self) -> list[Curve]:
        centre, r = 1j * (self.neck / 2 + self.radius), self.radius
        return [Segment(centre - r, centre - 1j * r, centre), Segment(centre - 1j * r, centre + r, centre)]


@dataclass(frozen=True)
class Leaf(Profile):
    """A leaf spring of uniform height with fillets of radius `fillet` at its roots, inside its length; mm."""

    span: float
    fillet: float = 0.0

    @property
    def length(self) -> float:
        return self.span

    @property
    def breaks(self) -> tuple[float, ...]:
        half, root = self.span / 2, self.fillet
        return (-half, -half + root, half - root, half) if root > SHORTEST else (-half, half)

    def height(self, x: Array) -> Array:
        inside = np.maximum(np.abs(x) - (self.span / 2 - self.fillet), 0.0)
        return np.asarray(self.neck + 2 * (self.fillet - np.sqrt(np.maximum(self.fillet**2 - inside**2, 0.0))))

    def edge(self) -> list[Curve]:
        half, r, y = self.span / 2, self.fillet, 0.5j * self.neck
        straight: list[Curve] = [Segment(-half + r + y, half - r + y)]
        if r <= SHORTEST:
            return straight
        start, end = -half + r + y + 1j * r, half - r + y + 1j * r
        return [Segment(start - r, start - 1j * r, start), *straight, Segment(end - 1j * r, end + r, end)]
