"""Published closed forms of hinge shapes other than the circle.

`Profile.compliance` integrates these shapes numerically. All are integrals of a beam without shear,
and agree with the quadrature to round-off: they say what the literature computes with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flexfem.hinges import chart
from flexfem.mechanism.profiles import Elliptical, Leaf, Parabolic


class ShapeFormula(NamedTuple):
    """A closed form of a hinge shape, with its origin.

    source, status : as in `formulas.Formula`.
    valid : smallest and largest neck over notch depth, fillet radius or, for a leaf, length.
    functions : by freedom, of a profile: `E b` times the rotation (1/mm^2), axial and bending part
        of the transverse compliance (1) for loads at the centre.
    """

    source: str
    status: str
    valid: tuple[float, float]
    functions: dict[str, Callable[[Any], float]]

    @property
    def freedoms(self) -> tuple[str, ...]:
        """The freedoms whose compliance the source states."""
        return tuple(self.functions)


def _elliptical(
    function: Callable[..., Any], power: int, of_depth: int
) -> Callable[[Elliptical], float]:
    """Return the function of an ellipse by that of a circle, stretched along the axis.

    The radius of the circle is the depth.
    """

    def of_ellipse(p: Elliptical) -> float:
        of_circle = float(function(np.asarray(p.neck / p.depth)))
        stretch = p.length / (2 * p.depth)
        return float(of_circle * stretch**power / p.depth**of_depth)

    return of_ellipse


def _fillets(p: Leaf) -> tuple[float, float, float]:
    """Return neck, fillet radius, and `arctan(sqrt(1 + 4 r/t)) sqrt(t (4 r + t))`."""
    t = p.neck
    r = p.fillet
    angle = math.atan(math.sqrt(1 + 4 * r / t))
    return t, r, angle * math.sqrt(t * (4 * r + t))


def _filleted_rotation(p: Leaf) -> float:
    t, r, angle = _fillets(p)
    polynomial = t * (4 * r + t) * (6 * r**2 + 4 * r * t + t**2)
    transcendental = 6 * r * (2 * r + t) ** 2 * angle
    scale = 2 * r / ((2 * r + t) * (4 * r + t) ** 3)
    ends = scale * (polynomial + transcendental)
    return 12 / t**3 * (p.length - 2 * r + ends)


def _filleted_axial(p: Leaf) -> float:
    t, r, angle = _fillets(p)
    straight = (p.length - 2 * r) / t
    ends = 2 * (2 * r + t) / (t * (4 * r + t)) * angle - math.pi / 2
    return straight + ends


def _parabolic(p: Parabolic) -> tuple[float, float, float, float]:
    """Return `q = 2 depth / neck` and integrals of `(1 + q s^2)^-n`, s from 0 to 1, n = 1, 2, 3."""
    q = 2 * p.depth / p.neck
    first = math.atan(math.sqrt(q)) / math.sqrt(q)
    second = (1 / (1 + q) + first) / 2
    return q, first, second, 1 / (4 * (1 + q) ** 2) + 0.75 * second


def _parabolic_shear(p: Parabolic) -> float:
    q, _, second, third = _parabolic(p)
    return 3 * (p.length / p.neck) ** 3 * (second - third) / q


TESTED = "; the range is where the algebra is tested, none is published"

SHAPE_FORMULAS = {
    "elliptical": ShapeFormula(
        "S. T. Smith, V. G. Badami, J. S. Dale, Y. Xu, Elliptical flexure hinges, Rev. Sci. "
        "Instrum. 68, 1474 (1997)",
        "cited from memory: the integrals of the circle, scaled, by the eccentric angle; shear "
        f"derived here{TESTED}",
        (1e-3, 2.0),
        {
            "rotation": _elliptical(chart.rotation_paros_weisbord, 1, 2),
            "axial": _elliptical(chart.axial_paros_weisbord, 1, 0),
            "shear": _elliptical(chart.bending_closed, 3, 0),
        },
    ),
    "filleted": ShapeFormula(
        "N. Lobontiu, J. S. N. Paine, E. Garcia, M. Goldfarb, Corner-filleted flexure hinges, J. "
        "Mech. Des. 123, 346 (2001)",
        f"cited from memory{TESTED}",
        (1e-3, 2.0),
        {"rotation": _filleted_rotation, "axial": _filleted_axial},
    ),
    "leaf": ShapeFormula(
        "uniform beam, any textbook",
        "exact for a beam; its ends yield in real bodies. The range is our choice",
        (1e-4, 0.2),
        {
            "rotation": lambda p: 12 * p.length / p.neck**3,
            "axial": lambda p: p.length / p.neck,
            "shear": lambda p: (p.length / p.neck) ** 3,
        },
    ),
    "parabolic": ShapeFormula(
        "N. Lobontiu, J. S. N. Paine, E. O'Malley, M. Samuelson, Parabolic and hyperbolic "
        "flexure hinges, Precis. Eng. 26, 183 (2002)",
        f"not checked in the paper: its integrals, derived here{TESTED}",
        (1e-3, 2.0),
        {
            "rotation": lambda p: 12 * p.length / p.neck**3 * _parabolic(p)[3],
            "axial": lambda p: p.length / p.neck * _parabolic(p)[1],
            "shear": _parabolic_shear,
        },
    ),
}
