"""Which poses friction at the contacts leaves undetermined under given strokes, as a bound.

A contact that its stack presses with N carries along its face any force up to mu N before it slips. It acts on the
pushed body at the point of contact and, the other way, on the carrier there, at the tip of the stack, which is taken as
stiff sideways. What is left of sliding depends on how the stage came there; every pose it may rest in is

    U + sum_i h_i f_i,   |f_i| <= mu_i N_i,   h = C_Ut - C_Ud Y C_dt

h being what a newton along contact i moves the platform by, the other stacks holding their strokes (`driven`). The
largest of each coordinate is `sum |h_i| mu_i N_i`: reached only where all contacts are about to slip, each the worse
way for this coordinate, so that not all three are reached at once. N is the force without friction; what friction takes
from it or adds is of second order in mu. A contact of no stated friction holds nothing.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.drives import StageDrive
from flexfem.verify.driven import Driven


def left_open(of: Driven, across: Array, drive: StageDrive, force: Array) -> list[float] | None:
    """Half-widths (3,) of the poses that friction leaves open, mm, mm, rad; None where none is stated.

    Parameters
    ----------
    across : (3 + n, r), mm and rad per N: pose and openings by forces along the contacts of `StageDrive.rubbing`.
    force : (n,), N, of all stacks, preloads included; contacts that would have to pull are open and hold nothing.
    """
    if not drive.rubbing:
        return None
    moved = across[:3] - of.C[:3, 3:] @ of.Y @ across[3:]
    pressed = np.maximum(force[list(drive.rubbing)], 0.0)
    half: list[float] = (np.abs(moved) @ (drive.friction[list(drive.rubbing)] * pressed)).tolist()
    return half
