"""Which modes are the lowest, which of several models have one shape, and how the output moves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.mesh import PlaneMesh
from flexfem.questions.setup import ModelAnswer
from flexfem.results import SOLID

# relative difference of frequencies of modes that symmetry makes equal, on a mesh without symmetry
EQUAL = 1e-4
# motion of the output in a mode, relative to the largest of all modes, that counts as none
STILL = 1e-3
LEAST_ALIKE = 0.5  # modal assurance of two modes of one shape, from 0 to 1
# relative difference of frequencies up to which modes are compared as a group: models differ by it
CLOSE = 0.01
# weight of the likeness of two modes themselves where their groups are alike
OF_ITSELF = 1e-3
# ratio of the highest frequency of finite elements to that of a mode from which it is said to have
# no partner: analytic frequencies of higher modes are up to 28 % too low
FAR = 1.5
NONE = -1  # no mode


def lowest_modes(found: Mapping[str, ModelAnswer], count: int) -> Index:
    """Return which modes are the lowest (count,); those from `count` on are out of the plane."""
    if SOLID not in found:
        return np.arange(count)
    frequencies = found[SOLID].values["frequency"]
    return np.argsort(frequencies, kind="stable")[:count]


class ModeRows(NamedTuple):
    """Modes of models side by side: those of the same shape are in one row.

    modes : the number of the mode of each model in every row, `NONE` for no mode.
    alone : names of the last rows, of modes that finite elements do not have.
    """

    modes: dict[str, Index]
    alone: list[str]


def side_by_side(
    found: Mapping[str, ModelAnswer],
    order: Index,
    count: int,
    alike: Mapping[str, Array],
) -> ModeRows:
    """Return modes by shape: first those of the last model in an order, then those of others alone.

    order : of the modes of the last model; those from `count` on are out of the plane.
    alike : likeness (m, k) of the m modes of a model and the first k modes in the plane of the last
        one. Modes of a model without it are in the order of the last one.
    """
    *others, last = found
    planar = np.flatnonzero(order < count)
    highest = np.nanmax(of_modes(found[last].values["frequency"], order))
    modes = {label: np.full(len(order), NONE) for label in others}
    single = list[tuple[str, int]]()
    for label in others:
        frequencies = found[label].values["frequency"]
        mode_of = np.arange(min(count, len(frequencies)))
        if label in alike:
            mode_of = partners(alike[label], frequencies, found[last].values["frequency"][:count])
            lonely = np.setdiff1d(np.arange(len(frequencies)), mode_of)
            single += [(label, k) for k in lonely.tolist() if FAR * frequencies[k] < highest]
        known = order[planar] < len(mode_of)
        modes[label][planar[known]] = mode_of[order[planar[known]]]
    for label, column in modes.items():
        below = [k if name == label else NONE for name, k in single]
        modes[label] = np.append(column, np.array(below, dtype=int))
    modes[last] = np.append(order, np.full(len(single), NONE))
    return ModeRows(modes, [f"{label} {k + 1}" for label, k in single])


def in_rows(found: Mapping[str, ModelAnswer], rows: ModeRows) -> dict[str, ModelAnswer]:
    """Return the frequencies of all models in rows, nan in a row that a model has no mode in."""

    def placed(label: str, part: Mapping[str, Array]) -> dict[str, Array]:
        if "frequency" not in part:
            return {}
        return {"frequency": of_modes(part["frequency"], rows.modes[label])}

    return {
        label: ModelAnswer(placed(label, one.values), placed(label, one.bands))
        for label, one in found.items()
    }


def of_modes(values: Array, modes: Index) -> Array:
    """Return the rows of values by modes, nan for no mode and for what is not finite."""
    missing = np.full((1, *values.shape[1:]), np.nan)
    found = np.concatenate([values, missing])[np.where(modes < len(values), modes, NONE)]
    return np.where(np.isfinite(found), found, np.nan)


def partners(
    alike: Array,
    frequencies: Array,
    of_elements: Array,
) -> Index:
    """Return the mode of a model that has the shape of each mode of finite elements, or `NONE`.

    Parameters
    ----------
    alike : (m, k)
        Likeness of m modes of a model and k modes of finite elements, from 0 to 1.
    frequencies, of_elements : (m,), (k,), rad/s
        Of both, ascending; those that are missing are apart from all others.

    Notes
    -----
    Modes of close frequencies can be turned among each other, by symmetry or by small differences
    of the models. Such groups are compared as subspaces: the likeness of two of them is the sum of
    those of their modes, per mode of the smaller group.
    """
    from scipy.optimize import linear_sum_assignment

    ours = _groups(frequencies, alike.shape[0])
    theirs = _groups(of_elements, alike.shape[1])
    sizes = np.minimum.outer(ours.sum(axis=1), theirs.sum(axis=1))
    of_groups = ours.T @ (ours @ alike @ theirs.T / sizes) @ theirs
    shared = np.maximum(alike, of_groups)
    worth = np.where(shared > LEAST_ALIKE, shared + OF_ITSELF * alike, 0.0)
    rows, columns = linear_sum_assignment(worth, maximize=True)
    found = np.full(alike.shape[1], NONE)
    found[columns] = np.where(worth[rows, columns] > 0, rows, NONE)
    return found


def _groups(frequencies: Array, count: int) -> Array:
    """Return which of some modes (g, count) are in each group of ascending, close frequencies.

    They are 1, others 0. Modes beyond those of the frequencies are groups of their own.
    """
    starts = np.ones(count, dtype=np.bool_)
    known = frequencies[:count]
    starts[1 : len(known)] = known[1:] >= (1 + CLOSE) * known[:-1]
    numbers = np.cumsum(starts) - 1
    return np.array(np.arange(numbers[-1] + 1)[:, None] == numbers, dtype=np.float64)


def likeness(
    mesh: PlaneMesh,
    ours: Array,
    theirs: Array,
) -> Array:
    """Return the likeness (m, k) of modes by displacements of the nodes of one mesh, in its plane.

    It is their modal assurance by displacements over the plate: the squared product of both per
    that of their sizes, from 0 to 1.   ours, theirs : (m or k, n, 2 or 3).
    """
    corners = mesh.nodes[mesh.triangles[:, :3]] @ [1, 1j]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.repeat((sides[:, 0].conjugate() * sides[:, 1]).imag, 6)
    weights = np.bincount(mesh.triangles.ravel(), areas, len(mesh.nodes))
    first, second = (
        (fields[:, :, :2] * np.sqrt(weights)[:, None]).reshape(len(fields), -1)
        for fields in (ours, theirs)
    )
    products = first @ second.T
    sizes = np.outer(np.sum(first**2, axis=1), np.sum(second**2, axis=1))
    return np.asarray(products**2 / sizes)


def shares_of_motion(frequencies: Array, motion: Array) -> Array:
    """Return the shares (modes, 3), %, of directions in squared motions (modes, 3) of the output;
    nan without motion.

    Modes of equal frequency are combined to those of which the first alone moves along x, or else
    along y.
    """
    motion = motion.copy()
    starts = np.flatnonzero(np.diff(frequencies) > EQUAL * frequencies[1:]) + 1
    for group in np.split(motion, starts):
        sizes = np.linalg.norm(group, axis=0)
        order = np.argsort(sizes < STILL * sizes.max(), kind="stable")
        group[:, order] = np.linalg.qr(group[:, order], mode="complete")[1]
    squares = motion**2
    whole = squares.sum(axis=1, keepdims=True)
    moving = whole > STILL**2 * whole.max()
    return 100 * squares / np.where(moving, whole, np.nan)
