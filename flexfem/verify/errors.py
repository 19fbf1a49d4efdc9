"""Error percentages of Section V, and how far a number on one mesh may be from the number on no mesh at all.

The force that a stiffness predicts for a command is applied to a compliance. A number that does not vanish converges
steadily, and three meshes show how. What a stage moves across a command does not: it is what nearly equal mesh errors
of nine hinges leave of each other, it changes its sign from mesh to mesh, and two meshes may agree by chance. Its band
is taken from the whole error of the compliance, `command_convergence`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array
from flexfem.verify.case import DIRECTIONS, Direction
from flexfem.verify.energy import RelativeError, relative_error


class Comparison(NamedTuple):
    """Analytic forces and the finite elements' answer.

    force : (points, 3), N, N, N mm, by (18), or of the exact equilibrium.
    error : (points, 3), mm, mm, rad, finite-element pose minus commanded.
    percent : (3,), at the largest command.
    """

    force: Array
    error: Array
    percent: Array


def compare(stiffness: Array, compliance: Array, direction: Direction, commanded: Array, lever: float) -> Comparison:
    """Apply the force that an analytic stiffness predicts to a finite-element compliance.

    Parameters
    ----------
    stiffness, compliance : (3, 3), order x, y, theta.
    commanded : (points,), mm or rad.
    lever : l3, mm, by which rotations become comparable with translations.
    """
    axis = DIRECTIONS.index(direction)
    command = np.zeros((len(commanded), 3))
    command[:, axis] = commanded
    force = command @ stiffness.T  # (18)
    error = force @ compliance.T - command
    largest = int(np.argmax(commanded))
    return Comparison(force, error, percentages(error[largest], commanded[largest], direction, lever))


def percentages(error: Array, commanded: float, direction: Direction, lever: float) -> Array:
    """Error (3,), mm, mm, rad, in per cent of one command; the lever makes rotations and translations comparable."""
    scale = np.array([1.0, 1.0, lever])
    return np.asarray(100.0 * error * scale / (commanded * scale[DIRECTIONS.index(direction)]))


def error_matrix(stiffness: Array, compliance: Array, lever: ArrayLike) -> Array:
    """Error percentages (..., 3, 3) of `compare`; column j for command j, order x, y, theta.

    `stiffness`, `compliance` (..., 3, 3) and `lever` (...) broadcast.
    """
    far = np.asarray(lever, dtype=float)
    scale = np.stack([np.ones_like(far), np.ones_like(far), far], axis=-1)
    error = compliance @ stiffness - np.eye(3)  # of (18)
    return np.asarray(100.0 * error * scale[..., :, None] / scale[..., None, :])


COARSER = 1.3  # least ratio between the resolutions of two levels (Celik et al. 2008)
ORDER = 4.0  # theoretical order of the platform compliance with quadratic triangles: twice that of the strain
SAFETY, CAUTIOUS = 1.25, 3.0  # safety factors of Roache: with the observed order, and with the theoretical one
TRUSTED = (1.0, 6.0)  # observed orders outside are no sign that the asymptotic range is reached
ROUND_OFF = 1e-8  # per cent, and of a value: differences below come from the arithmetic, not from the mesh

Verdict: TypeAlias = Literal["converging", "oscillatory", "divergent", "out of range", "round-off"]


class Convergence(NamedTuple):
    """A number on meshes of growing resolution.

    resolutions, values : (levels,), coarse to fine.
    verdict : `converging` when the finest three levels approach a limit with an order within `TRUSTED`; otherwise the
        theoretical order and the safety factor `CAUTIOUS` are used, as they always are across a command.
    order : the order used.  observed : the one observed on the finest three levels, nan where there is none.
    extrapolated : value at vanishing triangle size.  band : half-width about the finest value.
    """

    resolutions: Array
    values: Array
    verdict: Verdict
    order: float
    observed: float
    extrapolated: float
    band: float


def levels(resolution: int) -> tuple[int, int, int]:
    """Three resolutions, coarse to fine, `COARSER` or more apart, that end with the one given (at least 4)."""
    middle = int(resolution / COARSER)
    return int(middle / COARSER), middle, resolution


def grid_convergence(resolutions: Array, values: Array, round_off: float = ROUND_OFF) -> Convergence:
    """Grid convergence index of a number on three or more re-meshed levels, coarse to fine.

    Notes
    -----
    With triangle sizes h1 < h2 < h3, r21 = h2 / h1, r32 = h3 / h2, e21 = f2 - f1, e32 = f3 - f2, the observed order
    solves `p = |ln |e32 / e21| + ln((r21^p - s) / (r32^p - s))| / ln r21`, s = sign(e32 / e21); the extrapolated value
    is `f1 - e21 / (r21^p - 1)`, the band `F |e21| / (r21^p - 1)`: I. B. Celik, U. Ghia, P. J. Roache, C. J. Freitas,
    H. Coleman, P. E. Raad, J. Fluids Eng. 130 (2008) 078001; P. J. Roache, J. Fluids Eng. 116 (1994) 405.
    """
    resolutions, values = np.asarray(resolutions, dtype=float), np.asarray(values, dtype=float)
    f3, f2, f1 = values[-3:]
    n3, n2, n1 = resolutions[-3:]
    r21, r32 = n1 / n2, n2 / n3
    e21, e32 = f2 - f1, f3 - f2
    noise = round_off * max(1.0, float(np.max(np.abs(values))))
    if max(abs(e21), abs(e32)) <= noise:
        return Convergence(resolutions, values, "round-off", ORDER, np.nan, float(f1), noise)
    observed = _observed_order(e21, e32, r21, r32)
    verdict = _verdict(e21, e32, observed)
    order, safety = (observed, SAFETY) if verdict == "converging" else (ORDER, CAUTIOUS)
    correction = e21 / (r21**order - 1)
    distance = max(abs(e21), abs(e32)) / (r21**order - 1) if verdict == "oscillatory" else abs(correction)
    band = max(safety * distance, noise)
    return Convergence(resolutions, values, verdict, order, observed, float(f1 - correction), float(band))


def mesh_band(resolutions: Array, values: Array, round_off: float = ROUND_OFF) -> float:
    """Half-width of the mesh uncertainty about the finest of two or three values, coarse to fine.

    Notes
    -----
    The larger, where there are three, of `grid_convergence` and of Roache's index for two meshes, with the theoretical
    order and the safety factor 3: on meshes as coarse as these the observed order often exceeds the theoretical one,
    and the first alone left out the extrapolated value of 6 in 36 compliances of a dozen stages at resolution 4, the
    larger of none. In three dimensions the first alone left out 2 truths of 36, the larger of none
    (`benchmarks/solid_bands.py`).
    """
    e21, r21 = values[-1] - values[-2], resolutions[-1] / resolutions[-2]
    of_two = float(CAUTIOUS * abs(e21) / (r21**ORDER - 1))
    return of_two if len(values) == 2 else max(grid_convergence(resolutions, values, round_off).band, of_two)


def command_convergence(
    resolutions: Array,
    percents: Array,
    axis: int,
    compliances: Array,
    force: Array,
    lever: float,
    readings: Array | None = None,
) -> tuple[Convergence, ...]:
    """Grid convergence of the three error percentages of one command.

    Parameters
    ----------
    percents : (levels, 3), coarse to fine.   axis : of the command.
    compliances : (levels, n, n), order x, y, theta, then of other loads.   force : (n,), per unit of the command, by
        which they err.   readings : (n, 3), loads with which the pose is read, by default unit loads of x, y, theta.

    Notes
    -----
    Along the command, `grid_convergence`, unless readings are given: where joints are held the error along is as much
    a small difference of large numbers as that across. Across, so too where symmetry leaves round-off on every mesh;
    otherwise the error of the compliance C is split into a multiple of it and a rest, dC = m C + D, with m midway
    between the extreme eigenvalues of dC x = e C x. The first moves a pose c = C f by m c; for the rest, half the
    spread h of the eigenvalues bounds |r' D f| <= h sqrt(r' C r . f' C f) (Cauchy-Schwarz in the energy product),
    whatever r is read and f applied. m and h come from both differences between the finest three levels, each taken
    to the finest by the theoretical order; the larger counts, times `CAUTIOUS`. Differences of one entry may vanish by
    chance; a spread vanishes only when five independent differences do at once.
    """
    found = [grid_convergence(resolutions, values) for values in np.transpose(percents)]
    comparable = 100.0 * np.array([1.0, 1.0, lever]) / (lever if axis == 2 else 1.0)
    C = np.asarray(compliances)
    read = np.eye(len(force), 3) if readings is None else readings
    error = relative_error(np.asarray(resolutions, dtype=float) ** ORDER, C, np.column_stack([read, force]))
    bands = CAUTIOUS * comparable * pose_bounds(error, C[-1], force, read)
    return tuple(
        each if (k == axis and readings is None) or each.verdict == "round-off" else _across(each, float(band))
        for k, (each, band) in enumerate(zip(found, bands, strict=True))
    )


def command_errors(
    resolutions: Array, compliances: Array, stiffness: Array, direction: Direction, lever: float
) -> tuple[Convergence, ...]:
    """Grid convergence of the three error percentages of one command.

    Parameters
    ----------
    compliances : (levels, 3, 3), of finite elements, coarse to fine.   stiffness : (3, 3), of the model, as `compare`.
    """
    axis = DIRECTIONS.index(direction)
    percents = np.array([error_matrix(stiffness, each, lever)[:, axis] for each in compliances])
    return command_convergence(resolutions, percents, axis, compliances, stiffness[:, axis], lever)


def error_bands(
    stiffness: Array, compliances: Array, resolutions: tuple[int, ...], lever: float
) -> tuple[Array, Array]:
    """Error percentages (3, 3) on the finest mesh and their bands, column j for command j; as `command_errors`."""
    steps = np.array(resolutions)
    curves = [command_errors(steps, compliances, stiffness, direction, lever) for direction in DIRECTIONS]
    found = np.array([[(each.values[-1], each.band) for each in curve] for curve in curves])
    return found[..., 0].T, found[..., 1].T


def compliance_bands(resolutions: Array, compliances: Array) -> Array:
    """Half-widths (3, 3) of the mesh uncertainty of a compliance, of every entry in its own unit.

    Parameters
    ----------
    compliances : (levels, 3, 3), coarse to fine, order x, y, theta.

    Notes
    -----
    On the diagonal `grid_convergence`; off it the bound of `command_convergence` with unit forces. An entry that is
    round-off on every mesh, zero by symmetry, has the largest of its values as its band.
    """
    C, n = np.asarray(compliances), np.asarray(resolutions, dtype=float)
    size = np.sqrt(np.outer(np.diag(C[-1]), np.diag(C[-1])))
    found, error = np.max(np.abs(C), axis=0), relative_error(n**ORDER, C)
    bound = CAUTIOUS * (error.common * np.abs(C[-1]) + error.spread * size)
    bands = np.where(found <= ROUND_OFF * size, np.maximum(found, np.finfo(float).eps * size), bound)
    for k in range(3):
        bands[k, k] = grid_convergence(n, C[:, k, k], round_off=0.0).band
    return np.asarray(bands)


def pose_bounds(error: RelativeError, compliance: Array, force: Array, readings: Array) -> Array:
    """How far an error of a compliance (n, n) moves what is read of it (k,) under a force (n,): `command_convergence`.

    Parameters
    ----------
    readings : (n, k), loads with which it is read.
    """
    own = np.einsum("ik,ij,jk->k", readings, compliance, readings)
    rest = error.spread * np.sqrt(own * (force @ compliance @ force))
    return np.asarray(error.common * np.abs(readings.T @ compliance @ force) + rest)


def _across(found: Convergence, band: float) -> Convergence:
    """A number across a command: its own observed order is not to be trusted."""
    f2, f1 = found.values[-2:]
    n2, n1 = found.resolutions[-2:] ** ORDER
    return found._replace(order=ORDER, extrapolated=float(f1 + (f1 - f2) / (n1 / n2 - 1)), band=band)


def _observed_order(e21: float, e32: float, r21: float, r32: float) -> float:
    """Order by fixed-point iteration; nan when there is none."""
    if e21 == 0 or e32 == 0:
        return float("nan")
    sign = float(np.sign(e32 / e21))
    order = abs(np.log(abs(e32 / e21))) / np.log(r21)
    for _ in range(100):
        if not 1e-6 < order < 50:
            return float("nan")
        shift = np.log((r21**order - sign) / (r32**order - sign))
        order, last = abs(np.log(abs(e32 / e21)) + shift) / np.log(r21), order
        if abs(order - last) < 1e-12 * order:
            break
    return float(order)


def _verdict(e21: float, e32: float, observed: float) -> Verdict:
    if e21 * e32 < 0:
        return "oscillatory"
    if abs(e21) >= abs(e32):
        return "divergent"
    return "converging" if TRUSTED[0] <= observed <= TRUSTED[1] else "out of range"
