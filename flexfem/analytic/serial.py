"""Platform stiffness at rest without loops or dependent joints: hinges in series, chains in parallel.

The independent check of `stiffness`, and the fast route when only K_uu at rest is wanted.
"""

from __future__ import annotations

import numpy as np

from flexfem.analytic.linear import inverse
from flexfem.analytic.mobility import KINDS, Freedoms, checked
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array
from flexfem.layout.frames import Frames


def chain_compliance(frames: Frames, compliance: Compliance, freedoms: Freedoms) -> Array:
    """Compliance of the platform on each chain alone, (..., 3 chains, 3, 3): sum_n G_n k_n^-1 G_n^T."""
    allowed = np.array([[[kind in hinge for kind in KINDS] for hinge in chain] for chain in checked(freedoms)])
    springs = np.stack(np.broadcast_arrays(*compliance), axis=-1) * allowed
    x, y = frames.centres[..., 0], frames.centres[..., 1]
    c, s, zero = np.cos(frames.axes), np.sin(frames.axes), np.zeros_like(x)
    rows = [np.stack([y, c, -s], -1), np.stack([-x, s, c], -1), np.stack([zero + 1.0, zero, zero], -1)]
    G = np.stack(rows, axis=-2)  # (..., chain, hinge, 3, kind), seen from the platform centre at the origin
    hinges = (G * springs[..., None, :]) @ np.swapaxes(G, -1, -2)
    total: Array = np.sum(hinges, axis=-3)
    return total


def serial_stiffness(frames: Frames, compliance: Compliance, freedoms: Freedoms) -> Array:
    """K_uu at rest (..., 3, 3), N/mm, N, N mm: sum_i (sum_n G_n k_n^-1 G_n^T)^-1.

    Parameters
    ----------
    frames : (..., 3, 3) hinge frames; `compliance` : fields (..., 3, 3); `freedoms` : as in `mobility`.

    Notes
    -----
    nan for a design with a chain that has no compliance in some direction (its three hinges in line).
    """
    K_uu: Array = np.sum(inverse(chain_compliance(frames, compliance, freedoms)), axis=-3)
    return K_uu
