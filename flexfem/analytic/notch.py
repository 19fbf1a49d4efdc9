"""The circular hinge as three springs, after a named formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic import beam
from flexfem.analytic.beam import SHEAR_CORRECTION
from flexfem.analytic.chart import hinge_chart
from flexfem.arrays import Array


class Compliance(NamedTuple):
    """Compliances of a hinge about its neck centre in its own frame, where they are uncoupled.

    rotation : (...), 1/(N mm), angle of the two bodies per moment.
    axial : (...), mm/N, stretch along the neck per force along it.
    shear : (...), mm/N, sideways displacement per force across the neck at its centre.
    """

    rotation: Array
    axial: Array
    shear: Array


@dataclass(frozen=True)
class Formula:
    """A published hinge formula in dimensionless form, with what is known of its origin.

    name : the key in `FORMULAS`.
    source : citation.
    status : how sure the printed form is, and what it was compared with.
    valid : smallest and largest t/R for which the formula is meant (`status` says who says so).
    rotation, axial, bending : pure numbers of t/R (see `beam`), None where the source states none.
    """

    name: str
    source: str
    status: str
    valid: tuple[float, float]
    rotation: Callable[[Array], Array]
    axial: Callable[[Array], Array] | None = None
    bending: Callable[[Array], Array] | None = None

    @property
    def freedoms(self) -> tuple[str, ...]:
        """The compliances that the source itself states; the others are Paros-Weisbord's."""
        stated = (("rotation", self.rotation), ("axial", self.axial), ("shear", self.bending))
        return tuple(freedom for freedom, function in stated if function is not None)

    def in_range(self, radius: ArrayLike, neck: ArrayLike, block_height: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Whether t/R is where the formula is meant to be used; shape of `radius` and `neck` broadcast.

        `block_height` as for `compliance`.
        """
        tau = np.asarray(neck, dtype=float) / np.asarray(radius, dtype=float)
        inside: NDArray[np.bool_] = (tau >= self.valid[0]) & (tau <= self.valid[1])
        return inside

    def compliance(
        self,
        radius: ArrayLike,
        neck: ArrayLike,
        thickness: ArrayLike,
        youngs_modulus: ArrayLike,
        poissons_ratio: ArrayLike,
        block_height: ArrayLike | None = None,
    ) -> Compliance:
        """Compliances about the neck centre; arguments in mm and MPa broadcast against each other.

        Parameters
        ----------
        block_height : height H of the bodies beside the notch, None for the notch's own, 2R + t. Published formulas
            know the notch alone and leave it aside.

        Notes
        -----
        dy/F_y = int x^2/(E I) dx + kappa int dx/(G A), and int dx/(G A) = 2 (1 + nu) int dx/(E A).
        Outside `in_range` the value is returned all the same: the caller reports it.
        """
        R, t, b, E, nu = (np.asarray(v, dtype=float) for v in (radius, neck, thickness, youngs_modulus, poissons_ratio))
        tau = t / R
        axial = (self.axial or beam.axial_paros_weisbord)(tau)
        bending = (self.bending or beam.bending_closed)(tau)
        stretch = axial if self.bending is not None else beam.axial_paros_weisbord(tau)
        return Compliance(
            rotation=self.rotation(tau) / (E * b * R**2),  # (2)
            axial=axial / (E * b) + 0.0 * nu,  # (3)
            shear=(bending + SHEAR_CORRECTION * 2.0 * (1.0 + nu) * stretch) / (E * b),
        )


@dataclass(frozen=True)
class ChartedFormula(Formula):
    """Beam integrals times the factors of the hinge chart: plane-stress finite elements, interpolated.

    least_height : smallest H/h on the chart; there is no largest.
    """

    least_height: float = 1.0

    def in_range(self, radius: ArrayLike, neck: ArrayLike, block_height: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Whether t/R and H/h are on the chart; the arguments broadcast."""
        return hinge_chart().covers(*_shape_of_notch(radius, neck, block_height))

    def compliance(
        self,
        radius: ArrayLike,
        neck: ArrayLike,
        thickness: ArrayLike,
        youngs_modulus: ArrayLike,
        poissons_ratio: ArrayLike,
        block_height: ArrayLike | None = None,
    ) -> Compliance:
        """As `Formula.compliance`, but nan outside `in_range`: a chart is not extrapolated.

        Notes
        -----
        Poisson's ratio acts on shear alone, and exactly as in a beam of the blocks' height: `flexfem/fem/hinge.py`.
        """
        b, E, nu = (np.asarray(v, dtype=float) for v in (thickness, youngs_modulus, poissons_ratio))
        tau, eta = _shape_of_notch(radius, neck, block_height)
        factors = hinge_chart().factors(tau, eta)
        slender = super().compliance(radius, neck, b, E, 0.0)
        stretch = 2.0 / (eta * (2.0 + tau))  # 2R/H
        return Compliance(
            rotation=factors.rotation * slender.rotation,
            axial=factors.axial * slender.axial + 0.0 * nu,
            shear=factors.shear * slender.shear + SHEAR_CORRECTION * 2.0 * nu * stretch / (E * b),
        )


def _shape_of_notch(radius: ArrayLike, neck: ArrayLike, block_height: ArrayLike | None) -> tuple[Array, Array]:
    """t/R and H/h, broadcast."""
    R, t = np.asarray(radius, dtype=float), np.asarray(neck, dtype=float)
    high = 2.0 * R + t
    tau, eta = np.broadcast_arrays(t / R, (high if block_height is None else np.asarray(block_height)) / high)
    return tau, eta
