"""Spring models of the circular hinge: published, calibrated, and of the user."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import Array
from flexfem.files.refusals import one_line, shown
from flexfem.hinges import chart
from flexfem.hinges.chart import SHEAR_CORRECTION, Compliance, hinge_chart
from flexfem.refused import BadInput, printed
from flexfem.sources import load_own


@dataclass(frozen=True)
class Formula:
    """A hinge formula in dimensionless form, with its origin.

    name : the key in `FORMULAS`.   source : citation.
    status : certainty of the printed form, and the comparisons made with it.
    valid : smallest and largest t/R for which the formula is valid; `status` states the origin.
    rotation, axial, bending : functions of t/R (see `chart`), None where the source states none.
    charted : whether they are multiplied by the hinge chart, which is not extrapolated.
    """

    name: str
    source: str
    status: str
    valid: tuple[float, float]
    rotation: Callable[[Array], Array]
    axial: Callable[[Array], Array] | None = None
    bending: Callable[[Array], Array] | None = None
    charted: bool = False

    @property
    def freedoms(self) -> tuple[str, ...]:
        """The freedoms whose compliance the source states; the others are Paros-Weisbord's."""
        functions = (("rotation", self.rotation), ("axial", self.axial), ("shear", self.bending))
        return tuple(freedom for freedom, function in functions if function is not None)

    def in_range(
        self, radius: ArrayLike, neck: ArrayLike, block_height: ArrayLike | None = None
    ) -> NDArray[np.bool_]:
        """Return whether t/R (and H/h) is in the range; arguments are those of `compliance`."""
        tau, eta = _notch_ratios(radius, neck, block_height)
        if self.charted:
            return hinge_chart().covers(tau, eta)
        return np.asarray((tau >= self.valid[0]) & (tau <= self.valid[1]))

    def compliance(
        self,
        radius: ArrayLike,
        neck: ArrayLike,
        thickness: ArrayLike,
        youngs_modulus: ArrayLike,
        poissons_ratio: ArrayLike,
        block_height: ArrayLike | None = None,
    ) -> Compliance:
        """Return the compliances about the neck centre.

        Arguments in mm and MPa broadcast against each other.

        Parameters
        ----------
        block_height : height H of the bodies beside the notch; None takes that of the notch,
            2R + t. Published formulas ignore it.

        Notes
        -----
        dy/F_y = int x^2/(E I) dx + kappa int dx/(G A), and int dx/(G A) = 2 (1 + nu) int dx/(E A).
        With a chart, Poisson's ratio affects shear alone, and exactly as in a beam of the height of
        the blocks: `benchmarks/hinge_charts.py`. Outside `in_range` a chart gives nan and another
        formula its value, on which the caller warns.
        """
        R = np.asarray(radius, dtype=float)
        t = np.asarray(neck, dtype=float)
        nu = np.asarray(poissons_ratio, dtype=float)
        Eb = np.asarray(youngs_modulus, dtype=float) * np.asarray(thickness, dtype=float)
        tau = t / R
        rotation, axial, bending = self._dimensionless(tau)
        # E b int dx/(E A), of the source where it states a bending
        beam = axial if self.bending is not None else chart.axial_paros_weisbord(tau)
        factors = Compliance(*np.ones(3))
        poisson_beam = beam
        if self.charted:
            tau, eta = _notch_ratios(R, t, block_height)
            factors = hinge_chart().factors(tau, eta)
            poisson_beam = 2.0 / (eta * (2.0 + tau))  # 2R/H
        by_shear_stress = SHEAR_CORRECTION * 2.0 * beam
        by_poissons_ratio = SHEAR_CORRECTION * 2.0 * nu * poisson_beam
        shear = factors.shear * (bending + by_shear_stress) + by_poissons_ratio
        return Compliance(
            rotation=factors.rotation * rotation / (Eb * R**2),  # (2)
            axial=factors.axial * axial / Eb + 0.0 * nu,  # (3)
            shear=shear / Eb,
        )

    def _dimensionless(self, tau: Array) -> tuple[Array, Array, Array]:
        """Return rotation, axial and bending at t/R, those of Paros-Weisbord where none is stated.

        Raises BadInput where a function of the user gives no finite positive numbers.
        """
        title = f"hinge formula {self.name!r}"
        axial = self.axial or chart.axial_paros_weisbord
        bending = self.bending or chart.bending_closed
        return (
            _values(f"{title}: function", self.rotation, tau),
            _values(f"{title}: axial", axial, tau),
            _values(f"{title}: bending", bending, tau),
        )


def _notch_ratios(
    radius: ArrayLike, neck: ArrayLike, block_height: ArrayLike | None
) -> tuple[Array, Array]:
    """Return t/R and H/h, broadcast."""
    R = np.asarray(radius, dtype=float)
    t = np.asarray(neck, dtype=float)
    h = 2.0 * R + t
    H = h if block_height is None else np.asarray(block_height)
    tau, eta = np.broadcast_arrays(t / R, H / h)
    return tau, eta


BEAM_RANGE = (1e-4, 2.0)
EXPECTED = "expected finite positive numbers of the shape of t/R"
LONGEST_ERROR = 120  # characters quoted of the exception of a user's function

_ENTRIES = (
    Formula(
        "paros-weisbord",
        "J. M. Paros, L. Weisbord, How to design flexure hinges, Machine Design 37, 151-156 (1965)",
        "(2) and (3) as recovered, equal to the beam integrals; shear is the Timoshenko beam "
        "integral, derived here. No published range: the range is where the algebra is tested. "
        "For t/R up to 1 beam theory is up to 16 % stiffer than plane-stress finite elements",
        BEAM_RANGE,
        chart.rotation_paros_weisbord,
        chart.axial_paros_weisbord,
    ),
    Formula(
        "paros-weisbord-short",
        "J. M. Paros, L. Weisbord (1965), approximation for t << R as widely printed",
        "from several public sources; axial with 2.57 as printed; the limit of (3) is 1 + pi/2 = "
        "2.5708. Range chosen here: rotation within 1.3 % and axial within 5 % of the full form",
        (1e-4, 0.1),
        lambda tau: 4.5 * np.pi * tau**-2.5,
        lambda tau: np.pi / np.sqrt(tau) - 2.57,
    ),
    Formula(
        "wu-zhou",
        "Y. Wu, Z. Zhou, Design calculations for flexure hinges, Rev. Sci. Instrum. 73, 3101 "
        "(2002)",
        "cited from memory; the same beam integrals as Paros-Weisbord in other algebra, computed "
        "by those formulas. No published range",
        BEAM_RANGE,
        chart.rotation_paros_weisbord,
        chart.axial_paros_weisbord,
    ),
    Formula(
        "lobontiu",
        "N. Lobontiu, Compliant Mechanisms: Design of Flexure Hinges, CRC Press (2003), "
        "symmetric circular hinge",
        "rotation and transverse form from public code under his name, not checked in the book; "
        "axial form from memory. The same beam integrals in other algebra, computed by the "
        "formulas of Paros-Weisbord; the transverse form is for a force at the hinge's end and "
        "is moved to the centre. No published range",
        BEAM_RANGE,
        chart.rotation_paros_weisbord,
        chart.axial_paros_weisbord,
        chart.bending_closed,
    ),
    Formula(
        "smith-chetwynd",
        "S. T. Smith, D. G. Chetwynd, Foundations of Ultraprecision Mechanism Design, Gordon and "
        "Breach (1992)",
        "coefficients from public code; attribution and range t < R < 5 t from memory",
        (0.2, 1.0),
        lambda tau: 24.0 * (0.565 * tau + 0.166) * tau**-3.0,  # theta/M = 24 K R/(E b t^3)
    ),
    Formula(
        "koster",
        "M. P. Koster, Constructieprincipes voor het nauwkeurig bewegen en positioneren, Twente "
        "Univ. Press (1998)",
        "cited from memory; 2 to 7 % from plane-stress finite elements. Published range not "
        "known; the range is that of the comparison",
        (0.02, 1.0),
        # M/theta = 0.093 sqrt(t/(2R)) E b t^2
        lambda tau: 1.0 / (0.093 * np.sqrt(0.5 * tau) * tau**2),
    ),
    Formula(
        "schotborgh",
        "W. O. Schotborgh et al., Dimensionless design graphs for flexure elements, Precis. Eng. "
        "29, 41-47 (2005)",
        "cited from memory; within 3 % of plane-stress finite elements for t/R 0.02 to 0.3, 22 % "
        "at 1. Published range not known; the range is where it is within 3 %",
        (0.02, 0.3),
        lambda tau: 12.0 / (tau**2 * (-0.0089 + 1.3556 * np.sqrt(0.5 * tau) - 0.5227 * 0.5 * tau)),
    ),
    Formula(
        "quadrature",
        "Timoshenko beam integrals by Gauss quadrature, flexfem",
        "slow reference for the closed forms; same range",
        BEAM_RANGE,
        lambda tau: 12.0 * chart.quadrature(tau, 0, 3),
        lambda tau: chart.quadrature(tau, 0, 1),
        lambda tau: 12.0 * chart.quadrature(tau, 2, 3),
    ),
    Formula(
        "calibrated",
        "plane-stress finite elements of one hinge between elastic blocks, flexfem "
        "(flexfem/data/hinge_chart.json)",
        "the full beam integrals times charted factors, for the height of the links beside the "
        "notch, any H/h from 1; mesh-extrapolated and interpolated to 1e-4 or better. It has no "
        "value outside its range of t/R. H/h above 3: hinge_chart_high.json",
        hinge_chart().low.ends[0],
        chart.rotation_paros_weisbord,
        chart.axial_paros_weisbord,
        chart.bending_closed,
        charted=True,
    ),
)

FORMULAS: dict[str, Formula] = {entry.name: entry for entry in _ENTRIES}


def formulas() -> tuple[str, ...]:
    """Return the names of the known hinge formulas, those of the user included."""
    load_own()
    return tuple(FORMULAS)


def register_formula(
    name: str,
    function: Callable[[Array], Array],
    *,
    source: str,
    valid: tuple[float, float],
    axial: Callable[[Array], Array] | None = None,
    bending: Callable[[Array], Array] | None = None,
) -> Formula:
    """Register a hinge formula under a name that every function with a `formula` argument accepts.

    Parameters
    ----------
    name : letters, digits and hyphens.
    function : of t/R (...), returns the dimensionless `E b R^2 theta/M` (...).
    source : origin of the formula, one line.
    valid : smallest and largest t/R for which it is valid; outside, results carry a warning.
    axial, bending : likewise `E b dx/F_x` and the bending part of `E b dy/F_y`; None takes that of
        Paros and Weisbord.

    Raises
    ------
    BadInput
        The name is invalid or another formula has it, `valid` is not a range, or a function is not
        callable, raises, or does not return finite positive numbers over `valid`.

    Examples
    --------
    >>> import flexfem
    >>> own = register_formula(
    ...     "plain", lambda ratio: 15 * ratio**-2.5, source="a fit", valid=(0.05, 0.5)
    ... )
    >>> flexfem.analyse(flexfem.load("geometry/mobility3.toml"), formula="plain").formula
    'plain'
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9-]*", name):
        raise BadInput(
            f"hinge formula {shown(name)}: expected a name of letters, digits and hyphens"
        )
    known = FORMULAS.get(name)
    if known is not None and (known.rotation, known.axial, known.bending) != (
        function,
        axial,
        bending,
    ):
        raise BadInput(f"hinge formula {printed(name)} is known already, expected another name")
    if not isinstance(source, str) or not source.strip() or not source.isprintable():
        raise BadInput(f"hinge formula {printed(name)}: expected a source, one line of text")
    try:
        low, high = map(float, valid)
    except (TypeError, ValueError):
        low = high = np.nan
    if not 0 < low < high < np.inf:
        raise BadInput(
            f"hinge formula {printed(name)}: valid = {shown(valid)}, expected 0 < smallest t/R < "
            "largest"
        )
    ratio = np.geomspace(low, high, 24).reshape(2, 3, 4)
    optional = {
        argument: value
        for argument, value in (("axial", axial), ("bending", bending))
        if value is not None
    }
    for argument, value in {"function": function, **optional}.items():
        title = f"hinge formula {printed(name)}: {argument}"
        if not callable(value):
            raise BadInput(f"{title} = {shown(value)}, expected a function of t/R")
        values = _values(title, value, ratio)
        if not np.all(np.isfinite(values) & (values > 0)):
            raise BadInput(f"{title} at t/R from {low:g} to {high:g}: {EXPECTED}")
    FORMULAS[name] = Formula(
        name, source, "registered by the user", (low, high), function, axial, bending
    )
    return FORMULAS[name]


def _values(
    title: str,
    function: Callable[[Array], Array],
    ratio: Array,
) -> Array:
    """Return the values (...) of a function at t/R (...).

    Raises BadInput where a user's function fails.
    """
    raised = ""
    try:
        values = np.asarray(function(ratio.copy()))
        if values.shape == ratio.shape and values.dtype.kind in "iuf":
            return values
    except Exception as error:  # the user's function may raise anything
        raised = one_line(f"{type(error).__name__}: {error}", LONGEST_ERROR) + ", "
    raise BadInput(f"{title} at t/R from {ratio.min():g} to {ratio.max():g}: {raised}{EXPECTED}")


def formula(name: str) -> Formula:
    """Return the registered formula. Raises BadInput with the known names when there is none."""
    load_own()
    if not isinstance(name, str) or name not in FORMULAS:
        raise BadInput(
            f"hinge formula {printed(name)} is not known, expected one of: {', '.join(FORMULAS)}"
        )
    return FORMULAS[name]
