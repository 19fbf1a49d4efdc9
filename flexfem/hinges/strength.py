"""Strength of the hinges: stress at the necks, yield, and fatigue by Basquin's law with mean stress by Walker."""

from __future__ import annotations

from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.hinges.chart import thickness_chart
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.materials import FLATTEST, STEEPEST, SWT, Material, materials
from flexfem.refused import BadInput


class Concentration(NamedTuple):
    """Largest stress over that of a straight bar as thick as the neck; pure numbers (...) of t/R.

    shear : of a force across the neck, beside the centre: stress along the surface over that of its moment there.
    """

    bending: Array
    tension: Array
    shear: Array


class Wrench(NamedTuple):
    """What the necks carry per displacement of the platform, (..., 3 chains, 3 hinges, 3 directions).

    moment : about the neck's centre; `normal`, `shear` : force along the neck and across. N and N mm per mm, per rad.
    """

    moment: Array
    normal: Array
    shear: Array


def concentration(ratio: Array) -> Concentration:
    """Stress concentration at a notch of t/R = `ratio` (...).

    The deep hyperbolic notch of H. Neuber, Kerbspannungslehre, Springer (1937): with `a = t/2R`, in bending
    `4 a sqrt a / (3 (sqrt a + (a - 1) arctan sqrt a))`, in tension
    `2 (a + 1) sqrt a / ((a + 1) arctan sqrt a + sqrt a)`, both recalled, not copied from a print. In shear our algebra,
    from Kolosov's `phi = i A w`, `z = c sinh w`: `2 a sqrt a (a + 1) / (3 ((a + 1) arctan sqrt a - sqrt a))` where the
    place goes to the centre; on a circular notch it is that within 1 % up to 0.6 R beside the centre. Compared with
    plane-stress finite elements of whole stages (t/R 0.13 to 0.60): the highest neck stress agrees within 1 % when the
    forces are those of calibrated hinges and elastic links; other forces are worse (`warning.STRESS_ABOVE`).
    Smith and Chetwynd's `(1 + t/2R)^0.45` gives up to 1.4 % and 3.4 % too much, no concentration at all 6 to 9 % too
    little.
    """
    a = 0.5 * ratio
    root = np.sqrt(a)
    angle = np.arctan(root)
    bending = 4.0 * a * root / (3.0 * (root + (a - 1.0) * angle))
    tension = 2.0 * (a + 1.0) * root / ((a + 1.0) * angle + root)
    shear = 2.0 * a * root * (a + 1.0) / (3.0 * ((a + 1.0) * angle - root))
    return Concentration(bending, tension, shear)


def stress_raised(designs: Designs) -> Concentration:
    """Largest von Mises stress at the necks of n designs over that of a straight bar as thick, (n, 3, 3) or smaller.

    `concentration` times what is out of the plane: `von_mises_along` in plane strain; in a "corrected" plane, which has
    hinges of three dimensions, the charted factors of bending and of tension at t/R, b/t and nu. There the highest
    stress of the whole thickness is meant, and bending and tension may have theirs at different heights. The factor of
    bending is taken for shear, too: a force across the neck bends it beside the centre.
    """
    ratio = designs.neck / designs.radius
    K = concentration(ratio)
    if designs.plane == "corrected":
        width = designs.thickness[:, None, None] / designs.neck
        nu = designs.poissons_ratio[:, None, None]
        bending, tension = thickness_chart().at(ratio, width, nu)[2:]
        return Concentration(K.bending * bending, K.tension * tension, K.shear * bending)
    across = von_mises_along(designs.out_of_plane)[:, None, None]
    return Concentration(*(each * across for each in K))


def neck_stress(wrench: Wrench, neck: Array, thickness: Array, raised: Concentration) -> Array:
    """Largest von Mises stress at each neck (..., 3 chains, 3 hinges, 3 directions), MPa per mm, rad of the platform.

    neck : (..., 3, 3), mm.   thickness : (...), mm.   raised : (..., 3, 3), of `stress_raised`.

    `|6 M K_b / (b t^2)| + |N K_t / (b t)|` at the more strained side of the neck. Shear is left out: it is zero at that
    surface, and its own maximum beside the neck is 1 % of the bending stress in the shipped stages.
    """
    bending, along = surface_stress(wrench, neck, thickness, raised)
    return np.asarray(np.abs(bending) + np.abs(along))


def surface_stress(wrench: Wrench, neck: Array, thickness: Array, raised: Concentration) -> tuple[Array, Array]:
    """Von Mises stress, with its sign, by bending and by the force along each neck, (..., 3, 3, 3) as `neck_stress`.

    At one side of the neck the two add up, at the other they differ.
    """
    area = thickness[..., None, None] * neck
    bending = wrench.moment * (6.0 * raised.bending / (area * neck))[..., None]
    along = wrench.normal * (raised.tension / area)[..., None]
    return np.asarray(bending), np.asarray(along)


def von_mises_along(out_of_plane: Array) -> Array:
    """Von Mises stress over the stress along a free surface (...), for ratios (...) of `out_of_plane`."""
    return np.asarray(np.sqrt(1.0 - out_of_plane + out_of_plane**2))


def range_at_yield(stress: Array, yield_strength: Array) -> Array:
    """Displacement (..., 3) of the platform in each direction, the others held, at which the first neck yields.

    stress : (..., 3 chains, 3 hinges, 3 directions) of `neck_stress`.   yield_strength : (...), MPa.
    """
    return np.asarray(yield_strength[..., None] / np.max(stress, axis=(-3, -2)))


KEY = "material.fatigue_strength_coefficient_mpa"
RANGE = (1e3, 1e6)  # cycles, where no source says; below, plastic strain counts, above, curves bend: assumed
ONE_REVERSAL = 0.5  # cycles
TWO_STRESSES = 1e-9  # of log10 of the stress: less is one stress
FEWEST = 3  # points: with two there is no scatter


def counted(ratio: Array, sensitivity: float) -> Array:
    """Part of the stress at a notch of t/R = `ratio` (...) that counts for fatigue, by the notch sensitivity q, 0 to 1.

    `(1 + q (K - 1)) / K`, R. E. Peterson's definition of q as in Dowling, Mechanical Behavior of Materials, Sec. 10.2,
    with the concentration K of bending, by which nearly all of the stress comes; that of tension is 4 % larger at
    t/R = 1/3.
    """
    K = concentration(ratio).bending
    return np.asarray((1.0 + sensitivity * (K - 1.0)) / K)


class Basquin(NamedTuple):
    """`sigma_a = sigma'_f (2 N)^b` at zero mean stress on unnotched specimens, N in cycles.

    coefficient : sigma'_f, MPa.   exponent : b, negative; both of one material, or (n,) of n designs.
    walker : gamma of `equivalent`.
    range : cycles from and to which it was fitted.   range_stated : or which are assumed.
    """

    coefficient: float | Array
    exponent: float | Array
    walker: float = SWT
    range: tuple[float, float] = RANGE
    range_stated: bool = False

    def cycles(self, amplitude: ArrayLike) -> Array:
        """Cycles (...) at fully reversed amplitudes (...), MPa; inf at zero."""
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(ONE_REVERSAL * (np.asarray(amplitude) / self.coefficient) ** (1.0 / self.exponent))

    def amplitude(self, cycles: ArrayLike) -> Array:
        """Fully reversed amplitude (...), MPa, that fails at cycles (...)."""
        return np.asarray(self.coefficient * (np.asarray(cycles) / ONE_REVERSAL) ** self.exponent)


def checked_law(law: Basquin | BasquinFit) -> Basquin:
    """The law that a function was given, itself or by a fit. Raises BadInput when it is none."""
    found = law.law if isinstance(law, BasquinFit) else law
    if not isinstance(found, Basquin):
        raise BadInput(f"law {law!r}, expected flexfem.Basquin(coefficient, exponent), MPa, or a fit")
    limits = {"coefficient": (0.0, 1e6), "exponent": (STEEPEST, FLATTEST), "walker": (0.0, 1.0)}
    for name, (low, high) in limits.items():
        value = getattr(found, name)
        if not isinstance(value, Real) or not (low < float(value) <= high or value == low != 0):
            raise BadInput(f"law: {name} {value!r}, expected a number from {low:g} to {high:g}")
    try:
        low, high = map(float, found.range)
    except (TypeError, ValueError):
        low = high = 0.0
    if not 0 < low < high:
        raise BadInput(f"law: range {found.range!r}, expected fewer and more cycles")
    return found


class BasquinFit(NamedTuple):
    """Basquin's law through S-N points; intervals at the `confidence`, per cent, None where there is none.

    A, B : of the same law as `sigma_a = A N^B`, MPa.   points : number.
    scatter : standard deviation of log10 N about the law.   range : least and most cycles of the points.
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
        """The law itself, with mean stress by Smith, Watson and Topper."""
        return Basquin(self.coefficient, self.exponent, range=self.range, range_stated=True)


def required_law(material: Material, instead: str = "") -> Basquin:
    """Basquin's law of a material. Raises BadInput where there are no constants; `instead` is what else would do."""
    if material.fatigue_strength_coefficient is None or material.fatigue_strength_exponent is None:
        known = ", ".join(name for name, each in materials().items() if each.fatigue_strength_exponent is not None)
        raise BadInput(f"{KEY} is missing: expected fatigue constants, as {known} have them{instead}")
    return Basquin(
        material.fatigue_strength_coefficient,
        material.fatigue_strength_exponent,
        material.walker,
        material.fatigue_range or RANGE,
        material.fatigue_range is not None,
    )


def equivalent(amplitude: Array, mean: Array, walker: float | Array) -> Array:
    """Fully reversed amplitude (...) of the same life as amplitudes and means (...), MPa; zero without tension.

    `sigma_max^(1 - gamma) sigma_a^gamma`, K. Walker, ASTM STP 462 (1970) 1; with gamma = 0.5 K. N. Smith, P. Watson,
    T. H. Topper, J. Materials 5 (1970) 767. As in N. E. Dowling, C. A. Calhoun, A. Arcari, Fatigue Fract. Eng. Mater.
    Struct. 32 (2009) 163.
    """
    highest = np.maximum(mean + amplitude, 0.0)
    return np.asarray(np.where(highest > 0.0, highest ** (1.0 - walker) * amplitude**walker, 0.0))


def fit_basquin(stress: ArrayLike, cycles: ArrayLike, confidence: float = 95.0) -> BasquinFit:
    """Fit Basquin's law to S-N points of unnotched specimens at zero mean stress, run-outs left out.

    Parameters
    ----------
    stress : (n,), MPa, amplitudes.   cycles : (n,), to failure.   confidence : of the intervals, per cent.

    Raises
    ------
    BadInput
        The points are fewer than three, not positive, of one stress, or life does not fall with stress.

    Notes
    -----
    log N is regressed on log sigma, for the test controls the stress: ASTM E739; N. E. Dowling, Mechanical Behavior of
    Materials, Sec. 9.2. The interval of the exponent is that of the slope, the interval of the coefficient, a stress
    at a life, is Fieller's.

    Examples
    --------
    >>> import flexfem
    >>> stress, cycles = [948, 834, 703, 631, 579, 524], [222, 992, 6004, 14130, 43860, 132150]
    >>> found = flexfem.fit_basquin(stress, cycles)  # Dowling, Table E9.1
    >>> round(found.A), round(found.B, 4), round(found.coefficient)
    (1587, -0.0945, 1695)
    """
    x, y = (np.log10(_positive(name, each)) for name, each in (("stress", stress), ("cycles", cycles)))
    if x.shape != y.shape or x.size < FEWEST:
        raise BadInput(f"{x.size} stresses and {y.size} cycles, expected as many of both, {FEWEST} or more")
    if np.ptp(x) < TWO_STRESSES:
        raise BadInput(f"stress: all are {10 ** x[0]:g} MPa, expected two stresses or more")
    confidence = arguments.between("confidence", confidence, 50.0, 99.9)
    from scipy import stats  # half a second: not for the stress at a neck

    line = stats.linregress(x, y)
    slope, error, n = float(line.slope), float(line.stderr), x.size
    if not slope < 0 or not STEEPEST <= 1.0 / slope <= FLATTEST:
        said = f"an exponent of {1.0 / slope:.3g}" if slope else "a life that does not change with stress"
        raise BadInput(f"S-N points give {said}, expected {STEEPEST:g} to {FLATTEST:g}: life falls with stress")
    half = float(stats.t.ppf(0.5 + confidence / 200.0, n - 2)) * error
    at = [float(10.0 ** ((np.log10(N) - line.intercept) / slope)) for N in (ONE_REVERSAL, 1.0)]
    low, high, spread = slope - half, slope + half, float(np.sum((x - x.mean()) ** 2))
    # Fieller: the x at one reversal where the line of all slopes and heights within theirs may meet it
    ends = None
    if high < 0:
        centre, a = float(np.log10(ONE_REVERSAL) - y.mean()), low * high
        middle, wide = x.mean() + slope * centre / a, half * np.sqrt(centre**2 + a * spread / n) / a
        ends = float(10.0 ** (middle - wide)), float(10.0 ** (middle + wide))
    return BasquinFit(
        coefficient=at[0],
        exponent=1.0 / slope,
        A=at[1],
        B=1.0 / slope,
        coefficient_interval=ends,
        exponent_interval=(1.0 / high, 1.0 / low) if high < 0 else None,
        confidence=float(confidence),
        scatter=error * float(np.sqrt(spread)),
        points=n,
        range=(float(np.min(cycles)), float(np.max(cycles))),
    )


def _positive(name: str, values: ArrayLike) -> Array:
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{name}: expected numbers") from None
    if found.ndim != 1 or not np.all(np.isfinite(found) & (found > 0)):
        raise BadInput(f"{name}: expected a list of numbers above 0")
    return found
