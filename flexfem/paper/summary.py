"""The summary of a stage: stiffness, first yield, and the range of its drive."""

from __future__ import annotations

from dataclasses import replace

from flexfem.paper.stage import Stage
from flexfem.paper.stiffness import stiffness
from flexfem.questions.reach import reach
from flexfem.questions.setup import DEFAULT, Analytic, Models
from flexfem.questions.summary import Summary, at_rest_of, ends_of, material_of
from flexfem.refused import ComputationFailed
from flexfem.results import COARSE_MESHES, STRESS, Progress, Quantity, Result

BY_DIRECTION = ("direction", "model")


class StageSummary(Result):
    """Stiffness, first yield, its force and stress by direction, and ranges of the drive."""

    kind_name = "summary"
    title = "summary"
    main_result = ("free", {})
    stiffness = replace(Summary.stiffness, gate=COARSE_MESHES, compared=True)
    free = replace(Summary.free, gate=COARSE_MESHES)
    yield_range = replace(Summary.yield_range, gate=STRESS)
    yield_force = replace(Summary.yield_force, gate=STRESS)
    stress = replace(Summary.stress, over=(*BY_DIRECTION, "chain", "hinge"), gate=STRESS)
    thickness = Quantity("change of stiffness in 3D", "percent", ("direction",))
    held_low = Summary.held_low
    held_high = Summary.held_high
    free_low = Summary.free_low
    free_high = Summary.free_high


def summary(
    stage: Stage,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> StageSummary:
    """Answer `flexfem.summary` for a stage; the arguments are those of that function."""
    found = stiffness(
        stage,
        models=models,
        analytic=analytic,
        resolution=resolution,
        solid=solid,
        thickness_resolution=thickness_resolution,
        progress=progress,
    )
    values, bands = at_rest_of(found.internal)
    material, sources = material_of(stage)
    settings = {"mobility": stage.mobility, **material, **found.settings}
    warnings = [*found.warnings]
    notes = [*found.notes, *sources]
    if stage.actuator:
        try:
            reached = reach(stage, models="analytic", analytic=analytic)
        except ComputationFailed as failure:
            warnings.append(str(failure))
        else:
            notes.append("range of the drive: within all its limits, by the analytic model")
            values |= ends_of(reached.internal.values["ends"])
            warnings += reached.warnings
    return StageSummary(found.about, values, bands, found.axes, settings, warnings, notes)
