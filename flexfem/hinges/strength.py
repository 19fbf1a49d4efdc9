"""Strength of hinges: stress at necks, and fatigue by Basquin's law with mean stress by Walker."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.files.quantities import FLATTEST, STEEPEST
from flexfem.hinges.chart import thickness_chart
from flexfem.mechanism.materials import SWT, Material, materials
from flexfem.mechanism.stress_concentration import Concentration, concentration
from flexfem.refused import BadInput, printed


class Wrench(NamedTuple):
    """Internal forces of necks per displacement (..., directions), for arrays of hinges.

    They are in N and N mm per mm, per rad; (..., 3 chains, 3 hinges, 3 directions) for the nine
    hinges of a stage.

    moment : about the neck's centre.   normal, shear : axial and transverse force.
    """

    moment: Array
    normal: Array
    shear: Array


def raised_in_plane(ratio: Array, out_of_plane: Array) -> Concentration:
    """Return the largest von Mises stress (...) at necks over the stress of a straight bar.

    ratio : (...), t/R.
    out_of_plane : (...), stress out of the plane over that along the surface, 0 in plane stress.
    """
    along = von_mises_along(out_of_plane)
    K = concentration(ratio)
    return Concentration(K.bending * along, K.tension * along, K.shear * along)


def raised_in_depth(
    ratio: Array,
    depth_ratio: Array,
    poissons_ratio: Array,
) -> Concentration:
    """Return the largest von Mises stress (...) at necks in three dimensions over that of a bar.

    ratio : (...), t/R.   depth_ratio : (...), b/t.

    Notes
    -----
    The charted factors of bending and tension hold for the highest stress over the thickness, which
    both may have at different heights. Shear takes the factor of bending, because a transverse
    force bends the neck off its centre.
    """
    K = concentration(ratio)
    bending, tension = thickness_chart().at(ratio, depth_ratio, poissons_ratio)[2:]
    return Concentration(K.bending * bending, K.tension * tension, K.shear * bending)


def neck_stress(
    wrench: Wrench,
    neck: Array,
    thickness: Array,
    raised: Concentration,
) -> Array:
    """Return the largest von Mises stress at each neck, MPa per mm, rad.

    It is (..., 3 chains, 3 hinges, 3 directions) for the nine hinges of a stage.

    neck : (..., 3, 3), mm.   thickness : (...), mm.   raised : (..., 3, 3), of `raised_in_plane`.

    Notes
    -----
    It is `|6 M K_b / (b t^2)| + |N K_t / (b t)|` at the more stressed side of the neck. Shear is
    neglected: it is zero at that surface, and its own maximum off the neck is 1 % of the bending
    stress in the shipped stages.
    """
    bending, axial = surface_stress(wrench, neck, thickness, raised)
    return np.asarray(np.abs(bending) + np.abs(axial))


def surface_stress(
    wrench: Wrench, neck: Array, thickness: Array, raised: Concentration
) -> tuple[Array, Array]:
    """Return the signed von Mises stress (..., 3, 3, 3) of bending and of the axial force of necks.

    The stress is their sum at one side of the neck and their difference at the other; arguments as
    for `neck_stress`.
    """
    area = thickness[..., None, None] * neck
    per_moment = 6.0 * raised.bending / (area * neck)
    per_force = raised.tension / area
    bending = wrench.moment * per_moment[..., None]
    axial = wrench.normal * per_force[..., None]
    return np.asarray(bending), np.asarray(axial)


def von_mises_along(out_of_plane: Array) -> Array:
    """Return the von Mises stress per stress along a free surface (...) by ratios out of plane."""
    return np.asarray(np.sqrt(1.0 - out_of_plane + out_of_plane**2))


KEY = "material.fatigue_strength_coefficient_mpa"
# cycles, assumed without a source: plastic strain matters below, S-N curves bend above
RANGE = (1e3, 1e6)
ONE_REVERSAL = 0.5  # cycles
SAME_STRESS = 1e-9  # difference of log10 of stresses below which they are one stress
FEWEST_POINTS = 3  # two points have no scatter


def fatigue_fraction(ratio: Array, sensitivity: float) -> Array:
    """Return the fraction (...) of the stress at a notch that is effective in fatigue.

    ratio : (...), t/R.   sensitivity : q, from 0 to 1.

    Notes
    -----
    It is `(1 + q (K - 1)) / K` with the notch sensitivity q, 0 to 1, of R. E. Peterson as in
    Dowling, Mechanical Behavior of Materials, Sec. 10.2, and the concentration K of bending, which
    causes nearly all of the stress; that of tension is 4 % larger at t/R = 1/3.
    """
    K = concentration(ratio).bending
    return np.asarray((1.0 + sensitivity * (K - 1.0)) / K)


class Basquin(NamedTuple):
    """Basquin's law `sigma_a = sigma'_f (2 N)^b` of unnotched specimens at zero mean stress.

    N is in cycles. Coefficient and exponent are of one material, or (n,) of n designs.

    coefficient : sigma'_f, MPa.   exponent : b, negative.
    walker : exponent gamma of Walker's mean-stress correction.
    range : cycles from and to which the law was fitted.
    range_stated : whether the range is stated, not assumed.
    """

    coefficient: float | Array
    exponent: float | Array
    walker: float = SWT
    range: tuple[float, float] = RANGE
    range_stated: bool = False

    def cycles(self, amplitude: ArrayLike) -> Array:
        """Return the cycles to failure (...) at reversed amplitudes (...), MPa; inf at zero."""
        with np.errstate(divide="ignore", over="ignore"):
            ratio = np.asarray(amplitude) / self.coefficient
            return np.asarray(ONE_REVERSAL * ratio ** (1.0 / self.exponent))

    def amplitude(self, cycles: ArrayLike) -> Array:
        """Return the fully reversed amplitude (...), MPa, that fails at cycles (...)."""
        reversals = np.asarray(cycles) / ONE_REVERSAL
        return np.asarray(self.coefficient * reversals**self.exponent)


def checked_law(law: Basquin | BasquinFit) -> Basquin:
    """Return the law of the argument, which is a law or a fit.

    Raises BadInput when it is neither, or out of range.
    """
    basquin = law.law if isinstance(law, BasquinFit) else law
    if not isinstance(basquin, Basquin):
        raise BadInput(
            f"law {printed(law)}, expected flexfem.Basquin(coefficient, exponent), MPa, or a fit"
        )
    arguments.positive("law: coefficient", basquin.coefficient, 1e6)
    arguments.between("law: exponent", basquin.exponent, STEEPEST, FLATTEST)
    arguments.positive("law: walker", basquin.walker, 1.0)
    try:
        low, high = map(float, basquin.range)
    except (TypeError, ValueError):
        low = high = 0.0
    if not 0 < low < high:
        raise BadInput(
            f"law: range {printed(basquin.range)}, expected two numbers of cycles, the smaller "
            "first"
        )
    return basquin


class BasquinFit(NamedTuple):
    """Basquin's law fitted to S-N points.

    Confidence intervals are at `confidence`, per cent, and None where unbounded.

    A, B : of the same law as `sigma_a = A N^B`, MPa.   points : number of points.
    scatter : standard deviation of log10 N about the law.
    range : fewest and most cycles of the points.
    """

    coefficient: float
    exponent: float
    A: float
    B: float
    coefficient_interval: tuple[float, float] | None
    exponent_interval: tuple[float, float] | None
    confidence: float
    scatter: float
    points: int
    range: tuple[float, float]

    @property
    def law(self) -> Basquin:
        """The fitted law, with the mean-stress correction of Smith, Watson and Topper."""
        return Basquin(self.coefficient, self.exponent, range=self.range, range_stated=True)


def required_law(material: Material, alternative: str = "") -> Basquin:
    """Return Basquin's law of a material.

    Raises BadInput without constants; its text ends with the `alternative`.
    """
    coefficient = material.fatigue_strength_coefficient
    exponent = material.fatigue_strength_exponent
    if coefficient is None or exponent is None:
        known = list[str]()
        for name, metal in materials().items():
            if metal.fatigue_strength_exponent is not None:
                known.append(name)
        expected = f"expected fatigue constants, as of {', '.join(known)}{alternative}"
        raise BadInput(f"{KEY} is missing: {expected}")
    return Basquin(
        coefficient,
        exponent,
        material.walker,
        material.fatigue_range or RANGE,
        material.fatigue_range is not None,
    )


def equivalent(
    amplitude: Array,
    mean: Array,
    walker: float | Array,
) -> Array:
    """Return the fully reversed amplitude (...) of equal life to amplitudes and means (...), MPa.

    It is zero without tension.

    Notes
    -----
    It is `sigma_max^(1 - gamma) sigma_a^gamma`: K. Walker, ASTM STP 462 (1970) 1; for gamma = 0.5
    K. N. Smith, P. Watson, T. H. Topper, J. Materials 5 (1970) 767; N. E. Dowling, C. A. Calhoun,
    A. Arcari, Fatigue Fract. Eng. Mater. Struct. 32 (2009) 163.
    """
    highest = np.maximum(mean + amplitude, 0.0)
    by_walker = highest ** (1.0 - walker) * amplitude**walker
    return np.asarray(np.where(highest > 0.0, by_walker, 0.0))


def fit_basquin(
    stress: ArrayLike,
    cycles: ArrayLike,
    confidence: float = 95.0,
) -> BasquinFit:
    """Fit Basquin's law to S-N points of unnotched specimens at zero mean stress, without run-outs.

    Parameters
    ----------
    stress : (n,), MPa, amplitudes.   cycles : (n,), to failure.
    confidence : of the intervals, per cent.

    Raises
    ------
    BadInput
        There are fewer than three points, a number is not positive, all stresses are equal, or life
        does not fall with stress.

    Notes
    -----
    log N is regressed on log sigma, because the test controls the stress: ASTM E739; N. E. Dowling,
    Mechanical Behavior of Materials, Sec. 9.2. The interval of the exponent is that of the slope;
    that of the coefficient is Fieller's.

    Examples
    --------
    >>> stress, cycles = [948, 834, 703, 631, 579, 524], [222, 992, 6004, 14130, 43860, 132150]
    >>> found = fit_basquin(stress, cycles)  # Dowling, Table E9.1
    >>> round(found.A), round(found.B, 4), round(found.coefficient)
    (1587, -0.0945, 1695)
    """
    x, y = _logarithms(stress, cycles)
    confidence = arguments.between("confidence", confidence, 50.0, 99.9)
    from scipy import stats  # takes half a second to import, and the neck stress does not need it

    line = stats.linregress(x, y)
    slope = float(line.slope)
    error = float(line.stderr)
    if not slope < 0 or not STEEPEST <= 1.0 / slope <= FLATTEST:
        raise BadInput(_refused_slope(slope))
    half = float(stats.t.ppf(0.5 + confidence / 200.0, x.size - 2)) * error
    log_coefficient, log_A = ((np.log10(N) - line.intercept) / slope for N in (ONE_REVERSAL, 1.0))
    intervals = _basquin_intervals(x, y, slope, half)
    lives = np.asarray(cycles, dtype=float)
    return BasquinFit(
        coefficient=float(10.0**log_coefficient),
        exponent=1.0 / slope,
        A=float(10.0**log_A),
        B=1.0 / slope,
        coefficient_interval=intervals.coefficient,
        exponent_interval=intervals.exponent,
        confidence=float(confidence),
        scatter=error * float(np.sqrt(np.sum((x - x.mean()) ** 2))),
        points=x.size,
        range=(float(np.min(lives)), float(np.max(lives))),
    )


def _refused_slope(slope: float) -> str:
    """Return the text that refuses a slope of log N over log stress."""
    result = "a life that does not change with stress"
    if slope:
        result = f"an exponent of {1.0 / slope:.3g}"
    expected = f"{STEEPEST:g} to {FLATTEST:g}: life must fall with stress"
    return f"S-N points give {result}, expected {expected}"


class _Intervals(NamedTuple):
    """Confidence intervals of Basquin's coefficient, MPa, and exponent; None where unbounded."""

    coefficient: tuple[float, float] | None
    exponent: tuple[float, float] | None


def _basquin_intervals(
    x: Array,
    y: Array,
    slope: float,
    half: float,
) -> _Intervals:
    """Return the intervals of a fit of y on x (n,) with a slope and half of its interval.

    That of the stress at one reversal is Fieller's, which is unbounded for some slopes.
    """
    low = slope - half
    high = slope + half
    if not high < 0:
        return _Intervals(None, None)
    spread = float(np.sum((x - x.mean()) ** 2))
    centre = float(np.log10(ONE_REVERSAL) - y.mean())
    a = low * high
    middle = x.mean() + slope * centre / a
    half_width = half * np.sqrt(centre**2 + a * spread / x.size) / a
    coefficient = (float(10.0 ** (middle - half_width)), float(10.0 ** (middle + half_width)))
    return _Intervals(coefficient, (1.0 / high, 1.0 / low))


def _logarithms(stress: ArrayLike, cycles: ArrayLike) -> tuple[Array, Array]:
    """Return the logarithms (n,) of S-N points. Raises BadInput as `fit_basquin`."""
    x = np.log10(_positive("stress", stress))
    y = np.log10(_positive("cycles", cycles))
    if x.shape != y.shape or x.size < FEWEST_POINTS:
        raise BadInput(
            f"{x.size} stresses and {y.size} cycles, expected the same number, {FEWEST_POINTS} or "
            "more"
        )
    if np.ptp(x) < SAME_STRESS:
        raise BadInput(f"stress: all are {10 ** x[0]:g} MPa, expected two stresses or more")
    return x, y


def _positive(name: str, values: ArrayLike) -> Array:
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{name}: expected numbers") from None
    if array.ndim != 1 or not np.all(np.isfinite(array) & (array > 0)):
        raise BadInput(f"{name}: expected a list of numbers above 0")
    return array
