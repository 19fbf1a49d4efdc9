"""Platform stiffness at rest without loops or dependent joints: hinges in series, chains in parallel.

The independent check of `stiffness`, and the fast route when only K_uu at rest is wanted.
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.inverse import inverse
from flexfem.analytic.mobility import KINDS, Freedoms, checked
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array
from flexfem.stage.frames import Frames


def chain_compliance(frames: Frames, compliance: Compliance, freedoms: Freedoms) -> Array:
    """Compliance of the platform on each chain alone, (..., 3 chains, 3, 3): sum_n G_n k_n^-1 G_n^T.

    Notes
    -----
    For a neck at (x, y) with the cosine c and sine s of its axis, seen from the platform centre at the origin, the
    columns of G are (y, -x, 1) for rotation, (c, s, 0) for stretch and (-s, c, 0) for slide; written out.
    """
    allowed = np.array([[[kind in hinge for kind in KINDS] for hinge in chain] for chain in checked(freedoms)])
    turn, stretch, slide = (np.asarray(each) * allowed[..., kind] for kind, each in enumerate(compliance))
    x, y = frames.centres[..., 0], frames.centres[..., 1]
    c, s = np.cos(frames.axes), np.sin(frames.axes)
    xt, yt = y * turn, -x * turn
    xx, yy = y * xt + c * c * stretch + s * s * slide, -x * yt + s * s * stretch + c * c * slide
    xy = y * yt + c * s * (stretch - slide)
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
    The wrenches w_i move the platform by `U = c_i w_i + sum_j B_ij w_j`, the same for every chain i. nan as
    `serial_stiffness`.
    """
    if bodies is None:
        return inverse(chains)
    leading = np.broadcast_shapes(chains.shape[:-3], bodies.shape[:-2])
    full = np.broadcast_to(bodies, (*leading, 9, 9)).reshape(*leading, 3, 3, 3, 3).copy()
    for chain in range(3):
        full[..., chain, :, chain, :] += chains[..., chain, :, :]
    wrenches = inverse(full.reshape(*leading, 9, 9)).reshape(*leading, 3, 3, 3, 3)
    return np.asarray(np.sum(wrenches, axis=-2))


def serial_stiffness(frames: Frames, compliance: Compliance, freedoms: Freedoms) -> Array:
    """K_uu at rest (..., 3, 3), N/mm, N, N mm: sum_i (sum_n G_n k_n^-1 G_n^T)^-1.

    Parameters
    ----------
    frames : (..., 3, 3) hinge frames; `compliance` : fields (..., 3, 3); `freedoms` : as in `mobility`.

    Notes
    -----
    nan for a design with a chain that has no compliance in some direction (its three hinges in line).
    """
    K_uu: Array = np.sum(chain_wrenches(chain_compliance(frames, compliance, freedoms)), axis=-3)
    return K_uu
