"""Bands of finite elements: how far a number on the finest mesh may be from that at vanishing triangle size.

A number that does not vanish converges steadily. What a stage moves across a command does not: it is what nearly equal
mesh errors of nine hinges leave of each other. Its band is that of the whole compliance, `command_convergence`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from flexfem import arguments
from flexfem.arrays import Array, is_largest
from flexfem.fem.mesh import LAYERS, SOLID_RESOLUTION
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import layers_of, sheet_of
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.setup import about, on_meshes, question, sectors_of, solved
from flexfem.refused import BadInput
from flexfem.results import COARSER as ON_COARSER
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS, Direction

COARSER = 1.3  # least ratio between the resolutions of two levels (Celik et al. 2008)
ORDER = 4.0  # theoretical order of the platform compliance with quadratic triangles: twice that of the strain
CORNER_ORDER = 1.4  # twice the exponent of stress at a clamped edge's corner, 0.69 at nu = 0.33, 0.71 at 0.3 (Williams)
STRESS_ORDER = 3.0  # between 2, of strains in quadratic triangles, and 4, of the platform compliance
SAFETY, CAUTIOUS = 1.25, 3.0  # safety factors of Roache: with the observed order, and with the theoretical one
TRUSTED = (1.0, 6.0)  # observed orders outside are no sign that the asymptotic range is reached
ROUND_OFF = 1e-8  # per cent, and of a value: differences below come from the arithmetic, not from the mesh
DEPENDENT = 1e-6  # share of the largest: combinations of loads with less energy are one load twice, but for round-off
RESOLUTIONS = (3, 4, 6, 8, 11, 15)  # of `converge`
LARGE = 1e-3  # of a compliance: the accuracy that the default mesh is made for

Verdict: TypeAlias = Literal["converging", "oscillatory", "divergent", "out of range", "round-off"]
Found = TypeVar("Found")


def error_matrix(stiffness: Array, compliance: Array, lever: ArrayLike) -> Array:
    """Errors (..., 3, 3), per cent of the command, of poses by forces that a stiffness predicts; column j: command j.

    stiffness, compliance : (..., 3, 3), of the analytic model and of finite elements.   lever : (...), l3, mm.
    """
    far = np.asarray(lever, dtype=float)
    scale = np.stack([np.ones_like(far), np.ones_like(far), far], axis=-1)
    error = compliance @ stiffness - np.eye(3)  # of (18)
    return np.asarray(100.0 * error * scale[..., :, None] / scale[..., None, :])


def percentages(error: Array, commanded: ArrayLike, direction: Direction, lever: float) -> Array:
    """Errors (..., 3), mm, mm, rad, in per cent of commands (...); the lever makes rotations and translations alike."""
    scale = np.array([1.0, 1.0, lever])
    return np.asarray(100.0 * error * scale / (np.asarray(commanded)[..., None] * scale[DIRECTIONS.index(direction)]))


class Convergence(NamedTuple):
    """A number on meshes of growing resolution, its value at vanishing triangle size, and the band about the finest.

    verdict : `converging` when the finest three levels approach a limit with an order within `TRUSTED`; otherwise the
        theoretical order and the safety factor `CAUTIOUS` are used, as they always are across a command.
    order : the order used.   observed : that of the finest three levels, nan where there is none.
    """

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
    e32, e21 = (values[-3:-1] - values[-2:]).tolist()
    r32, r21 = (resolutions[-2:] / resolutions[-3:-1]).tolist()
    finest, larger = float(values[-1]), max(abs(e21), abs(e32))
    noise = round_off * max(1.0, float(np.max(np.abs(values))))
    if larger <= noise:
        return Convergence(values, "round-off", ORDER, np.nan, finest, noise)
    observed = _observed_order(e21, e32, r21, r32)
    verdict: Verdict = "converging" if TRUSTED[0] <= observed <= TRUSTED[1] else "out of range"
    if e21 * e32 < 0:
        verdict = "oscillatory"
    elif abs(e21) >= abs(e32):
        verdict = "divergent"
    order, safety = (observed, SAFETY) if verdict == "converging" else (ORDER, CAUTIOUS)
    left = 1 / (r21**order - 1)
    band = max(safety * left * (larger if verdict == "oscillatory" else abs(e21)), noise)
    return Convergence(values, verdict, order, observed, finest - left * e21, band)


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


def mesh_band(resolutions: Array, values: Array, round_off: float = ROUND_OFF) -> float:
    """Half-width of the mesh uncertainty about the finest of two or three values, coarse to fine.

    The larger, where there are three, of `grid_convergence` and of Roache's index for two meshes, with the theoretical
    order and the safety factor 3: the first alone left out 6 of 36 compliances at resolution 4, the larger none
    (`benchmarks/solid_bands.py`).
    """
    e21, r21 = values[-1] - values[-2], resolutions[-1] / resolutions[-2]
    of_two = float(CAUTIOUS * abs(e21) / (r21**ORDER - 1))
    return of_two if len(values) == 2 else max(grid_convergence(resolutions, values, round_off).band, of_two)


class RelativeError(NamedTuple):
    """Of the finest compliance C, dC = m C + D: largest |m|, and half the spread of the eigenvalues of dC x = e C x."""

    common: float
    spread: float


def _to_finest(steps: Array, values: Array) -> Array:
    """Both differences between three levels, each taken to the finest; `steps`: resolutions^order."""
    n3, n2, n1 = steps[-3:]
    return np.array([(values[-1] - values[-2]) / (n1 / n2 - 1), (values[-2] - values[-3]) / (n1 / n3 - n1 / n2)])


def _relative_error(steps: Array, compliances: Array, loads: Array | None = None) -> RelativeError:
    """Error of the last of three compliances (levels, n, n) in the energy product, by combinations of loads (n, k)."""
    W = _orthonormal(compliances[-1], np.eye(len(compliances[-1])) if loads is None else loads)
    errors = _to_finest(steps, np.array([W.T @ C @ W for C in compliances[-3:]]))
    ends = np.linalg.eigvalsh(errors)[:, [0, -1]]
    return RelativeError(float(np.max(np.abs(ends))), float(np.max(ends[:, 1] - ends[:, 0]) / 2))


def _orthonormal(compliance: Array, loads: Array) -> Array:
    """Combinations W (n, k') of loads (n, k) with W' C W = 1; loads that are combinations of others add none."""
    size = np.sqrt(np.einsum("ik,ij,jk->k", loads, compliance, loads))
    B = loads[:, size > 0] / size[size > 0]
    values, vectors = np.linalg.eigh(B.T @ compliance @ B)
    kept = values > DEPENDENT * values[-1]
    return np.asarray(B @ vectors[:, kept] / np.sqrt(values[kept]))


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
    percents : (levels, 3), coarse to fine.   axis : of the command.   force : (n,), per unit of it, by which they err.
    compliances : (levels, n, n), order x, y, theta, then of other loads.
    readings : (n, 3), loads with which the pose is read, by default unit loads of x, y, theta.

    Notes
    -----
    Along the command, `grid_convergence`, unless readings are given: where joints are held the error along is as much
    a small difference of large numbers as that across. Across, so too where symmetry leaves round-off on every mesh;
    otherwise the error of the compliance C is split, dC = m C + D, with m midway between the extreme eigenvalues of
    dC x = e C x. The first moves a pose c = C f by m c; for the rest, half the spread h of the eigenvalues bounds
    |r' D f| <= h sqrt(r' C r . f' C f) (Cauchy-Schwarz in the energy product). m and h come from both differences
    between the finest three levels, each taken to the finest by the theoretical order; the larger counts, times
    `CAUTIOUS`. One entry may agree by chance; a spread vanishes only when five independent differences do at once.
    """
    found = [grid_convergence(resolutions, values) for values in np.transpose(percents)]
    C, steps = np.asarray(compliances), np.asarray(resolutions, dtype=float) ** ORDER
    read = np.eye(len(force), 3) if readings is None else readings
    error = _relative_error(steps, C, np.column_stack([read, force]))
    bands = CAUTIOUS * percentages(pose_bounds(error, C[-1], force, read), 1.0, DIRECTIONS[axis], lever)
    for k, each in enumerate(found):
        if each.verdict != "round-off" and (k != axis or readings is not None):  # its own order is not to be trusted
            extrapolated = each.values[-1] + _to_finest(steps, each.values)[0]
            found[k] = each._replace(order=ORDER, extrapolated=float(extrapolated), band=float(bands[k]))
    return tuple(found)


def pose_bounds(error: RelativeError, compliance: Array, force: Array, readings: Array) -> Array:
    """How far an error of a compliance (n, n) moves what loads (n, k) read of it under a force (n,): see above."""
    own = np.einsum("ik,ij,jk->k", readings, compliance, readings)
    rest = error.spread * np.sqrt(own * (force @ compliance @ force))
    return np.asarray(error.common * np.abs(readings.T @ compliance @ force) + rest)


def command_errors(
    resolutions: Array, compliances: Array, stiffness: Array, direction: Direction, lever: float
) -> tuple[Convergence, ...]:
    """As `command_convergence`, of compliances (levels, 3, 3) and the stiffness (3, 3) of the analytic model."""
    axis = DIRECTIONS.index(direction)
    percents = error_matrix(stiffness, np.asarray(compliances), lever)[..., axis]
    return command_convergence(resolutions, percents, axis, compliances, stiffness[:, axis], lever)


def error_bands(
    stiffness: Array, compliances: Array, resolutions: tuple[int, ...], lever: float
) -> tuple[Array, Array]:
    """Error percentages (3, 3) on the finest mesh and their bands, column j for command j; as `command_errors`."""
    curves = [command_errors(np.array(resolutions), compliances, stiffness, each, lever) for each in DIRECTIONS]
    values, bands = np.transpose([[(each.values[-1], each.band) for each in curve] for curve in curves])
    return values, bands


def compliance_bands(resolutions: Array, compliances: Array) -> Array:
    """Half-widths (3, 3) of the mesh uncertainty of compliances (levels, 3, 3), of every entry in its own unit.

    On the diagonal `grid_convergence`; off it the bound of `command_convergence` with unit forces. An entry that is
    round-off on every mesh, zero by symmetry, has the largest of its values as its band.
    """
    C, n = np.asarray(compliances), np.asarray(resolutions, dtype=float)
    size = np.sqrt(np.outer(np.diag(C[-1]), np.diag(C[-1])))
    found, error = np.max(np.abs(C), axis=0), _relative_error(n**ORDER, C)
    bound = CAUTIOUS * (error.common * np.abs(C[-1]) + error.spread * size)
    bands = np.where(found <= ROUND_OFF * size, np.maximum(found, np.finfo(float).eps * size), bound)
    np.fill_diagonal(bands, [grid_convergence(n, C[:, k, k], round_off=0.0).band for k in range(3)])
    return np.asarray(bands)


def corner_bands(resolutions: Array, values: Array, order: float = CORNER_ORDER) -> Array:
    """Half-widths (...) of values (3 levels, ...) that corners of clamped edges decide: drift, ranges of a drive.

    Both differences between the meshes are taken to the finest by the order of the corners; the larger counts, with a
    safety factor. It held all 68 numbers of eight random driven stages, of which `mesh_band` left out 23
    (`benchmarks/corner_bands.py`).
    """
    return np.asarray(CAUTIOUS * np.max(np.abs(_to_finest(resolutions**order, values)), axis=0))


def stress_bands(resolutions: Array, values: Array) -> Array:
    """As `corner_bands`, of highest neck stresses, which change their place, and of what follows them, by order 3.

    It held 72 highest stresses of 24 stages, of which the grid convergence index left out 3, one by nine times its band
    (`benchmarks/corner_bands.py`).
    """
    return corner_bands(resolutions, values, STRESS_ORDER)


def highest_band(resolutions: Array, values: Array, bands: Callable[[Array, Array], Array] = stress_bands) -> Array:
    """Bands of values (3 levels, ...) on the finest mesh: that of the highest, nan for the others."""
    highest = np.max(values.reshape(3, -1), axis=1)
    return np.where(is_largest(values[-1]), bands(resolutions, highest), np.nan)


def pose_bands(resolutions: Array, poses: Array, lever: float) -> Array:
    """Half-widths (3, cases) of the mesh uncertainty of poses (levels, 3, cases) on three meshes, coarse to fine.

    The largest of `corner_bands` bounds every component, rotations with the lever.
    """
    scale = np.array([1.0, 1.0, lever])[:, None]
    scaled = poses * scale
    common = np.max(corner_bands(resolutions, scaled), axis=0)
    return np.asarray(_unless_silent(np.max(np.abs(scaled), axis=0), common) / scale)


def layer_bands(few: Array, many: Array) -> Array:
    """Half-widths (3, cases) by the layers of poses (3, cases), all mm, by fewer and by more.

    The largest change of a case's components bounds all of them, times `SAFETY`.
    """
    common = SAFETY * np.max(np.abs(many - few), axis=0)
    return _unless_silent(np.maximum(np.abs(few), np.abs(many)), common)


def _unless_silent(largest: Array, bands: Array) -> Array:
    """Bands (cases,) of all components (3, cases); of those that are round-off on every mesh their largest value."""
    return np.where(largest <= ROUND_OFF * np.max(largest, axis=0), largest, bands)


# three dimensions: the band of the mesh in the plane and that of the layers


class SolidLevels(NamedTuple):
    """Compliances of three meshes with one layer, coarse to fine, and of two numbers of layers on the coarsest."""

    planes: Array
    few: Array
    many: Array

    @property
    def of_layers(self) -> RelativeError:
        """The change from `few` to `many`, times `SAFETY`."""
        lowest, *_, highest = SAFETY * eigh(self.many - self.few, self.many, eigvals_only=True)
        return RelativeError(abs(lowest + highest) / 2, (highest - lowest) / 2)


@once
def solve_solid(stage: Stage, resolution: int = SOLID_RESOLUTION, layers: int = LAYERS) -> Response:
    """Mesh and solve a feasible stage in three dimensions. Raises BadInput, ComputationFailed."""
    check_feasible(stage)
    return unit_response(sectors_of(stage, resolution), sheet_of(stage), layers_of(stage, layers))


@once
def solid_levels(stage: Stage, resolution: int, layers: int) -> SolidLevels:
    """What bounds the compliance that `solve_solid` gives: each error is seen where the other is coarse."""
    planes, (few, many) = coarser(lambda level, count: solve_solid(stage, level, count).compliance, resolution, layers)
    return SolidLevels(np.array(planes), few, many)


def coarser(
    solve: Callable[[int, int], Found], resolution: int, layers: int
) -> tuple[list[Found], tuple[Found, Found]]:
    """What bounds `solve(resolution, layers)`: one layer on three meshes, and two numbers of layers on the coarsest."""
    planes, (_, fewer, most) = levels(resolution), levels(layers)
    return [solve(level, 1) for level in planes], (solve(planes[0], fewer), solve(planes[0], most))


def solid_bands(of: SolidLevels, resolution: int) -> tuple[Array, Array]:
    """Bands (3, 3) of a compliance on a mesh of some resolution, by the mesh in the plane and by the layers.

    They add up: neither is known to take from the other. So few layers show no order that could be trusted; their band
    is the last change of all entries together, by Cauchy-Schwarz, times `SAFETY`.
    """
    size, change = np.sqrt(np.outer(np.diag(of.many), np.diag(of.many))), of.of_layers
    zero = np.maximum(np.abs(of.few), np.abs(of.many)) <= ROUND_OFF * size  # by symmetry
    thickness = np.where(zero, np.finfo(float).eps, change.common + change.spread) * size
    steps = np.array(levels(resolution))
    plane = compliance_bands(steps, of.planes)
    np.fill_diagonal(plane, [mesh_band(steps, of.planes[:, k, k], 0.0) for k in range(3)])
    return plane, thickness


def solid_pose_bands(solve: Callable[[int, int], Array], resolution: int, layers: int) -> Array:
    """Half-widths (3, cases) of poses, all mm, that `solve` gives for a mesh in the plane and layers."""
    meshed, layered = coarser(solve, resolution, layers)
    return pose_bands(np.array(levels(resolution), dtype=float), np.array(meshed), 1.0) + layer_bands(*layered)


# the question


class MeshConvergence(Result):
    """Platform compliance of a stage on meshes of growing resolution, and what it tends to."""

    title = "mesh convergence"
    figure = "errors.convergence_figure"
    along = Quantity("compliance along each direction", "compliance", ("mesh", "direction"), ON_COARSER)
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), ON_COARSER)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.1))
    triangles = Quantity("triangles", "", ("mesh",), Gate(0.05))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))
    compliance = Quantity(
        "compliance", "compliance matrix", ("mesh", "component", "direction"), ON_COARSER, "matrix", shown=False
    )

    @property
    def resolutions(self) -> list[int]:
        """Triangles across every neck, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """How the three finest meshes behave, by direction."""
        return [note.partition(": ")[2] for note in self.notes]


@question
def converge(
    stage: Stage, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> MeshConvergence:
    """Solve a stage on finer and finer meshes: observed order, extrapolated compliance, band.

    Parameters
    ----------
    resolutions : list of int, optional
        Triangles across every neck, coarse to fine, three or more, each 1.3 times the one before; by default 3 to 15.
    {shared}

    Notes
    -----
    I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001; the band is Roache's index, with his safety factors.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.converge(flexfem.load("geometry/mobility6.toml"), resolutions=[2, 3, 4])
    >>> found.verdicts
    ['converging', 'converging', 'converging']
    """
    check_feasible(stage)
    steps = tuple(arguments.resolutions(RESOLUTIONS if resolutions is None else resolutions))
    if len(steps) < 3 or min(fine / coarse for coarse, fine in pairwise(steps)) < COARSER:
        said = f"expected three or more, each at least {COARSER:g} times the one before"
        raise BadInput(f"resolutions {list(steps)}, {said}")
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    C = np.array([each.compliance for each in meshes])
    own = np.diagonal(C, axis1=1, axis2=2)
    found = [grid_convergence(np.array(steps), values, round_off=0.0) for values in own.T]
    band = np.full(own.shape, np.nan)
    band[-1] = [each.band for each in found]
    values: dict[str, Any] = {name: [getattr(each, name) for each in meshes] for name in ("triangles", "unknowns")}
    values |= {"along": own, "compliance": C}
    values |= {"extrapolated": [each.extrapolated for each in found], "order": [each.observed for each in found]}
    large = [
        f"the mesh band of the compliance in {axis} is ±{100 * each.band / abs(each.extrapolated):.2g} % "
        f"({each.verdict}); finer meshes narrow it"
        for axis, each in zip(DIRECTIONS, found, strict=True)
        if each.band > LARGE * abs(each.extrapolated)
    ]
    return MeshConvergence(
        about(stage),
        values,
        {"along": band, "extrapolated": band[-1]},
        {"mesh": [f"{level} across a neck" for level in steps]},
        warnings=[*warning.of_numbers(stage), *large],
        notes=[f"meshes in {axis}: {each.verdict}" for axis, each in zip(DIRECTIONS, found, strict=True)],
    )
