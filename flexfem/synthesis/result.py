"""What a design is, as it is stored; quantities in the units that their names end in."""

from __future__ import annotations

import math
import re
from typing import Literal, TypeAlias

from flexfem.units import NONE, Unit, unit_of
from flexfem.verify.result import Record

Verdict: TypeAlias = Literal["met", "within the band", "missed"]
Checked: TypeAlias = Literal["finite elements", "finite elements in three dimensions", "analytic model alone", "exact"]


class Stated(Record):
    """One quantity of the design.

    value : of finite elements where they answer it, with their `band` by meshes; else of the analytic model, None.
    uncorrected : of the analytic model by itself.   checked_by : which of them `value` is.
    """

    name: str
    label: str
    value: float
    band: float | None
    uncorrected: float
    checked_by: Checked

    @property
    def unit(self) -> Unit:
        """The unit of a column or key; none of an expression of several."""
        return unit_of(self.name) if re.fullmatch(r"[\w.\[\]]+", self.name) else NONE


class Goal(Stated):
    """An objective, to be as large or as small as can be."""

    better: Literal["larger", "smaller"]


class Requirement(Stated):
    """A requirement.

    margin : how far the value is inside the nearer end, in its unit; margin_percent, band_percent over the `size` of
        the requirement, its larger end.
    active : whether it stops the objective, at the optimum without steps.
    price_percent : by how much of itself the objective gets worse for 1 % more; None where it is not active, or where
        nothing beside the optimum keeps that.
    relax_to : where it is missed, the end that would have to do: of the smallest relaxation in all, by parts of sizes.
    """

    at_least: float | None
    at_most: float | None
    size: float
    margin: float
    margin_percent: float
    band_percent: float | None
    verdict: Verdict
    active: bool
    price_percent: float | None
    relax_to: float | None


class SoleRelaxation(Record):
    """The smallest relaxation of one requirement alone, the others kept, by the model; None where none is enough."""

    requirement: str
    relax_to: float | None
    percent: float | None


class Turn(Record):
    """One round of search, finite elements and correction: largest difference of model and elements, in per cent."""

    design: dict[str, float]
    gap_percent: float
    evaluations: int


class FrontDesign(Record):
    """A design that no other beats in both objectives, by finite elements; those of the model corrected elsewhere."""

    design: dict[str, float]
    values: list[float]
    predicted: list[float]
    met: bool


class Step(Record):
    """How far a search was: evaluations by the analytic model, best objective, and what was missed in all."""

    evaluations: int
    objective: float | None
    missed: float


class Designed(Record):
    """What `flexfem design` found.

    design : the free dimensions in file units; relaxed : as they would be without steps, in the model.
    stage : text of the stage file.   feasible : whether every requirement is met or within its band.
    agreed : whether model and finite elements came to agree within `accuracy_percent`.
    sensitivities : by dimension and quantity, per cent for 1 %.   evaluations : by model.
    history : of the first search.
    """

    name: str
    file: str
    base: str
    hash: str
    seed: int
    accuracy_percent: float
    design: dict[str, float]
    relaxed: dict[str, float]
    stage: str
    feasible: bool
    agreed: bool
    objectives: list[Goal]
    requirements: list[Requirement]
    alternatives: list[SoleRelaxation]
    at_ends: list[str]
    sensitivities: dict[str, dict[str, float | None]]
    rounds: list[Turn]
    front: list[FrontDesign]
    history: list[Step]
    evaluations: dict[str, int]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]


def finite(value: float) -> float | None:
    """The number, None where it is none."""
    return float(value) if math.isfinite(value) else None
