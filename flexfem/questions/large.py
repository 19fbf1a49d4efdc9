"""What large displacements do to a stage, and what the second-order terms of (16) are worth.

The load that holds the platform at a pose by the stiffness (16) of the displaced stage without its second-order terms,
summed along the way; by (16) as it stands; by exact equilibrium of the pseudo-rigid stage; and by nonlinear finite
elements. Each is compared with its own linear answer, in which the error of the hinge formulas drops out.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from flexfem import arguments
from flexfem.analytic.large import along, at_pose, missed, outwards, summed_loads
from flexfem.analytic.model import DEFAULT_FORMULA, analyse, assemble
from flexfem.analytic.paper import PaperModel, stiffness
from flexfem.arrays import Array
from flexfem.fem.fields import neck_stresses
from flexfem.fem.nonlinear import equilibrium, imposed
from flexfem.fem.response import Response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import percentages
from flexfem.questions.setup import about, mesh_of, meshed, question, solved
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS, PLANES, Direction

AMPLITUDE = 0.5  # mm: ten times the assumed workspace of examples/claims.py
TURN = 0.02  # rad of rotation that go with a mm of translation: 10 mrad with 500 um
RESOLUTION = 4  # with 8, compliances move by up to 0.09 % and the percentages here by 2.2e-4 points
STEPS = 20  # commands on either side of rest
SOLVED = np.array([-20, -14, -8, -2, 0, 2, 8, 14, 20])  # of STEPS, where finite elements are solved
STATED = np.array([-20, -2, 2, 20])  # of STEPS, where numbers are stated: a tenth of the amplitude and all of it
SLOPE_STEP = 1e-3  # of the amplitude, for central differences of the exact load
AMPLITUDES = (1e-9, 1e3)  # mm: below there is round-off alone; whether the stage bears the largest is found out
WITHOUT, TANGENT, EXACT, HELD, LOADED = range(5)  # places on the axis "theory"
THEORIES = ("(16) less its terms", "(16)", "exact", "finite elements", "finite elements, same load")
PERCENT = Gate(1e-9, absolute=2e-3)  # percentage points, by which finite elements move with their mesh


class Large(Result):
    """What large displacements do: change of the tangent stiffness, and errors of the linear position, in per cent."""

    title = "large displacements"
    labels: ClassVar = {
        "theory": THEORIES,
        "at": tuple(f"{5 * k:+d} %" for k in STATED),
        "share": tuple(f"{5 * k:+d} %" for k in range(-STEPS, STEPS + 1)),
        "within": ("a tenth of the amplitudes", "the amplitudes"),
    }
    columns = ("theory",)
    figure = "drive.large_figure"
    reading = (
        "each theory against its own linear answer, at per cent of the amplitude; position errors: the linear position "
        "under the load that holds the stage at the command, less the command, in per cent of it; across: the larger "
        "of both, rotations by the lever",
    )
    amplitude = Quantity("amplitude", ("mm", "mm", "rad"), ("direction",), prefixed=True)
    stiffness = Quantity("change of the tangent stiffness (%)", "", ("direction", "at", "theory"), PERCENT)
    error = Quantity("linear position error along (%)", "", ("direction", "at", "theory"), PERCENT)
    aside = Quantity("linear position error across (%)", "", ("direction", "at", "theory"), PERCENT, "all")
    position = Quantity("largest linear position error anywhere", "percent", ("within",), PERCENT)
    terms = Quantity("change of the tangent compliance by second-order terms", "percent", ("within",), PERCENT)
    tangent = Quantity(
        "change of the tangent stiffness", "percent", ("direction", "share", "theory"), PERCENT, shown=False
    )
    errors = Quantity(
        "linear position error", "percent", ("direction", "share", "theory", "component"), PERCENT, shown=False
    )
    load = Quantity(
        "load that holds the platform", ("n", "n", "n_mm"), ("direction", "share", "theory", "component"), Gate(1.5e-5),
        "wrench", shown=False,
    )  # fmt: skip
    strain = Quantity("largest strain of finite elements", "", ("direction", "share"), Gate(5e-3), "all", shown=False)


@question
def large(
    stage: Stage,
    *,
    amplitude: float = AMPLITUDE,
    models: Literal["both", "analytic"] = "both",
    resolution: int | None = None,
    progress: Progress | None = None,
) -> Large:
    """What large displacements change: tangent stiffness, and by how much the linear position errs.

    Parameters
    ----------
    amplitude : float
        Largest displacement in X and Y, mm; in theta 0.02 rad for every mm.
    models : {"both", "analytic"}
        Whether there are nonlinear finite elements beside the pseudo-rigid stage.
    resolution : int, optional
        Triangles across every neck.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.large(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("error", direction="x", at="+100 %", theory="exact")), 3)  # per cent
    0.36
    """
    check_feasible(stage)
    mesh = mesh_of(models, resolution, None, 2, usual=RESOLUTION)
    far = arguments.between("amplitude", amplitude, *AMPLITUDES) * np.array([1.0, 1.0, TURN])
    model, of, lever = analyse(stage), assemble(stage), stage.chain.link_lengths[2]
    elements = None if mesh is None else solved(stage, mesh.resolution)
    warnings = warning.of_result(stage, model)
    if elements is not None:
        for direction, force in zip(DIRECTIONS, np.linalg.solve(elements.compliance, np.diag(far)).T, strict=True):
            highest = float(np.max(neck_stresses(stage, elements, force[None]).highest))
            warnings += warning.of_yield(highest, stage.material.yield_strength, f"largest command in {direction}")
    boxes = [missed(of, part * far, lever) for part in (STATED[2] / STEPS, 1.0)]
    ways = []
    for axis, direction in enumerate(DIRECTIONS):
        ways.append(_way(stage, of, elements, direction, far[axis]))
        if progress is not None:
            progress(f"along {direction}")
    values: dict[str, Any] = {name: np.array([way[name] for way in ways]) for name in ways[0]}
    stated = values["errors"][:, STEPS + STATED]
    others = np.array([np.delete(each, axis, axis=-1) for axis, each in enumerate(stated)])
    widest = np.argmax(np.abs(np.nan_to_num(others)), axis=-1)[..., None]
    values |= {
        "amplitude": far,
        "stiffness": values["tangent"][:, STEPS + STATED],
        "error": np.array([each[..., axis] for axis, each in enumerate(stated)]),
        "aside": np.take_along_axis(others, widest, axis=-1)[..., 0],
        "position": [100 * float(each.position) for each in boxes],
        "terms": [100 * float(each.terms) for each in boxes],
    }
    settings = {"mobility": model.mobility, "formula": DEFAULT_FORMULA, "plane problem": PLANES[stage.model]}
    if elements is not None:
        settings |= meshed(mesh) | {"unknowns": elements.unknowns}
    return Large(about(stage), values, None, None, settings, list(dict.fromkeys(warnings)))


def _way(stage: Stage, of: PaperModel, elements: Response | None, direction: Direction, far: float) -> dict[str, Array]:
    """The way along one direction, the others held at zero: `tangent`, `errors`, `load` and `strain` of `Large`."""
    axis, lever = DIRECTIONS.index(direction), stage.chain.link_lengths[2]
    rest, step = stiffness(of), SLOPE_STEP * far
    commanded = far * np.arange(-STEPS, STEPS + 1) / STEPS
    tangent = np.full((len(commanded), len(THEORIES)), np.nan)
    errors, loads = np.full((*tangent.shape, 3), np.nan), np.full((*tangent.shape, 3), np.nan)
    found = {"tangent": tangent, "errors": errors, "load": loads, "strain": np.full(len(commanded), np.nan)}

    def missing(pose: Array, moved: Array) -> Array:
        """Errors (n, 3) in per cent of the displacements (n,); at rest, where they vanish with its square, zero."""
        moving, percent = moved != 0, np.zeros_like(pose)
        percent[moving] = percentages(pose[moving], moved[moving], direction, lever)
        return percent

    at = at_pose(of, along(commanded, axis))
    ahead, behind = (at_pose(of, along(commanded + side, axis)).load for side in (step, -step))
    slopes = [each.stiffness()[..., axis] for each in (at.without_terms, at)] + [(ahead - behind) / (2 * step)]
    summed = summed_loads(of, commanded, axis)
    for theory, load in enumerate((summed["without"], summed["tangent"], at.load)):
        tangent[:, theory] = 100 * (slopes[theory][:, axis] / rest.K_uu[axis, axis] - 1)
        errors[:, theory] = missing(load @ rest.C_uu - along(commanded, axis), commanded)
    loads[:, EXACT] = at.load
    if elements is None:
        return found
    plate, C, places = plate_of(stage), elements.compliance, STEPS + SOLVED
    held, compliance, strain = np.zeros((len(SOLVED), 3)), np.tile(C, (len(SOLVED), 1, 1)), np.zeros(len(SOLVED))
    for side in outwards(SOLVED):
        held_at = imposed(elements.mesh, plate, along(commanded[places[side]], axis))
        held[side], compliance[side], strain[side] = held_at.load, held_at.compliance, held_at.strain
    exact, pose = at.load[STEPS + STATED], np.zeros((len(STATED), 3))
    for side in outwards(STATED):
        pose[side] = equilibrium(elements.mesh, plate, exact[side]).pose
    slope = np.linalg.inv(compliance)[:, axis, axis] / np.linalg.inv(C)[axis, axis]
    tangent[places, HELD], loads[places, HELD], found["strain"][places] = 100 * (slope - 1), held, strain
    errors[places, HELD] = missing(held @ C - along(commanded[places], axis), commanded[places])
    errors[STEPS + STATED, LOADED] = missing(exact @ C - pose, pose[:, axis])
    return found
