"""Effect of large displacements on a stage, and of the second-order terms of (16).

The load that holds the platform at a pose is computed by integrating the stiffness (16) of the
displaced stage along the path, without and with its second-order terms, by exact equilibrium of the
pseudo-rigid stage, and by nonlinear finite elements. Each is compared with its own linear solution,
so that the error of the hinge formulas cancels."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.fem.nonlinear import equilibrium, imposed
from flexfem.fem.response import Response
from flexfem.paper import answers
from flexfem.paper import warnings as warning
from flexfem.paper.equations import PaperModel, stiffness
from flexfem.paper.equilibrium import at_pose, axis_poses, linear_errors, outwards, summed_loads
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import DEFAULT_FORMULA, AnalyticResult, analyse, assemble
from flexfem.paper.solutions import solved
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions.bands import percentages
from flexfem.questions.large import AMPLITUDE, RESOLUTION, length_of
from flexfem.questions.setup import Mesh, meshed
from flexfem.questions.warnings import of_yield
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import COMPUTED_IN, DIRECTIONS

ROTATION = 0.02  # rad of rotation per mm of translation: 10 mrad with 500 um
STEPS = 20  # commands on either side of rest
# steps at which finite elements are solved
ELEMENT_STEPS = np.array([-20, -14, -8, -2, 0, 2, 8, 14, 20])
# steps at which numbers are stated: a tenth of the amplitude and all of it
STATED = np.array([-20, -2, 2, 20])
SLOPE_STEP = 1e-3  # of the amplitude, for central differences of the exact load
# mm: below there is only round-off; warnings report a stage that does not bear the largest
AMPLITUDES = (1e-9, 1e3)
WITHOUT, TANGENT, EXACT, HELD, LOADED = range(5)  # positions on the axis "theory"
THEORIES = (
    "(16) without second-order terms",
    "(16)",
    "exact",
    "finite elements",
    "finite elements, same load",
)
# percentage points by which finite elements change with their mesh: with a resolution of 8 instead
# of 4 by 2.2e-4
PERCENT = Gate(1e-9, absolute=2e-3)


class StageLarge(Result):
    """Change of the tangent stiffness and errors of the linear position, in per cent."""

    kind_name = "large"
    title = "large displacements"
    main_result = ("position", {})
    labels: ClassVar = {
        "theory": THEORIES,
        "at": tuple(f"{5 * k:+d} %" for k in STATED),
        "share": tuple(f"{5 * k:+d} %" for k in range(-STEPS, STEPS + 1)),
        "within": ("a tenth of the amplitudes", "the amplitudes"),
    }
    columns = ("theory",)
    figure = "paper.figures.large.large_figure"
    footnotes = (
        "each theory is compared with its own linear solution; position error: linear position "
        "under the load that holds the stage at the command, minus the command, in % of the "
        "command; across: the larger error of the other two directions, rotations multiplied by "
        "the lever; at: command in % of the amplitude",
    )
    amplitude = Quantity("amplitude", ("mm", "mm", "rad"), ("direction",))
    stiffness = Quantity(
        "change of the tangent stiffness", "percent", ("direction", "at", "theory"), PERCENT
    )
    error = Quantity(
        "error of the linear position along", "percent", ("direction", "at", "theory"), PERCENT
    )
    aside = Quantity(
        "error of the linear position across",
        "percent",
        ("direction", "at", "theory"),
        PERCENT,
        "all",
    )
    position = Quantity(
        "largest error of the linear position, all poses", "percent", ("within",), PERCENT
    )
    terms = Quantity(
        "change of the tangent compliance by second-order terms", "percent", ("within",), PERCENT
    )
    tangent = Quantity(
        "change of the tangent stiffness",
        "percent",
        ("direction", "share", "theory"),
        PERCENT,
        shown=False,
    )
    errors = Quantity(
        "error of the linear position",
        "percent",
        ("direction", "share", "theory", "component"),
        PERCENT,
        shown=False,
    )
    load = Quantity(
        "load that holds the platform",
        ("n", "n", "n_mm"),
        ("direction", "share", "theory", "component"),
        Gate(1.5e-5),
        "wrench",
        shown=False,
    )
    strain = Quantity(
        "largest strain of finite elements",
        "",
        ("direction", "share"),
        Gate(5e-3),
        "all",
        shown=False,
    )


def large(
    stage: Stage,
    *,
    amplitude: float | str = AMPLITUDE,
    models: Literal["both", "analytic"] = "both",
    resolution: int | None = None,
    progress: Progress | None = None,
) -> StageLarge:
    """Return the effect of large displacements on a stage. Raises BadInput, ComputationFailed."""
    mesh = answers.mesh_of(stage, models, resolution, least=2, usual=RESOLUTION)
    if isinstance(amplitude, str):
        amplitude = length_of(amplitude)
    size = arguments.between("amplitude", amplitude, *AMPLITUDES)
    largest = size * np.array([1.0, 1.0, ROTATION])
    model = analyse(stage)
    elements = None if mesh is None else solved(stage, mesh.resolution)
    warnings = warning.of_result(stage, model)
    if elements is not None:
        warnings += _over_yield(stage, elements, largest)
    about = _Compared(stage, assemble(stage), elements)
    paths = list[_Path]()
    for axis, direction in enumerate(DIRECTIONS):
        paths.append(_path(about, axis, largest[axis]))
        if progress is not None:
            progress(f"along {direction}")
    values = _values(paths) | _of_boxes(about, largest)
    settings = _settings(stage, model, elements, mesh)
    warnings = list(dict.fromkeys(warnings))
    return StageLarge(answers.about(stage), values, None, None, settings, warnings)


def _over_yield(
    stage: Stage,
    elements: Response,
    largest: Array,
) -> list[str]:
    """Warn of commands (3,) at which linear finite elements are beyond the yield strength."""
    found = list[str]()
    loads = np.linalg.solve(elements.compliance, np.diag(largest)).T
    for direction, load in zip(DIRECTIONS, loads, strict=True):
        highest = float(np.max(neck_stresses(stage, elements, load[None]).highest))
        where = f"largest command in {direction}"
        found += of_yield(highest, stage.material.yield_strength, where)
    return found


def _settings(
    stage: Stage, model: AnalyticResult, elements: Response | None, mesh: Mesh | None
) -> dict[str, Any]:
    settings: dict[str, Any] = {
        "mobility": model.mobility,
        "formula": DEFAULT_FORMULA,
        "computed in": COMPUTED_IN[stage.model],
    }
    if elements is not None:
        settings |= meshed(mesh) | {"unknowns": elements.unknowns}
    return settings


class _Compared(NamedTuple):
    """A stage, its pseudo-rigid model, and its finite elements if they are asked for."""

    stage: Stage
    paper: PaperModel
    elements: Response | None


class _Path(NamedTuple):
    """`tangent`, `errors`, `load` and `strain` of `StageLarge` along one axis."""

    tangent: Array
    errors: Array
    load: Array
    strain: Array


def _values(paths: list[_Path]) -> dict[str, Any]:
    """Return the values along all axes, and those at the stated commands."""
    along = _Path(*(np.array(part) for part in zip(*paths, strict=True)))
    stated = along.errors[:, STEPS + STATED]
    across = np.array([np.delete(part, axis, axis=-1) for axis, part in enumerate(stated)])
    widest = np.argmax(np.abs(np.nan_to_num(across)), axis=-1)[..., None]
    return {
        **along._asdict(),
        "stiffness": along.tangent[:, STEPS + STATED],
        "error": np.array([part[..., axis] for axis, part in enumerate(stated)]),
        "aside": np.take_along_axis(across, widest, axis=-1)[..., 0],
    }


def _of_boxes(about: _Compared, largest: Array) -> dict[str, Any]:
    """Return the largest errors of linear theory at all poses within amplitudes (3,)."""
    shares = (STATED[2] / STEPS, 1.0)
    boxes = [linear_errors(about.paper, share * largest, about.stage.lever) for share in shares]
    return {
        "amplitude": largest,
        "position": [100 * float(box.position) for box in boxes],
        "terms": [100 * float(box.terms) for box in boxes],
    }


def _path(
    about: _Compared,
    axis: int,
    end: float,
) -> _Path:
    """Return the values along an axis up to an amplitude, other directions held at zero."""
    commanded = end * np.arange(-STEPS, STEPS + 1) / STEPS
    shape = (len(commanded), len(THEORIES))
    path = _Path(
        np.full(shape, np.nan),
        np.full((*shape, 3), np.nan),
        np.full((*shape, 3), np.nan),
        np.full(len(commanded), np.nan),
    )
    exact_load = _add_models(path, about, axis, commanded)
    if about.elements is not None:
        _add_held(path, about, axis, commanded)
        _add_loaded(path, about, axis, exact_load[STEPS + STATED])
    return path


def _relative_errors(
    pose: Array,
    displacements: Array,
    axis: int,
    lever: float,
) -> Array:
    """Return errors (n, 3) in per cent of displacements (n,) along an axis.

    They are zero at rest, since errors are of second order.
    """
    percent = np.zeros_like(pose)
    moved = displacements != 0
    percent[moved] = percentages(pose[moved], displacements[moved], DIRECTIONS[axis], lever)
    return percent


def _add_models(
    path: _Path,
    about: _Compared,
    axis: int,
    commanded: Array,
) -> Array:
    """Add the pseudo-rigid stage by three theories; return the exact load (n, 3)."""
    paper = about.paper
    rest = stiffness(paper)
    step = SLOPE_STEP * abs(commanded[-1])
    exact = at_pose(paper, axis_poses(commanded, axis))
    after = at_pose(paper, axis_poses(commanded + step, axis)).load
    before = at_pose(paper, axis_poses(commanded - step, axis)).load
    summed = summed_loads(paper, commanded, axis)
    slopes = {
        WITHOUT: exact.without_terms.stiffness()[..., axis],
        TANGENT: exact.stiffness()[..., axis],
        EXACT: (after - before) / (2 * step),
    }
    loads = {WITHOUT: summed["without"], TANGENT: summed["tangent"], EXACT: exact.load}
    for theory, load in loads.items():
        ratio = slopes[theory][:, axis] / rest.K_uu[axis, axis]
        path.tangent[:, theory] = 100 * (ratio - 1)
        error = load @ rest.C_uu - axis_poses(commanded, axis)
        path.errors[:, theory] = _relative_errors(error, commanded, axis, about.stage.lever)
    path.load[:, EXACT] = exact.load
    return exact.load


def _add_held(
    path: _Path,
    about: _Compared,
    axis: int,
    commanded: Array,
) -> None:
    """Add finite elements that are held at the commands."""
    elements = about.elements
    assert elements is not None
    plate = plate_of(about.stage)
    C = elements.compliance
    places = STEPS + ELEMENT_STEPS
    held_load = np.zeros((len(places), 3))
    compliance = np.tile(C, (len(places), 1, 1))
    for side in outwards(ELEMENT_STEPS):
        solution = imposed(elements.mesh, plate, axis_poses(commanded[places[side]], axis))
        held_load[side] = solution.load
        compliance[side] = solution.compliance
        path.strain[places[side]] = solution.strain
    path.strain[STEPS] = 0.0
    slope = np.linalg.inv(compliance)[:, axis, axis] / np.linalg.inv(C)[axis, axis]
    path.tangent[places, HELD] = 100 * (slope - 1)
    path.load[places, HELD] = held_load
    at = commanded[places]
    error = held_load @ C - axis_poses(at, axis)
    path.errors[places, HELD] = _relative_errors(error, at, axis, about.stage.lever)


def _add_loaded(
    path: _Path,
    about: _Compared,
    axis: int,
    exact_load: Array,
) -> None:
    """Add finite elements under the load of exact equilibrium (4, 3) at the stated commands."""
    elements = about.elements
    assert elements is not None
    plate = plate_of(about.stage)
    pose = np.zeros((len(STATED), 3))
    for side in outwards(STATED):
        pose[side] = equilibrium(elements.mesh, plate, exact_load[side]).pose
    error = exact_load @ elements.compliance - pose
    percent = _relative_errors(error, pose[:, axis], axis, about.stage.lever)
    path.errors[STEPS + STATED, LOADED] = percent
