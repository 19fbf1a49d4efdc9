"""The largest stress at a neck, from the chains' forces: which displacement of the platform makes a hinge yield."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.stage.frames import Frames


class Concentration(NamedTuple):
    """Largest stress over that of a straight bar as thick as the neck; pure numbers (...) of t/R."""

    bending: Array
    tension: Array


class Wrench(NamedTuple):
    """What the necks carry per displacement of the platform, (..., 3 chains, 3 hinges, 3 directions).

    moment : about the neck's centre; `normal` : force along the neck. N and N mm per mm, per rad.
    """

    moment: Array
    normal: Array


def concentration(ratio: Array) -> Concentration:
    """Stress concentration at a notch of t/R = `ratio` (...).

    Notes
    -----
    The deep hyperbolic notch of H. Neuber, Kerbspannungslehre, Springer (1937): with `a = t/2R`, in bending
    `4 a sqrt a / (3 (sqrt a + (a - 1) arctan sqrt a))`, in tension
    `2 (a + 1) sqrt a / ((a + 1) arctan sqrt a + sqrt a)`. Recalled, not copied from a print; compared with plane-stress
    finite elements of whole stages (t/R 0.13 to 0.60): the highest neck stress agrees within 1 % when the forces are
    those of calibrated hinges and elastic links; other forces are worse (`warning.STRESS_ABOVE`).
    Smith and Chetwynd's `(1 + t/2R)^0.45` gives up to 1.4 % and 3.4 % too much, no concentration at all 6 to 9 % too
    little.
    """
    a = 0.5 * ratio
    root = np.sqrt(a)
    angle = np.arctan(root)
    bending = 4.0 * a * root / (3.0 * (root + (a - 1.0) * angle))
    tension = 2.0 * (a + 1.0) * root / ((a + 1.0) * angle + root)
    return Concentration(bending, tension)


def neck_wrenches(frames: Frames, chain_stiffness: Array) -> Wrench:
    """What the necks carry per displacement of the platform, from the chains' stiffnesses (..., 3 chains, 3, 3).

    Notes
    -----
    The chain takes the platform wrench `F_i = C_i^-1 u`; a neck at (x, y) takes the same force and the moment
    `M + y F_x - x F_y`: the transposes of the columns in `serial.chain_compliance`.
    """
    F_x, F_y, M = (chain_stiffness[..., None, row, :] for row in range(3))
    x, y = frames.centres[..., 0, None], frames.centres[..., 1, None]
    c, s = np.cos(frames.axes)[..., None], np.sin(frames.axes)[..., None]
    return Wrench(M + y * F_x - x * F_y, c * F_x + s * F_y)


def peak_stress(wrench: Wrench, radius: Array, neck: Array, thickness: Array, pull: Array) -> Array:
    """Largest of the nine necks' von Mises stresses (..., 3 directions); arguments as `neck_stress`."""
    highest: Array = np.max(neck_stress(wrench, radius, neck, thickness, pull), axis=(-3, -2))
    return highest


def neck_stress(wrench: Wrench, radius: Array, neck: Array, thickness: Array, pull: Array) -> Array:
    """Largest von Mises stress at each neck (..., 3 chains, 3 hinges, 3 directions), MPa per mm, rad of the platform.

    Parameters
    ----------
    radius, neck : (..., 3, 3), mm.   thickness : (...), mm.
    pull : (...), of `schema.out_of_plane`: the stress across the plane, per stress along the neck.

    Notes
    -----
    `|6 M K_b / (b t^2)| + |N K_t / (b t)|` at the more strained side of the neck. Shear is left out: it is zero at that
    surface, and its own maximum beside the neck is 1 % of the bending stress in the shipped stages.
    """
    K = concentration(neck / radius)
    area = thickness[..., None, None] * neck
    bending = np.abs(wrench.moment) * (6.0 * K.bending / (area * neck))[..., None]
    along: Array = bending + np.abs(wrench.normal) * (K.tension / area)[..., None]
    return along * np.sqrt(1.0 - pull + pull**2)[..., None, None, None]
