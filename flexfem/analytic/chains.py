"""The platform on its chains at rest: hinges in series, chains in parallel; what the necks carry and when they yield.

Neither loops nor dependent joints are needed at rest: `stiffness` does with them at any configuration, and is (16).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.chart import thickness_chart
from flexfem.analytic.kinematics import KINDS, Freedoms, checked
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array, inverse
from flexfem.stage.designs import Designs, Frames


class Concentration(NamedTuple):
    """Largest stress over that of a straight bar as thick as the neck; pure numbers (...) of t/R.

    shear : of a force across the neck, beside the centre: stress along the surface over that of its moment there.
    """

    bending: Array
    tension: Array
    shear: Array


class Wrench(NamedTuple):
    """What the necks carry per displacement of the platform, (..., 3 chains, 3 hinges, 3 directions).

    moment : about the neck's centre; `normal` : force along the neck. N and N mm per mm, per rad.
    """

    moment: Array
    normal: Array


def chain_compliance(frames: Frames, compliance: Compliance, freedoms: Freedoms) -> Array:
    """Compliance of the platform on each chain alone, (..., 3 chains, 3, 3): sum_n G_n k_n^-1 G_n^T.

    Notes
    -----
    For a neck at (x, y) with the cosine c and sine s of its axis, seen from the platform centre at the origin, the
    columns of G are (y, -x, 1) for rotation, (c, s, 0) for axial and (-s, c, 0) for shear; written out.
    """
    allowed = np.array([[[kind in hinge for kind in KINDS] for hinge in chain] for chain in checked(freedoms)])
    turn, axial, shear = (np.asarray(each) * allowed[..., kind] for kind, each in enumerate(compliance))
    x, y = frames.centres[..., 0], frames.centres[..., 1]
    c, s = np.cos(frames.axes), np.sin(frames.axes)
    xt, yt = y * turn, -x * turn
    xx, yy = y * xt + c * c * axial + s * s * shear, -x * yt + s * s * axial + c * c * shear
    xy = y * yt + c * s * (axial - shear)
    upper = [np.sum(np.broadcast_to(each, xx.shape), axis=-1) for each in (xx, xy, xt, yy, yt, turn)]
    full = np.stack([upper[k] for k in (0, 1, 2, 1, 3, 4, 2, 4, 5)]).reshape(3, 3, *xx.shape[:-1])
    return np.moveaxis(full, (0, 1), (-2, -1))  # entry by entry in memory: many designs at full speed


def chain_wrenches(chains: Array, bodies: Array | None = None) -> Array:
    """Wrench of each chain on the platform per displacement of it, (..., 3 chains, 3, 3).

    Parameters
    ----------
    chains : (..., 3, 3, 3), compliance of each chain's hinges at the platform.
    bodies : (..., 9, 9), what pads, links and platform add to it, chain by chain, as `links.body_compliance`.

    Notes
    -----
    The wrenches w_i move the platform by `U = c_i w_i + sum_j B_ij w_j`, the same for every chain i. nan for
    a chain that has no compliance in some direction (its three hinges in line).
    """
    if bodies is None:
        return inverse(chains)
    leading = np.broadcast_shapes(chains.shape[:-3], bodies.shape[:-2])
    full = np.broadcast_to(bodies, (*leading, 9, 9)).reshape(*leading, 3, 3, 3, 3).copy()
    for chain in range(3):
        full[..., chain, :, chain, :] += chains[..., chain, :, :]
    wrenches = inverse(full.reshape(*leading, 9, 9)).reshape(*leading, 3, 3, 3, 3)
    return np.asarray(np.sum(wrenches, axis=-2))


def concentration(ratio: Array) -> Concentration:
    """Stress concentration at a notch of t/R = `ratio` (...).

    Notes
    -----
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


def neck_wrenches(frames: Frames, chain_stiffness: Array) -> Wrench:
    """What the necks carry per displacement of the platform, from the chains' stiffnesses (..., 3 chains, 3, 3).

    Notes
    -----
    The chain takes the platform wrench `F_i = C_i^-1 u`; a neck at (x, y) takes the same force and the moment
    `M + y F_x - x F_y`: the transposes of the columns in `chain_compliance`.
    """
    F_x, F_y, M = (chain_stiffness[..., None, row, :] for row in range(3))
    x, y = frames.centres[..., 0, None], frames.centres[..., 1, None]
    c, s = np.cos(frames.axes)[..., None], np.sin(frames.axes)[..., None]
    return Wrench(M + y * F_x - x * F_y, c * F_x + s * F_y)


def stress_raised(designs: Designs) -> Concentration:
    """Largest von Mises stress at the necks of n designs over that of a straight bar as thick, (n, 3, 3) or smaller.

    Notes
    -----
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
        factors = thickness_chart().stress_factors(ratio, width, nu)
        return Concentration(K.bending * factors.bending, K.tension * factors.tension, K.shear * factors.bending)
    across = von_mises_along(designs.out_of_plane)[:, None, None]
    return Concentration(*(each * across for each in K))


def neck_stress(wrench: Wrench, neck: Array, thickness: Array, raised: Concentration) -> Array:
    """Largest von Mises stress at each neck (..., 3 chains, 3 hinges, 3 directions), MPa per mm, rad of the platform.

    Parameters
    ----------
    neck : (..., 3, 3), mm.   thickness : (...), mm.   raised : (..., 3, 3), of `stress_raised`.

    Notes
    -----
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

    Parameters
    ----------
    stress : (..., 3 chains, 3 hinges, 3 directions) of `neck_stress`.   yield_strength : (...), MPa.
    """
    return np.asarray(yield_strength[..., None] / np.max(stress, axis=(-3, -2)))


def travel(turning: Array, rotation: float) -> Array:
    """Displacement (..., 3) at which the first base hinge has turned by `rotation`, rad, as its drive can.

    Parameters
    ----------
    turning : (..., 3), the largest rotation of a base hinge per displacement, rad per mm and per rad.
    """
    return rotation / turning
