"""Stiffness of a manufactured stage, from the measured thicknesses of its nine necks."""

from __future__ import annotations

from itertools import product
from pathlib import Path

from flexfem.arrays import Array, inverse
from flexfem.paper import answers
from flexfem.paper import warnings as warning
from flexfem.paper.designs import design_arrays
from flexfem.paper.links import body_compliance
from flexfem.paper.model import AnalyticResult, analyse, stiffness_with_necks
from flexfem.paper.solutions import solved_by
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import setup
from flexfem.questions.as_built import (
    MechanismAsBuilt,
    Redrawn,
    Stiffnesses,
    compared,
    mesh_in_depth,
)
from flexfem.questions.necks import HingePlace, read_necks
from flexfem.questions.setup import DEFAULT, Analytic, Mesh, ModelAnswer
from flexfem.results import SOLID, Progress, Quantity

BY_HINGE = (len(CHAINS), len(HINGE_NAMES))


class AsBuilt(MechanismAsBuilt):
    """Stiffness of a stage with its measured necks, and its scatter due to the measurement
    uncertainty.
    """

    title = "stage as built"
    necks = Quantity("neck", "um", ("chain", "hinge"), shown=False)
    sd = Quantity("standard deviation of the neck", "um", ("chain", "hinge"), shown=False)


def as_built(
    stage: Stage,
    necks: Path,
    *,
    analytic: Analytic = DEFAULT,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> AsBuilt:
    """Stiffness of a stage with its measured necks, and its scatter by their uncertainty."""
    mesh = mesh_in_depth(stage, solid, thickness_resolution)
    hinges = list(product(CHAINS, HINGE_NAMES))
    drawn: dict[HingePlace, float] = {hinge: stage.hinge(*hinge).neck for hinge in hinges}
    measured = read_necks(necks, drawn)
    warnings = list[str]()
    chosen = answers.chosen(stage, analytic, warnings)
    widths = measured.over(drawn)
    changes = {
        hinge: {"neck": neck} for hinge, neck in zip(hinges, widths.neck.tolist(), strict=True)
    }
    made = chosen.stage.replace(override=changes)
    as_drawn = analyse(*chosen)
    model = analyse(*chosen._replace(stage=made))
    warnings += warning.of_result(made, model)
    plane = Stiffnesses(as_drawn.stiffness, model.stiffness)
    in_depth = _in_depth(chosen.stage, made, mesh, progress)
    built = compared(widths, plane, in_depth, _redrawn(made, model))
    by_hinge = {"necks": widths.neck.reshape(BY_HINGE), "sd": widths.sd.reshape(BY_HINGE)}
    return setup.result_of(
        AsBuilt,
        answers.about(stage, files={"necks": measured}),
        {},
        mesh,
        {"analytic model": model.name},
        {**by_hinge, **built.values},
        bands=in_depth.bands,
        warnings=warnings,
        notes=built.notes,
    )


def _redrawn(made: Stage, model: AnalyticResult) -> Redrawn:
    """Return the function from changes of the necks of a stage to its stiffness."""
    links = body_compliance(made)[None] if model.links else None
    unchanged = design_arrays(made).neck

    def redrawn(added: Array) -> Array:
        changed = unchanged + added.reshape(-1, *BY_HINGE)
        return stiffness_with_necks(made, changed, model.formula, model.freedoms, links)

    return redrawn


def _in_depth(
    drawn: Stage, made: Stage, mesh: Mesh | None, progress: Progress | None
) -> ModelAnswer:
    """Return the stiffness as drawn and as made in three dimensions; nothing without a mesh."""
    if mesh is None:
        return ModelAnswer({})

    def by_mesh(resolution: int, layers: int) -> dict[str, Array]:
        found = dict[str, Array]()
        for name, stage in (("drawn", drawn), ("stiffness", made)):
            found[name] = inverse(solved_by(stage, resolution, layers).compliance[:3, :3])
        return found

    return answers.element_values(mesh, by_mesh, progress)[SOLID]
