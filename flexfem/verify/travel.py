"""How far a stage travels and what large displacements do on the way, as it is stored. N, mm, rad; per cent."""

from __future__ import annotations

from flexfem.verify.case import Direction
from flexfem.verify.result import Matrix, OfStage, Record


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
    elements.   small, box : a tenth of the amplitudes, and all of them.
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
