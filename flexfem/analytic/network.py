"""The platform on its chains at rest: hinges in series, chains in parallel; what the necks carry and when they yield.

Neither loops nor dependent joints are needed at rest: `stiffness` does with them at any configuration, and is (16).
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.paper import KINDS, Freedoms, checked
from flexfem.arrays import Array, inverse
from flexfem.hinges.formulas import Compliance
from flexfem.hinges.strength import Wrench
from flexfem.mechanism.designs import Frames


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
