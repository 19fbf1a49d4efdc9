"""How far every number may move from its accepted value, and its unit: by where it is in what a command prints.

A baseline stores values only; what they may move by is said here alone. Numbers that no other rule names may not move
but by `EXACT`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from flexfem import units
from flexfem.commands.baseline.moves import Dimension, Gate, Rule, Size, at, matches
from flexfem.files.refusals import KeyPath

# What was observed: gmsh 4.13 to 4.15 mesh the reference stages alike. Sizes that grow by 1.402 instead of 1.4 from a
# neck, another mesh as good, move compliances by 1.4e-6 at resolution 8, by 4.4e-5 at resolution 4, stresses by 5e-4.
EXACT = Gate(1e-12, 1e-12)  # closed forms and 6 x 6 algebra
SOLVED = Gate(1e-9, 1e-9, 1e-9)  # iterated to a tolerance, or differences of such
COMMITTED = Gate(1e-8, 1e-8)  # finite elements on a committed mesh, solved by another library
FRESH = Gate(1.5e-5, 1.5e-5)  # finite elements on a mesh made now, at resolution 8
COARSER = Gate(3e-4, 3e-4)  # the same on coarser meshes, and what is extrapolated from them
CHANGE = Gate(1e-3, 3e-6)  # what large displacements change on one mesh
PEAK = Gate(5e-3)  # stress, by such a mesh
BENT = Gate(3e-4, 1e-6)  # loads and poses at large displacement, at resolution 4; those across are small
STRAIN = Gate(3e-2)  # strain, at resolution 4
MESH_SIZE = Gate(0.05)  # triangles and unknowns
BAND = Gate(1e-3)  # bands and orders: other meshes move them by 0.16 and 0.09, and are to be accepted again
UNLIKE = Gate(1.5e-5, 1e-8, 5e-9)  # meshes bad by intent, and elements solved without iterative refinement


def _own(record: Any, path: KeyPath) -> float:
    return abs(float(at(record, path)))


def _largest(record: Any, path: KeyPath) -> float:
    return max(abs(float(value)) for value in at(record, path[:-1]) if value is not None)


def _matrix(record: Any, path: KeyPath) -> float:
    matrix = at(record, path[:-2])
    return float(np.sqrt(abs(matrix[path[-2]][path[-2]] * matrix[path[-1]][path[-1]])))


def lever_of(record: Any, path: KeyPath) -> float:
    """l3, mm, of the stage that a path of a record belongs to."""
    if path[0] in ("result", "committed") and "result" in record:
        at_curve = path[2] if path[0] == "result" else path[1]
        return float(record["result"]["models"][at_curve]["lever"])
    return float(record["check"]["dimensions"]["chain"]["link_lengths"][2])


def _vector(power: int) -> Size:
    """Largest of a vector (3,) in the unit of its component: moments are forces times the lever, to a power."""

    def size(record: Any, path: KeyPath) -> float:
        weights = np.array([1.0, 1.0, lever_of(record, path) ** power])
        return float(np.max(np.abs(at(record, path[:-1])) / weights) * weights[path[-1]])

    return size


def _command(record: Any, path: KeyPath) -> float:
    """The command at which a point of a curve is, in the unit of the curve."""
    result, lever = record["result"], lever_of(record, path)
    own = lever if path[-2] == "theta" else 1.0
    commanded = lever if result["direction"] == "theta" else 1.0
    return float(abs(result["commanded"][path[-1]]) * commanded / own)


def _coupled(record: Any, path: KeyPath) -> float:
    """For the columns `kxy_...` of a study: the root of the product of the two directions' own stiffnesses."""
    table, name = at(record, path[:-2]), str(path[-2])
    own = [next(column for key, column in table.items() if key.startswith(f"k{axis}{axis}_")) for axis in name[1:3]]
    return float(np.sqrt(abs(own[0][path[-1]] * own[1][path[-1]])))


NUMBER = Dimension("", _own)
LENGTH = Dimension(units.LENGTH.name, _largest)
STIFFNESS = Dimension([[unit.name for unit in row] for row in units.STIFFNESS], _matrix)
COMPLIANCE = Dimension([[unit.name for unit in row] for row in units.COMPLIANCE], _matrix)
WRENCH = Dimension([unit.name for unit in units.FORCES], _vector(1))
POSE = Dimension([unit.name for unit in units.POSES], _vector(-1))
CURVE = Dimension("mm or rad", _command)
PERCENT = Dimension("%", lambda record, path: 100.0)
POINTS = Dimension("percentage points", lambda record, path: 100.0)
ENERGY = Dimension(units.FORCES[2].name, _own)
MPA = Dimension(units.STRESS.name, _own)
LIST = Dimension("", _largest)
RATIO = Dimension("", lambda record, path: 1.0)
COUPLED = Dimension(f"{units.STIFFNESS[0][1]} or {units.STIFFNESS[0][2]}", _coupled)


def _rules(*lines: tuple[str, Gate, Dimension]) -> tuple[Rule, ...]:
    return tuple(Rule(tuple(pattern.split()), gate, kind) for pattern, gate, kind in lines)


def _uncertainty(start: str, dimension: Dimension) -> tuple[tuple[str, Gate, Dimension], ...]:
    return (
        (f"{start} values #", COARSER, dimension),
        (f"{start} extrapolated", COARSER, dimension),
        (f"{start} band", BAND, Dimension(dimension.units, _own)),
        (f"{start} observed", BAND, NUMBER),
        (f"{start} order", BAND, NUMBER),
    )


def _solution(start: str, gate: Gate, stress: Gate, mesh: Gate) -> tuple[tuple[str, Gate, Dimension], ...]:
    return (
        (f"{start} stiffness # #", gate, STIFFNESS),
        (f"{start} compliance # #", gate, COMPLIANCE),
        (f"{start} force #", EXACT, WRENCH),
        (f"{start} displacement #", gate, POSE),
        (f"{start} reaction #", gate, WRENCH),
        (f"{start} energy", gate, ENERGY),
        (f"{start} neck_stress # #", stress, MPA),
        (f"{start} triangles", mesh, NUMBER),
        (f"{start} unknowns", mesh, NUMBER),
    )


RULES = _rules(
    # a case: what `verify` stores, and the same on the committed mesh
    ("result commanded #", EXACT, LIST),
    ("result curves * * #", FRESH, CURVE),
    ("result error_percent * *", FRESH, PERCENT),
    *_uncertainty("result uncertainty * *", POINTS),
    ("result models * stiffness # #", EXACT, STIFFNESS),
    ("result models * force # #", EXACT, WRENCH),
    ("result models * imposed # #", SOLVED, LIST),
    ("result models * hinges # centre #", EXACT, LENGTH),
    *_solution("result models *", FRESH, PEAK, MESH_SIZE),
    ("result models * element_peak stress", PEAK, NUMBER),
    ("result models * peak_band", BAND, NUMBER),
    ("committed * model stiffness # #", EXACT, STIFFNESS),
    ("committed * model force # #", EXACT, WRENCH),
    ("committed * model given # #", SOLVED, LIST),
    ("committed * percent #", COMMITTED, PERCENT),
    *_solution("committed *", COMMITTED, COMMITTED, EXACT),
    # a stage: `check`, `stiffness`, `solve`, `budget`, `workspace`, `converge`
    ("check hinges # centre_mm #", EXACT, LENGTH),
    ("stiffness * stiffness # #", EXACT, STIFFNESS),
    ("stiffness * compliance # #", EXACT, COMPLIANCE),
    *_solution("mesh", COMMITTED, COMMITTED, EXACT),
    *_solution("solve", FRESH, PEAK, MESH_SIZE),
    ("budget split * shares 0 points *", SOLVED, POINTS),
    ("budget split * shares 1 points *", SOLVED, POINTS),
    ("budget split * shares 2 points *", SOLVED, POINTS),
    ("budget split * shares 3 points *", FRESH, POINTS),
    ("budget split * shares 4 points *", CHANGE, POINTS),
    ("budget split * total *", FRESH, POINTS),
    ("budget split * band", BAND, POINTS),
    ("budget split * out_of_plane *", SOLVED, POINTS),
    ("workspace unknowns", MESH_SIZE, NUMBER),
    ("workspace travel * commanded #", EXACT, LIST),
    ("workspace travel * load # #", SOLVED, WRENCH),
    ("workspace travel * stiffness * #", SOLVED, PERCENT),
    ("workspace travel * position * # #", SOLVED, PERCENT),
    ("workspace travel * elements commanded #", EXACT, LIST),
    ("workspace travel * elements load # #", BENT, WRENCH),
    ("workspace travel * elements stiffness #", CHANGE, PERCENT),
    ("workspace travel * elements position # #", CHANGE, PERCENT),
    ("workspace travel * elements strain #", STRAIN, LIST),
    ("workspace travel * elements loaded # #", BENT, POSE),
    ("workspace travel * elements loaded_position # #", CHANGE, PERCENT),
    ("workspace travel * points # * elements", CHANGE, PERCENT),
    ("workspace travel * points # * loaded", CHANGE, PERCENT),
    ("workspace travel * points # * *", SOLVED, PERCENT),
    ("workspace small *", SOLVED, PERCENT),
    ("workspace box *", SOLVED, PERCENT),
    ("converge triangles #", MESH_SIZE, NUMBER),
    ("converge unknowns #", MESH_SIZE, NUMBER),
    ("converge compliance # # #", COARSER, COMPLIANCE),
    *_uncertainty("converge uncertainty *", NUMBER),
    # studies: the collected table and what the figures show
    *((f"analytic table k{axes}_* #", EXACT, COUPLED) for axes in ("xy", "xt", "yt")),
    *((f"* table k{axes}_* #", COARSER, COUPLED) for axes in ("xy", "xt", "yt")),
    ("analytic table coupling_* #", EXACT, RATIO),
    ("* table coupling_* #", COARSER, RATIO),
    ("analytic table * #", EXACT, LIST),
    ("analytic findings **", SOLVED, RATIO),
    ("fe table stress_* #", STRAIN, LIST),
    ("fe table range_* #", STRAIN, LIST),
    ("fe table * #", COARSER, LIST),
    ("fe findings **", STRAIN, NUMBER),
    ("verify table band_* #", BAND, POINTS),
    ("verify table error_* #", COARSER, PERCENT),
    ("verify table cross_* #", COARSER, PERCENT),
    ("verify table * #", COARSER, LIST),
    ("verify findings **", COARSER, PERCENT),
    ("**", EXACT, NUMBER),
)


@cache
def rule_of(path: KeyPath) -> Rule:
    """The first rule whose pattern a path has; the last has any."""
    likely = (rule for rule in RULES if rule.pattern[0] in ("*", "**", path[0]))
    return next(rule for rule in likely if matches(rule.pattern, path))
