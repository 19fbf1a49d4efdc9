"""One stage in one table: how far it may go in each direction, what that takes, and how far its drive reaches."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.stage import Stage
from flexfem.questions.reach import reach
from flexfem.questions.setup import DEFAULT, Analytic, Models, question
from flexfem.questions.stiffness import stiffness
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, COARSER, SOLVED, STRESS, Progress, Quantity, Result
from flexfem.units import PLANES

EACH = ("direction", "model")


class Summary(Result):
    """Stiffness, range at yield, force and stress by direction, and the ranges of the drive."""

    title = "summary"
    columns = ()
    reading = (
        "range at yield: the other directions held, until the first neck yields; the force is along the displacement",
        "drive: with the other directions held at zero, or free",
    )
    stiffness = Quantity("stiffness, the others held", "stiffness", EACH, COARSER)
    free = Quantity("stiffness, the others free", "stiffness", EACH, COARSER)
    yield_range = Quantity("range at yield, ±", "motion", EACH, STRESS, prefixed=True)
    yield_force = Quantity("force there", "wrench", EACH, STRESS)
    stress = Quantity(
        "neck stress per displacement", "stress per motion", (*EACH, "chain", "hinge"), STRESS, "all",
        largest=("chain", "hinge"),
    )  # fmt: skip
    thickness = Quantity("change of stiffness by three-dimensional hinges", "percent", ("direction",))
    held_low = Quantity("drive, others held, from", "motion", ("direction",), SOLVED, prefixed=True)
    held_high = Quantity("to", "motion", ("direction",), SOLVED, prefixed=True)
    free_low = Quantity("others free, from", "motion", ("direction",), SOLVED, prefixed=True)
    free_high = Quantity("to ", "motion", ("direction",), SOLVED, prefixed=True)


@question
def summary(
    stage: Stage,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Summary:
    """How far a stage may go in each direction before a neck yields, the force that takes, and what its drive reaches.

    Parameters
    ----------
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.summary(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> float(found.at("yield_range", direction="x", model="analytic").round(3))  # mm
    0.641
    """
    found = stiffness(stage, models=models, analytic=analytic, resolution=resolution, layers=layers, progress=progress)
    values, bands = dict[str, Array](), dict[str, Array]()
    for target, source in ((values, found.values), (bands, found.bands)):
        for name in source.keys() & {"free", "yield_range", "yield_force", "stress"}:
            target[name] = np.moveaxis(source[name], -1, 0)
        if "stiffness" in source:
            target["stiffness"] = np.diagonal(source["stiffness"], axis1=1, axis2=2).T
    if "thickness" in found.values:
        values["thickness"] = found.thickness
    warnings, by_source = list(found.warnings), dict[str, list[str]]()
    if stage.actuator:
        try:
            of_drive = reach(stage, models="analytic", analytic=analytic)
        except ComputationFailed as failure:
            warnings.append(str(failure))
        else:
            for name, others in (("held", "zero"), ("free", "free")):
                for end in ("low", "high"):
                    values[f"{name}_{end}"] = of_drive.at("ends", others=others, end=end, model=ANALYTIC)
            warnings += of_drive.warnings
    for key in (key for key in stage.numbers if key.startswith("material")):
        by_source.setdefault(stage.sources[key] or "not stated", []).append(key)
    notes = [*found.notes, *(f"{', '.join(keys)}: {source}" for source, keys in by_source.items())]
    settings = {
        "mobility": stage.mobility,
        "plane problem": PLANES[stage.model],
        "yield strength": f"{stage.material.yield_strength:g} MPa",
    }
    return Summary(found.about, values, bands, found.axes, settings | found.settings, warnings, notes)
