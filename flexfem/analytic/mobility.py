"""Mobility (1), and the tables that say which freedoms each of the nine hinges has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.refused import BadInput

CHAINS = 3
HINGES = 3
LINKS = 8  # ground, platform, two links in each of three chains
KINDS = ("rotation", "axial", "shear")

Freedoms: TypeAlias = tuple[tuple[tuple[str, ...], ...], ...]

_R, _RA, _RAS = KINDS[:1], KINDS[:2], KINDS
FREEDOMS_BY_MOBILITY: dict[int, Freedoms] = {
    3: ((_R, _R, _R),) * CHAINS,
    6: ((_RA, _R, _R),) * CHAINS,
    12: ((_RA, _RA, _RA),) * CHAINS,
    21: ((_RAS, _RAS, _RAS),) * CHAINS,
}


def gruebler_kutzbach(links: int, joint_freedoms: Iterable[int], dimension: int = 3) -> int:
    """M = D (N - 1) + sum (f_i - D) (1), N links with the ground, D = 3 in the plane and 6 in space."""
    return dimension * (links - 1) + sum(f - dimension for f in joint_freedoms)  # (1)


def mobility(freedoms: Freedoms) -> int:
    """Mobility of the stage with this table by (1); raises BadInput as `checked` does."""
    return gruebler_kutzbach(LINKS, (len(hinge) for chain in checked(freedoms) for hinge in chain))


def stage_freedoms(prismatic: ArrayLike) -> Freedoms:
    """Table of a stage whose flags `prismatic` (3 chains, 3 hinges) give a hinge its axial freedom."""
    flags = np.asarray(prismatic, dtype=bool)
    if flags.shape != (CHAINS, HINGES):
        raise BadInput(f"prismatic flags have the shape {flags.shape}, expected 3 chains by 3 hinges")
    return tuple(tuple(_RA if flag else _R for flag in chain) for chain in flags)


def freedoms_of(mobility: int) -> Freedoms:
    """The uniform table of mobility 3, 6, 12 or 21; raises BadInput for any other number."""
    if mobility not in FREEDOMS_BY_MOBILITY:
        known = ", ".join(map(str, FREEDOMS_BY_MOBILITY))
        raise BadInput(f"mobility = {mobility}, expected one of {known}, or none for the stage's own prismatic hinges")
    return FREEDOMS_BY_MOBILITY[mobility]


def checked(freedoms: Sequence[Sequence[Sequence[str]]]) -> Freedoms:
    """The table as tuples, every hinge's freedoms in the order of `KINDS`.

    Raises
    ------
    BadInput: not 3 by 3, a freedom unknown or given twice, or a hinge without rotation. With rotation everywhere
    the mobility cannot fall below three, which the six loop equations need.
    """
    if len(freedoms) != CHAINS or any(len(chain) != HINGES for chain in freedoms):
        raise BadInput("joint freedoms are not a table of 3 chains by 3 hinges")
    for i, chain in enumerate(freedoms, start=1):
        for j, hinge in enumerate(chain, start=1):
            place = f"joint freedoms of chain {i}, hinge {j} = {tuple(hinge)}"
            if len(set(hinge)) != len(hinge) or not set(hinge) <= set(KINDS):
                raise BadInput(f"{place}, expected each of {', '.join(KINDS)} at most once")
            if "rotation" not in hinge:
                raise BadInput(f"{place}, expected rotation among them: a hinge that cannot turn is no joint")
    return tuple(tuple(tuple(k for k in KINDS if k in hinge) for hinge in chain) for chain in freedoms)
