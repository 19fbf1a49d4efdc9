"""Error bands of finite elements: bounds of the discretisation error of a number on the finest
mesh.

A number that does not vanish converges monotonically. The motion of a stage across a command does
not, because it is the difference of nearly equal mesh errors of nine hinges: `command_convergence`
bounds it by the whole compliance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from flexfem import arguments
from flexfem.arrays import Array, is_largest
from flexfem.questions.setup import on_meshes
from flexfem.refused import BadInput
from flexfem.results import Progress
from flexfem.units import DIRECTIONS, Direction

LEAST_RATIO = 1.3  # least ratio between the resolutions of two levels (Celik et al. 2008)
# theoretical order of the platform compliance with quadratic triangles: twice that of the strain
ORDER = 4.0
# twice Williams' displacement exponent at a clamped corner: 0.69 at nu = 0.33, 0.71 at 0.3
CORNER_ORDER = 1.4
# between 2, of strains in quadratic triangles, and 4, of the compliance of the output
STRESS_ORDER = 3.0
SAFETY = 1.25  # safety factor of Roache with the observed order
CAUTIOUS = 3.0  # the same with the theoretical order
TRUSTED = (1.0, 6.0)  # an observed order outside does not indicate the asymptotic range
# times the least stiffness of an output: `new` writes mechanisms that move below 42 and guide above
# 154
HELD = 100.0
# per cent, and relative to a value: smaller differences are due to floating-point arithmetic
ROUND_OFF = 1e-8
# of the largest energy: load combinations with less are linearly dependent up to round-off
DEPENDENT = 1e-6

Verdict: TypeAlias = Literal["converging", "oscillatory", "divergent", "out of range", "round-off"]
Solution = TypeVar("Solution")


def error_matrix(
    stiffness: Array,
    compliance: Array,
    lever: ArrayLike,
) -> Array:
    """Return the errors (..., 3, 3), per cent of the command, of poses under predicted forces;
    column j: command j.

    stiffness, compliance : (..., 3, 3), of the analytic model and of finite elements.   lever :
    (...), l3, mm."""
    length = np.asarray(lever, dtype=float)
    scale = np.stack([np.ones_like(length), np.ones_like(length), length], axis=-1)
    error = compliance @ stiffness - np.eye(3)  # of (18)
    return np.asarray(100.0 * error * scale[..., :, None] / scale[..., None, :])


def free_errors(
    model: Array,
    elements: Array,
    lever: float,
) -> Array:
    """Return the errors (..., 3, 3), per cent of the command, of motions under single loads; column
    j: command j.

    A load along the command alone moves the model by the command, and its output is free in the
    other directions. The error is the motion of finite elements minus that of the model. Along the
    command it is also the error of the stiffness of the model with the other directions free.

    model, elements : (..., 3, 3), compliances of the output.   lever : mm.
    """
    scale = np.array([1.0, 1.0, lever])
    diagonal = np.diagonal(model, axis1=-2, axis2=-1)[..., None, :]
    return np.asarray(100.0 * (elements - model) / diagonal * scale[:, None] / scale)


def amplification_errors(
    model: Array,
    elements: Array,
    lever: float,
) -> Array:
    """Return the errors (...), per cent, of the output motions (..., 3) per opening of an actuator
    by a model.

    They are relative to those of finite elements, along these; rotations are multiplied by the
    lever, mm."""
    weights = np.array([1.0, 1.0, lever**2])
    along, whole = (np.sum(weights * each * elements, axis=-1) for each in (model, elements))
    return np.asarray(100.0 * (along / whole - 1.0))


def amplification_bands(
    model: Array,
    elements: Array,
    widths: Array,
    lever: float,
) -> Array:
    """Return the bands (...) of `amplification_errors` from those of the motions of finite elements
    (..., 3).
    """
    weights = np.array([1.0, 1.0, lever**2])
    relative = np.sum(weights * np.abs(elements) * widths, axis=-1) / np.sum(
        weights * elements**2, axis=-1
    )
    return np.asarray((100.0 + amplification_errors(model, elements, lever)) * relative)


def held(compliance: Array, lever: float) -> Array:
    """Return the directions (3,) in which an output of a compliance (3, 3) is held: far stiffer
    than the softest one.

    Rotations are multiplied by the lever, mm. There a share of a commanded motion says nothing
    about the use."""
    softness = np.diag(compliance) * np.array([1.0, 1.0, lever**2])
    return np.asarray(HELD * softness < np.max(softness))


def percentages(
    error: Array,
    commanded: ArrayLike,
    direction: Direction,
    lever: float,
) -> Array:
    """Return errors (..., 3), mm, mm, rad, in per cent of commands (...); the lever scales
    rotations to lengths.
    """
    scale = np.array([1.0, 1.0, lever])
    return np.asarray(
        100.0
        * error
        * scale
        / (np.asarray(commanded)[..., None] * scale[DIRECTIONS.index(direction)])
    )


class Convergence(NamedTuple):
    """Values on meshes of increasing resolution, their extrapolated limit, and the error band of
    the finest value.

    verdict : `converging` if the finest three levels approach a limit with an order within
    `TRUSTED`; otherwise, and
        always across a command, the theoretical order and the safety factor `CAUTIOUS` are used.
    order, observed : the order used, and the observed one of the finest three levels, nan if there
    is none."""

    values: Array
    verdict: Verdict
    order: float
    observed: float
    extrapolated: float
    band: float


def levels(resolution: int) -> tuple[int, int, int]:
    """Return three resolutions, coarse to fine, up to the given one (at least 4), with ratios of
    `COARSE_MESHES` or more.
    """
    middle = int(resolution / LEAST_RATIO)
    return int(middle / LEAST_RATIO), middle, resolution


def grid_convergence(
    resolutions: Array, values: Array, round_off: float = ROUND_OFF
) -> Convergence:
    """Return the grid convergence index of values on three or more independent meshes, coarse to
    fine.

    Notes
    -----
    With triangle sizes h1 < h2 < h3, r21 = h2 / h1, r32 = h3 / h2, e21 = f2 - f1, e32 = f3 - f2,
    the observed order solves `p = |ln |e32 / e21| + ln((r21^p - s) / (r32^p - s))| / ln r21`, s =
    sign(e32 / e21); the extrapolated value is `f1 - e21 / (r21^p - 1)`, the band `F |e21| / (r21^p
    - 1)`: I. B. Celik, U. Ghia, P. J. Roache, C. J. Freitas, H. Coleman, P. E. Raad, J. Fluids Eng.
    130 (2008) 078001; P. J. Roache, J. Fluids Eng. 116 (1994) 405."""
    resolutions = np.asarray(resolutions, dtype=float)
    values = np.asarray(values, dtype=float)
    e32, e21 = (values[-3:-1] - values[-2:]).tolist()
    r32, r21 = (resolutions[-2:] / resolutions[-3:-1]).tolist()
    finest = float(values[-1])
    larger = max(abs(e21), abs(e32))
    noise = round_off * max(1.0, float(np.max(np.abs(values))))
    if larger <= noise:
        return Convergence(values, "round-off", ORDER, np.nan, finest, noise)
    observed = _observed_order(e21, e32, r21, r32)
    verdict: Verdict = "out of range"
    if e21 * e32 < 0:
        verdict = "oscillatory"
    elif abs(e21) >= abs(e32):
        verdict = "divergent"
    elif TRUSTED[0] <= observed <= TRUSTED[1]:
        verdict = "converging"
    order, safety = (observed, SAFETY) if verdict == "converging" else (ORDER, CAUTIOUS)
    remainder = 1 / (r21**order - 1)
    band = max(safety * remainder * (larger if verdict == "oscillatory" else abs(e21)), noise)
    return Convergence(values, verdict, order, observed, finest - remainder * e21, band)


def _observed_order(
    e21: float,
    e32: float,
    r21: float,
    r32: float,
) -> float:
    """Return the observed order by fixed-point iteration, nan if there is none."""
    if e21 == 0 or e32 == 0:
        return float("nan")
    sign = np.sign(e32 / e21)
    ratio = np.log(abs(e32 / e21))
    order = abs(ratio) / np.log(r21)
    for _ in range(100):
        if not 1e-6 < order < 50:
            return float("nan")
        shift = np.log((r21**order - sign) / (r32**order - sign))
        order, last = abs(ratio + shift) / np.log(r21), order
        if abs(order - last) < 1e-12 * order:
            break
    return float(order)


def refinements(resolutions: Sequence[int]) -> tuple[int, ...]:
    """Return resolutions of a convergence study. Raises BadInput unless three or more grow by
    `COARSE_MESHES` or more.
    """
    steps = tuple(arguments.resolutions(resolutions))
    if len(steps) < 3 or min(fine / coarse for coarse, fine in pairwise(steps)) < LEAST_RATIO:
        expected = f"three or more, each at least {LEAST_RATIO:g} times the one before"
        raise BadInput(f"resolutions {list(steps)}, expected {expected}")
    return steps


def mesh_band(
    resolutions: Array,
    values: Array,
    round_off: float = ROUND_OFF,
) -> float:
    """Return the half-width of the mesh uncertainty of the finest of two or three values, coarse to
    fine.

    For two values it is Roache's index with the theoretical order and the safety factor 3; for
    three values, the larger of this index and of `grid_convergence`. At resolution 4,
    `grid_convergence` alone missed 6 of 36 compliances, the larger index none
    (`benchmarks/solid_bands.py`)."""
    e21 = values[-1] - values[-2]
    r21 = resolutions[-1] / resolutions[-2]
    two_meshes = float(CAUTIOUS * abs(e21) / (r21**ORDER - 1))
    return (
        two_meshes
        if len(values) == 2
        else max(grid_convergence(resolutions, values, round_off).band, two_meshes)
    )


class RelativeError(NamedTuple):
    """Error dC = m C + D of a compliance C: largest |m|, and half the spread of the eigenvalues of
    dC x = e C x.
    """

    common: float
    spread: float

    def of_readings(
        self,
        compliance: Array,
        force: Array,
        readings: Array,
    ) -> Array:
        """Bound the change (k,) of readings (n, k) under a force (n,) of a compliance (n, n):
        `command_convergence`.
        """
        energy = np.einsum("ik,ij,jk->k", readings, compliance, readings)
        remainder = self.spread * np.sqrt(energy * (force @ compliance @ force))
        return np.asarray(self.common * np.abs(readings.T @ compliance @ force) + remainder)


def _to_finest(steps: Array, values: Array) -> Array:
    """Extrapolate both differences between three levels to errors of the finest; `steps`:
    resolutions^order.
    """
    n3, n2, n1 = steps[-3:]
    return np.array(
        [(values[-1] - values[-2]) / (n1 / n2 - 1), (values[-2] - values[-3]) / (n1 / n3 - n1 / n2)]
    )


def _relative_error(
    steps: Array,
    compliances: Array,
    loads: Array,
) -> RelativeError:
    """Return the error, in the energy norm over loads (n, k), of the last of three compliances
    (levels, n, n).

    Loads that are linearly dependent up to round-off are dropped.
    """
    C = compliances[-1]
    norm = np.sqrt(np.einsum("ik,ij,jk->k", loads, C, loads))
    B = loads[:, norm > 0] / norm[norm > 0]
    values, vectors = np.linalg.eigh(B.T @ C @ B)
    kept = values > DEPENDENT * values[-1]
    W = B @ vectors[:, kept] / np.sqrt(values[kept])  # W' C W = 1
    ends = np.linalg.eigvalsh(
        _to_finest(steps, np.array([W.T @ each @ W for each in compliances[-3:]]))
    )[:, [0, -1]]
    return RelativeError(float(np.max(np.abs(ends))), float(np.max(ends[:, 1] - ends[:, 0]) / 2))


def command_convergence(
    resolutions: Array,
    percents: Array,
    axis: int,
    compliances: Array,
    force: Array,
    lever: float,
    readings: Array | None = None,
) -> tuple[Convergence, ...]:
    """Return the grid convergence of the three error percentages of one command.

    Parameters
    ----------
    percents : (levels, 3), coarse to fine.   axis : index of the command.   force : (n,), per unit
    command.
    compliances : (levels, n, n), for loads in x, y, theta, then other loads.
    readings : (n, 3), loads whose work is the pose, by default unit loads in x, y, theta.

    Notes
    -----
    Along the command, `grid_convergence` is used unless readings are given: with joints held, this
    error is a small difference of large numbers, too. Across the command, it is used if symmetry
    leaves round-off on every mesh. Otherwise, the error of the compliance C is split, dC = m C + D,
    with m midway between the extreme eigenvalues of dC x = e C x. The first part changes a pose c =
    C f by m c; the second is bounded by half the spread h of the eigenvalues, |r' D f| <= h sqrt(r'
    C r . f' C f) (Cauchy-Schwarz in the energy product). m and h are computed from both differences
    between the finest three levels, extrapolated with the theoretical order; the larger is used,
    times `CAUTIOUS`. One entry may agree by chance; the spread vanishes only if five independent
    differences do."""
    curves = [grid_convergence(resolutions, values) for values in np.transpose(percents)]
    C = np.asarray(compliances)
    steps = np.asarray(resolutions, dtype=float) ** ORDER
    loads = np.eye(len(force), 3) if readings is None else readings
    error = _relative_error(steps, C, np.column_stack([loads, force]))
    bands = CAUTIOUS * percentages(
        error.of_readings(C[-1], force, loads), 1.0, DIRECTIONS[axis], lever
    )
    for k, curve in enumerate(curves):
        if curve.verdict != "round-off" and (
            k != axis or readings is not None
        ):  # the observed order is unreliable
            extrapolated = curve.values[-1] + _to_finest(steps, curve.values)[0]
            curves[k] = curve._replace(
                order=ORDER, extrapolated=float(extrapolated), band=float(bands[k])
            )
    return tuple(curves)


def command_errors(
    resolutions: Array, compliances: Array, stiffness: Array, direction: Direction, lever: float
) -> tuple[Convergence, ...]:
    """As `command_convergence`, for compliances (levels, 3, 3) and the stiffness (3, 3) of the
    analytic model.
    """
    C = np.asarray(compliances)
    axis = DIRECTIONS.index(direction)
    percents = error_matrix(stiffness, C, lever)[..., axis]
    return command_convergence(resolutions, percents, axis, C, stiffness[:, axis], lever)


def error_bands(
    stiffness: Array, compliances: Array, resolutions: Sequence[int], lever: float
) -> tuple[Array, Array]:
    """Return the error percentages (3, 3) on the finest mesh and their bands, column j for command
    j.
    """
    errors = [
        command_errors(np.array(resolutions), compliances, stiffness, axis, lever)
        for axis in DIRECTIONS
    ]
    values, bands = np.transpose(
        [[(curve.values[-1], curve.band) for curve in curves] for curves in errors]
    )
    return values, bands


def compliance_bands(resolutions: Array, compliances: Array) -> Array:
    """Return the half-widths (3, 3) of the mesh uncertainty of compliances (levels, 3, 3), entry by
    entry.

    The diagonal has the band of `grid_convergence`, other entries the bound of
    `command_convergence` with unit forces. If an entry is round-off on every mesh (zero by
    symmetry), its largest value is its band."""
    C = np.asarray(compliances)
    n = np.asarray(resolutions, dtype=float)
    size = np.sqrt(np.outer(np.diag(C[-1]), np.diag(C[-1])))
    largest = np.max(np.abs(C), axis=0)
    error = _relative_error(n**ORDER, C, np.eye(len(size)))
    bound = CAUTIOUS * (error.common * np.abs(C[-1]) + error.spread * size)
    bands = np.where(
        largest <= ROUND_OFF * size, np.maximum(largest, np.finfo(float).eps * size), bound
    )
    np.fill_diagonal(
        bands, [grid_convergence(n, C[:, k, k], round_off=0.0).band for k in range(len(size))]
    )
    return np.asarray(bands)


def corner_bands(
    resolutions: Array,
    values: Array,
    order: float = CORNER_ORDER,
) -> Array:
    """Return half-widths (...) of values (3 levels, ...) governed by corners of clamped edges:
    drift, drive ranges.

    Both differences between the meshes are extrapolated with the order of the corners; the larger
    is used, with a safety factor. The bands contained all 68 true values of eight random driven
    stages, where `mesh_band` missed 23 (`benchmarks/corner_bands.py`)."""
    return np.asarray(CAUTIOUS * np.max(np.abs(_to_finest(resolutions**order, values)), axis=0))


def stress_bands(resolutions: Array, values: Array) -> Array:
    """As `corner_bands` with order 3, for highest neck stresses, whose place may change, and for
    dependent values.

    The bands contained the 72 true highest stresses of 24 stages; the grid convergence index missed
    3, one of them by nine times its band (`benchmarks/corner_bands.py`)."""
    return corner_bands(resolutions, values, STRESS_ORDER)


def highest_band(
    resolutions: Array, values: Array, bands: Callable[[Array, Array], Array] = stress_bands
) -> Array:
    """Return the bands (...) of values (3 levels, ...) on the finest mesh: nan except for the
    highest value.
    """
    highest = np.max(values.reshape(3, -1), axis=1)
    return np.where(is_largest(values[-1]), bands(resolutions, highest), np.nan)


def pose_bands(
    resolutions: Array, poses: Array, scale: Array, ends: Sequence[Array] | Array = ()
) -> Array:
    """Return the half-widths (3, cases) of the uncertainty of poses (levels, 3, cases) on three
    meshes.

    The largest of `corner_bands` bounds every component; `scale` (3,), 1 or mm, makes rotations
    comparable lengths.
    ends : variants (3, cases) of the poses by the thickness, such as those with few layers, then
    these poses with many.
        The largest change among the components of a case, times `SAFETY`, is added to the bands of
        all of them, for every variant.
    """
    scaled = poses * scale[:, None]
    bands = _with_zeros(
        np.max(np.abs(scaled), axis=0), np.max(corner_bands(resolutions, scaled), axis=0)
    )
    if len(ends):
        *variants, best = (pose * scale[:, None] for pose in ends)
        for variant in variants:
            largest = np.maximum(np.abs(variant), np.abs(best))
            bands += _with_zeros(largest, SAFETY * np.max(np.abs(best - variant), axis=0))
    return np.asarray(bands / scale[:, None])


def _with_zeros(largest: Array, bands: Array) -> Array:
    """Return bands (3, cases): bands (cases,), but the largest value of a component that is zero up
    to round-off.
    """
    return np.where(largest <= ROUND_OFF * np.max(largest, axis=0), largest, bands)


# three dimensions: the bands of the in-plane mesh and of the layers


class SolidLevels(NamedTuple):
    """Compliances on three meshes with one layer, coarse to fine, and with few and many layers on
    the coarsest.
    """

    planes: Array
    few: Array
    many: Array

    @property
    def of_layers(self) -> RelativeError:
        """Change from `few` to `many` layers, times `SAFETY`."""
        lowest, *_, highest = SAFETY * eigh(self.many - self.few, self.many, eigvals_only=True)
        return RelativeError(abs(lowest + highest) / 2, (highest - lowest) / 2)


def coarser(
    solve: Callable[[int, int], Solution],
    resolution: int,
    layers: int,
    progress: Progress | None = None,
) -> tuple[list[Solution], tuple[Solution, Solution]]:
    """Solve with one layer on three meshes, coarse to fine, and with two numbers of layers on the
    coarsest mesh.
    """
    planes = levels(resolution)
    _, few, many = levels(layers)
    steps = [(level, 1) for level in planes] + [(planes[0], few), (planes[0], many)]
    *solutions, less, more = on_meshes(steps, lambda step: solve(*step), progress)
    return solutions, (less, more)


def solid_bands(solutions: SolidLevels, resolution: int) -> tuple[Array, Array]:
    """Return the bands (3, 3) of a compliance due to the in-plane mesh of a resolution and due to
    the layers.

    They are to be added, because their errors are not known to cancel. So few layers have no
    reliable order; their band is the last change of all entries together, by Cauchy-Schwarz, times
    `SAFETY`."""
    planes, few, many = solutions
    change = solutions.of_layers
    steps = np.array(levels(resolution))
    size = np.sqrt(np.outer(np.diag(many), np.diag(many)))
    zero = np.maximum(np.abs(few), np.abs(many)) <= ROUND_OFF * size  # by symmetry
    thickness = np.where(zero, np.finfo(float).eps, change.common + change.spread) * size
    plane = compliance_bands(steps, planes)
    np.fill_diagonal(plane, [mesh_band(steps, planes[:, k, k], 0.0) for k in range(3)])
    return plane, thickness
