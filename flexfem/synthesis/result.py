"""What a design is, as it is stored; quantities in the units that their names end in."""

from __future__ import annotations

import math
import re
from typing import Literal, TypeAlias

from pydantic import Field

from flexfem.files.toml import Label
from flexfem.units import NONE, Unit, unit_of
from flexfem.verify.result import Record

Verdict: TypeAlias = Literal["met", "within the band", "missed"]
Checked: TypeAlias = Literal["finite elements", "finite elements in three dimensions", "analytic model alone", "exact"]


class Stated(Record):
    """One quantity of the design.

    value : of finite elements where they answer it, with their `band` by meshes; else of the analytic model, None.
    uncorrected : of the analytic model by itself.   checked_by : which of them `value` is.
    sampling : of a coupling under tolerance, the part of the band that is not by meshes; None else.
    push_spread : of engaged stiffness, by how much it moves with the length over which pushes spread, see
        `Command.push_spread`; None else.
    round_off : up to which size a value is round-off of what symmetry makes zero.
    """

    name: str
    label: str
    value: float
    band: float | None
    sampling: float | None = None
    uncorrected: float
    checked_by: Checked
    round_off: float = 0.0
    push_spread: float | None = None

    def shown(self, value: float) -> float:
        """A value of it to be printed: 0 where it is round-off."""
        return 0.0 if abs(value) <= self.round_off else value

    @property
    def unit(self) -> Unit:
        """The unit of a column or key; none of an expression of several."""
        return unit_of(self.name) if re.fullmatch(r"[\w.\[\]]+", self.name) else NONE

    def headed(self, plain: bool = False) -> str:
        """The label, with the unit in brackets where there is one; `plain` for terminals."""
        unit = self.unit.plain if plain else self.unit.name
        return f"{self.label} ({unit})" if unit else self.label


class Goal(Stated):
    """An objective, to be as large or as small as can be."""

    better: Literal["larger", "smaller"]

    @property
    def sought(self) -> str:
        """The label with its unit, and which way is better: for an axis."""
        return f"{self.headed()}, the {self.better} the better"


class Requirement(Stated):
    """A requirement.

    margin : how far the value is inside the nearer end, in its unit; margin_percent, band_percent over the `size` of
        the requirement, its larger end; tightened_percent of it, by how much the search kept it inside its ends.
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
    tightened_percent: float = 0.0

    @property
    def wanted(self) -> list[str]:
        """Its ends in words, without unit."""
        ends = (("at least", self.at_least), ("at most", self.at_most))
        return [f"{word} {end:g}" for word, end in ends if end is not None]


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
    """A design that no other beats in all objectives.

    values : objectives by finite elements; predicted : by the model as it was corrected at the design of the record.
    margins_percent : of every requirement, as `Requirement`.   met : whether each is kept, within its band.
    stage : text of its stage file.
    """

    design: dict[str, float]
    values: list[float]
    predicted: list[float]
    margins_percent: list[float]
    met: bool
    stage: str


class ScatteredCoupling(Record):
    """A coupling that 95 % of stages keep whose necks scatter.

    searched : by the model, of those that the design was searched with.   others : of others, which no search has seen;
        those of all stages lie between `low` and `high` with a confidence of 95 %, by order statistics.
    factor : by which finite elements differ from the model in those others that both solve, by least squares;
        misfit : the largest difference that is left. None where none are checked.
    """

    name: str
    searched: float
    searched_stages: int
    others: float
    low: float
    high: float
    other_stages: int
    checked_stages: int
    factor: float | None
    misfit: float | None

    @property
    def said(self) -> str:
        """In words."""
        text = f"{self.name} of {self.other_stages:,} stages that no search has seen, by the model: {self.others:.4g}, "
        text += f"95 % interval {self.low:.4g} to {self.high:.4g}; "
        text += f"of the {self.searched_stages:,} searched {self.searched:.4g}"
        if self.factor is None:
            return text
        of_elements = f"{self.factor:.4f} times that, off by at most {self.misfit:.2g} in one"
        return f"{text}; finite elements of {self.checked_stages}: {of_elements}"


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
    sensitivities : by dimension and quantity (`Stated.name`), per cent for 1 %.   evaluations : by model.
    history : of the first search.
    """

    name: Label
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
    objectives: list[Goal] = Field(min_length=1)
    requirements: list[Requirement]
    alternatives: list[SoleRelaxation]
    at_ends: list[str]
    sensitivities: dict[str, dict[str, float | None]]
    rounds: list[Turn] = Field(min_length=1)
    front: list[FrontDesign]
    scattered: list[ScatteredCoupling] = Field(default_factory=list)
    history: list[Step] = Field(min_length=1)
    evaluations: dict[str, int]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]

    @property
    def tightening(self) -> list[str]:
        """By how much the search tightened requirements and what that costs, in a sentence; none where it did not."""
        tight = [each for each in self.requirements if each.tightened_percent > 0]
        if not tight:
            return []
        by = ", ".join(f"{each.label} by {each.tightened_percent:.2g} %" for each in tight)
        room = f"accuracy_percent, {self.accuracy_percent:g} %, by which model and finite elements may differ"
        said = f"the search tightened requirements by their bands, and with continuous dimensions by {room}: {by}"
        priced = [each for each in tight if each.price_percent is not None]
        if not priced:
            return [said]
        goal, cost = self.objectives[0], sum((each.price_percent or 0.0) * each.tightened_percent for each in priced)
        worse = f"{cost:.2g} %, {abs(cost / 100 * goal.value):.2g} {goal.unit.plain}".rstrip()
        band = "" if not goal.band else f", its band being ± {goal.band:.2g}"
        return [f"{said}; by their prices that costs {goal.label} about {worse}{band}"]

    @property
    def decisive(self) -> list[Stated]:
        """Objectives and active requirements, each quantity once."""
        found = dict[str, Stated]()
        for each in (*self.objectives, *(one for one in self.requirements if one.active)):
            found.setdefault(each.name, each)
        return list(found.values())


def finite(value: float) -> float | None:
    """The number, None where it is none."""
    return float(value) if math.isfinite(value) else None
