"""What large displacements do to a stage over its workspace, and what the second-order terms of (16) are worth.

Four ways to the load that holds the platform at a pose: linear, by (18) with the stiffness at rest; the stiffness (16)
of the displaced stage without its second-order terms, summed along the way; (16) as it stands, likewise; and exact
equilibrium of the pseudo-rigid stage. Beside them nonlinear finite elements. Each of them is compared with its own
linear answer: what the hinge formulas err by is there with and without displacement, and drops out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from flexfem.analytic.large import Missed, along, at_pose, missed, summed_loads, tangents
from flexfem.analytic.model import DEFAULT_FORMULA, analyse, assemble
from flexfem.analytic.paper import PaperModel, stiffness
from flexfem.arrays import Array, Index
from flexfem.fem.nonlinear import equilibrium, imposed
from flexfem.fem.structure import plate_of
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import percentages
from flexfem.units import DIRECTIONS, Direction
from flexfem.verify.protocol import Solve, Solved, command_warnings, solve_stage
from flexfem.verify.reach import Reach
from flexfem.verify.result import Matrix, OfStage, Record, about


class Elements(Record):
    """Nonlinear finite elements with the hub held at commands (k,); percentages as in `Travel`, of their own linear
    answer.

    load : (k, 3), N, N, N mm.   strain : (k,), the largest component.
    loaded : (4, 3), mm and rad, poses under the exact load of the pseudo-rigid stage at the `points`.
    loaded_position : (4, 3), linear minus nonlinear position there, in per cent of the latter.
    """

    commanded: list[float]
    load: Matrix
    stiffness: list[float]
    position: Matrix
    strain: list[float]
    loaded: Matrix
    loaded_position: Matrix


class Point(Record):
    """Per cent at one command, mm or rad, by name.

    The names are `without`, `tangent`, `exact`, `elements`, and of positions `loaded`: finite elements under the load
    of `exact`.

    stiffness : change along the command.   position : linear minus exact position along it.   across : of the other two
    directions the larger in size.
    """

    commanded: float
    stiffness: dict[str, float]
    position: dict[str, float]
    across: dict[str, float]


class Travel(Record):
    """The way along one direction, the others held at zero; by name `without`, `tangent` and `exact`.

    commanded : (n,), mm or rad.   load : (n, 3), N, N, N mm, exact.
    stiffness : (n,), change of the tangent stiffness along the command from that at rest, per cent; of `exact` the
        central difference of the load.
    position : (n, 3), linear position under the load of each model minus the command, normalised as error percentages;
        along the command this is what the load deviates from (18) by.
    """

    commanded: list[float]
    load: Matrix
    stiffness: dict[str, list[float]]
    position: dict[str, Matrix]
    elements: Elements
    points: list[Point]


class Box(Record):
    """Largest at corners, edges and faces of the box of all three amplitudes, per cent; see `second_order.Missed`."""

    position: float
    terms: float


class Workspace(OfStage):
    """Travel of a stage's own analytic model and of its finite elements in the three directions.

    plane : the stage's own choice of plane problem.   amplitude : mm, mm, rad.   resolution, unknowns : of the finite
    elements.   small, box : a tenth of the amplitudes, and all of them.   reach : the poses that the drive reaches,
    None where `no_reach` says why not.
    """

    stage: str
    plane: str
    mobility: int
    formula: str
    amplitude: dict[Direction, float]
    resolution: int
    unknowns: int
    travel: dict[Direction, Travel]
    small: Box
    box: Box
    reach: Reach | None = None
    no_reach: str = ""


AMPLITUDE = 0.5  # mm: ten times the assumed workspace of examples/claims.py
TURN = 0.02  # rad of rotation that go with a mm of translation: 10 mrad with 500 um
RESOLUTION = 4  # with 8, compliances move by up to 0.09 % and the percentages here by 2.2e-4 points
STEPS = 20  # commands on either side of rest
SOLVED = np.array([-20, -14, -8, -2, 0, 2, 8, 14, 20])  # of STEPS, where finite elements are solved
STATED = np.array([-20, -2, 2, 20])  # of STEPS, where numbers are stated: a tenth of the amplitude and all of it
SLOPE_STEP = 1e-3  # of the amplitude, for central differences of the exact load


def _box(found: Missed) -> Box:
    return Box(position=100 * float(found.position), terms=100 * float(found.terms))


def workspace(
    stage: Stage,
    amplitude: float = AMPLITUDE,
    resolution: int = RESOLUTION,
    solve: Solve = solve_stage,
    done: Callable[[Direction], object] = lambda axis: None,
) -> Workspace:
    """Travel of a feasible stage up to `amplitude`, mm, in X and Y, and `TURN` times that in theta, on both sides.

    `done` is called with every direction once it is travelled.

    Raises BadInput for a stage whose model is not plane, ComputationFailed when a pose is out of reach.
    """
    model, of, lever = analyse(stage), assemble(stage), stage.chain.link_lengths[2]
    largest = amplitude * np.array([1.0, 1.0, TURN])
    solved = solve(stage, resolution)
    small, box = (missed(of, part * largest, lever) for part in (STATED[2] / STEPS, 1.0))
    travel = dict[Direction, Travel]()
    for axis, far in zip(DIRECTIONS, largest, strict=True):
        travel[axis] = _travel(stage, of, solved, axis, far)
        done(axis)
    forces = np.asarray(np.linalg.solve(solved.response.compliance, np.diag(largest)).T, dtype=float)
    return Workspace(
        **about(stage),
        stage=stage.name,
        plane=stage.model,
        mobility=model.mobility,
        formula=DEFAULT_FORMULA,
        warnings=command_warnings(stage, model, solved, forces, "largest command"),
        amplitude=dict(zip(DIRECTIONS, largest.tolist(), strict=True)),
        resolution=resolution,
        unknowns=solved.response.unknowns,
        travel=travel,
        small=_box(small),
        box=_box(box),
    )


def _travel(stage: Stage, of: PaperModel, solved: Solved, direction: Direction, far: float) -> Travel:
    axis, rest, step = DIRECTIONS.index(direction), stiffness(of), SLOPE_STEP * far
    commanded = far * np.arange(-STEPS, STEPS + 1) / STEPS
    at = tangents(of, along(commanded, axis))
    ahead, behind = (at_pose(of, along(commanded + side, axis)).load for side in (step, -step))
    slopes = {
        "without": at.without[..., axis],
        "tangent": at.tangent[..., axis],
        "exact": (ahead - behind) / (2 * step),
    }
    changes = {name: 100 * (slope[:, axis] / rest.K_uu[axis, axis] - 1) for name, slope in slopes.items()}
    loads = summed_loads(of, commanded, axis) | {"exact": at.load}
    missing = {
        name: _percent(stage, direction, load @ rest.C_uu - along(commanded, axis), commanded)
        for name, load in loads.items()
    }
    elements = _elements(stage, solved, direction, commanded[STEPS + SOLVED], at.load[STEPS + STATED])
    return Travel(
        commanded=commanded.tolist(),
        load=at.load.tolist(),
        stiffness={name: values.tolist() for name, values in changes.items()},
        position={name: values.tolist() for name, values in missing.items()},
        elements=elements,
        points=[_point(row, axis, commanded, changes, missing, elements) for row in range(len(STATED))],
    )


def _elements(stage: Stage, solved: Solved, direction: Direction, commanded: Array, loads: Array) -> Elements:
    """Held at `commanded` (k,), and under the loads (4, 3), both reached outwards from rest."""
    axis, plate, C = DIRECTIONS.index(direction), plate_of(stage), solved.response.compliance
    held, strain = np.zeros((len(commanded), 3)), np.zeros(len(commanded))
    tangent, loaded = np.tile(C, (len(commanded), 1, 1)), np.zeros((len(loads), 3))
    for side in _outwards(commanded):
        found = imposed(solved.mesh, plate, along(commanded[side], axis))
        held[side], strain[side], tangent[side] = found.load, found.strain, found.compliance
    for side in _outwards(STATED):
        loaded[side] = equilibrium(solved.mesh, plate, loads[side]).pose
    slope = np.linalg.inv(tangent)[:, axis, axis] / np.linalg.inv(C)[axis, axis]
    return Elements(
        commanded=commanded.tolist(),
        load=held.tolist(),
        stiffness=(100 * (slope - 1)).tolist(),
        position=_percent(stage, direction, held @ C - along(commanded, axis), commanded).tolist(),
        strain=strain.tolist(),
        loaded=loaded.tolist(),
        loaded_position=_percent(stage, direction, loads @ C - loaded, loaded[:, axis]).tolist(),
    )


def _outwards(commanded: Array | Index) -> Iterator[Index]:
    """Where the commands are on either side of rest, from rest outwards; they ascend."""
    yield np.flatnonzero(commanded > 0)
    yield np.flatnonzero(commanded < 0)[::-1]


def _percent(stage: Stage, direction: Direction, missing: Array, moved: Array) -> Array:
    """Errors (n, 3) in per cent of the displacements (n,); at rest, where they vanish with its square, zero."""
    lever = stage.chain.link_lengths[2]
    rows = zip(missing, moved.tolist(), strict=True)
    return np.array([percentages(row, at, direction, lever) if at else np.zeros(3) for row, at in rows])


def _point(
    row: int, axis: int, commanded: Array, changes: dict[str, Array], missing: dict[str, Array], elements: Elements
) -> Point:
    """The numbers of `STATED[row]`."""
    fine, coarse = STEPS + STATED[row], int(np.flatnonzero(STATED[row] == SOLVED)[0])
    places = {name: values[fine] for name, values in missing.items()}
    places |= {"elements": np.array(elements.position[coarse]), "loaded": np.array(elements.loaded_position[row])}
    across = {name: np.delete(value, axis) for name, value in places.items()}
    return Point(
        commanded=float(commanded[fine]),
        stiffness={name: float(values[fine]) for name, values in changes.items()}
        | {"elements": elements.stiffness[coarse]},
        position={name: float(value[axis]) for name, value in places.items()},
        across={name: float(value[np.argmax(np.abs(value))]) for name, value in across.items()},
    )
