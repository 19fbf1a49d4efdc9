"""The circular hinge as three springs, after a named formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic import beam
from flexfem.arrays import Array
from flexfem.errors import BadInput

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
BEAM_RANGE = (1e-4, 2.0)


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

    def in_range(self, radius: ArrayLike, neck: ArrayLike) -> NDArray[np.bool_]:
        """Whether t/R is where the formula is meant to be used; shape of `radius` and `neck` broadcast."""
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
    ) -> Compliance:
        """Compliances about the neck centre; arguments in mm and MPa broadcast against each other.

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


_ENTRIES = (
    Formula(
        "paros-weisbord",
        "J. M. Paros, L. Weisbord, How to design flexure hinges, Machine Design 37, 151-156 (1965)",
        "(2) and (3) as recovered, equal to the beam integrals; shear is the Timoshenko beam integral in our own"
        " algebra. No published range: the range is where the algebra is tested. For t/R up to 1 beam theory itself is"
        " up to 16 % too stiff against plane-stress finite elements",
        BEAM_RANGE,
        beam.rotation_paros_weisbord,
        beam.axial_paros_weisbord,
    ),
    Formula(
        "paros-weisbord-short",
        "J. M. Paros, L. Weisbord (1965), approximation for t << R as widely printed",
        "found in several public sources; axial with 2.57 as printed, the limit of (3) being 1 + pi/2 = 2.5708."
        " Range ours: rotation within 1.3 % and axial within 5 % of the full form",
        (1e-4, 0.1),
        beam.rotation_paros_weisbord_short,
        beam.axial_paros_weisbord_short,
    ),
    Formula(
        "wu-zhou",
        "Y. Wu, Z. Zhou, Design calculations for flexure hinges, Rev. Sci. Instrum. 73, 3101 (2002)",
        "recalled; the same beam integrals as Paros-Weisbord in other algebra, equal to quadrature. No published range",
        BEAM_RANGE,
        beam.rotation_wu_zhou,
        beam.axial_wu_zhou,
    ),
    Formula(
        "lobontiu",
        "N. Lobontiu, Compliant Mechanisms: Design of Flexure Hinges, CRC Press (2003), symmetric circular hinge",
        "rotation and transverse form found in public code under his name, the book itself not seen; axial recalled."
        " The same beam integrals in other algebra, equal to quadrature; the transverse form holds for a force at the"
        " hinge's end and is moved to the centre here. No published range",
        BEAM_RANGE,
        beam.rotation_lobontiu,
        beam.axial_lobontiu,
        beam.bending_lobontiu,
    ),
    Formula(
        "smith-chetwynd",
        "S. T. Smith, D. G. Chetwynd, Foundations of Ultraprecision Mechanism Design, Gordon and Breach (1992)",
        "coefficients found in public code, attribution recalled; range t < R < 5 t recalled",
        (0.2, 1.0),
        beam.rotation_smith_chetwynd,
    ),
    Formula(
        "koster",
        "M. P. Koster, Constructieprincipes voor het nauwkeurig bewegen en positioneren, Twente Univ. Press (1998)",
        "recalled; 2 to 7 % from plane-stress finite elements. Published range not known, the range is the one of"
        " that comparison",
        (0.02, 1.0),
        beam.rotation_koster,
    ),
    Formula(
        "schotborgh",
        "W. O. Schotborgh et al., Dimensionless design graphs for flexure elements, Precis. Eng. 29, 41-47 (2005)",
        "recalled; within 3 % of plane-stress finite elements for t/R 0.02 to 0.3, 22 % off at 1. Published range not"
        " known, the range is where it is within 3 %",
        (0.02, 0.3),
        beam.rotation_schotborgh,
    ),
    Formula(
        "quadrature",
        "the Timoshenko beam integrals by Gauss quadrature, our own",
        "the slow reference of the closed forms; same range",
        BEAM_RANGE,
        beam.rotation_by_quadrature,
        beam.axial_by_quadrature,
        beam.bending_by_quadrature,
    ),
)

FORMULAS: dict[str, Formula] = {entry.name: entry for entry in _ENTRIES}


def formula(name: str) -> Formula:
    """The registered formula; raises BadInput with the list of names when there is none."""
    if name not in FORMULAS:
        raise BadInput(f"hinge formula {name!r} is not known, expected one of: {', '.join(FORMULAS)}")
    return FORMULAS[name]
