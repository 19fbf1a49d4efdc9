"""Stress concentration at notches and at the roots of leaves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array

CORNER_POWER = 0.4555  # of the distance in the stress at a right-angled inner corner, negative


class Concentration(NamedTuple):
    """Stress concentration factors (...), relative to a straight bar as wide as the neck.

    They are functions of t/R.

    shear : for a transverse force, off the neck centre: surface stress relative to that of the
    bending moment there.
    """

    bending: Array
    tension: Array
    shear: Array


def concentration(ratio: Array) -> Concentration:
    """Return the stress concentration at a notch of t/R = `ratio` (...).

    The notch is the deep hyperbolic notch of H. Neuber, Kerbspannungslehre, Springer (1937): with
    `a = t/2R`, `4 a sqrt a / (3 (sqrt a + (a - 1) arctan sqrt a))` in bending and `2 (a + 1) sqrt a
    / ((a + 1) arctan sqrt a + sqrt a)` in tension, both recalled, not copied from a print. For
    shear our own algebra, from Kolosov's `phi = i A w`, `z = c sinh w`, gives `2 a sqrt a (a + 1) /
    (3 ((a + 1) arctan sqrt a
    - sqrt a))` in the limit at the centre; a circular notch agrees within 1 % up to 0.6 R from the
      centre. Against
    plane-stress finite elements of whole stages (t/R 0.13 to 0.60) the highest neck stress agrees
    within 1 % when the forces are those of calibrated hinges and elastic links; other forces are
    worse (`warnings.STRESS_ABOVE`). Smith and Chetwynd's `(1 + t/2R)^0.45` is up to 1.4 % and 3.4 %
    too large; no concentration is 6 to 9 % too small.
    """
    a = 0.5 * ratio
    root = np.sqrt(a)
    angle = np.arctan(root)
    bending = 4.0 * a * root / (3.0 * (root + (a - 1.0) * angle))
    tension = 2.0 * (a + 1.0) * root / ((a + 1.0) * angle + root)
    shear = 2.0 * a * root * (a + 1.0) / (3.0 * ((a + 1.0) * angle - root))
    return Concentration(bending, tension, shear)


def shoulder(ratio: float, one_sided: bool = False) -> tuple[float, float]:
    """Return the stress concentration in tension and bending at the root of a leaf, of neck /
    fillet radius = `ratio`.

    Our own fit of plane-stress finite elements of leaves between bodies at least 5 times as high as
    their ends, within 1.7 % in tension and 0.9 % in bending for ratios of 0.1 to 100. Small fillets
    follow the power of a right-angled corner (M. L. Williams, J. Appl. Mech. 19, 526, 1952), large
    ones deep notches. Peterson's charts of stepped bars (R. L. Norton's fit at D = 3 d) differ by 2
    % in bending; in tension they are up to 12 % higher.

    With a fillet on one side of the leaf, the other being flush with both bodies, the fit is within
    1.4 % in tension for ratios of 5 to 100, where the fillet governs, and within 0.3 % in bending
    for ratios of 0.1 to 100.
    """
    fits = (
        ((0.3626, 0.5603), (0.5234, 1.0341)) if one_sided else ((0.8446, 1.1349), (0.3352, 0.9479))
    )
    tension, bending = (
        (1 + factor * ratio**power) ** (CORNER_POWER / power) for factor, power in fits
    )
    return tension, bending
