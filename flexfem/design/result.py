"""What a design is, as it is stored; quantities in the units that their names end in."""

from __future__ import annotations

import json
import os
import re
from typing import Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexfem.files.refusals import place_of
from flexfem.files.toml import Label
from flexfem.refused import BadInput
from flexfem.results import unsealed
from flexfem.units import NONE, Unit, unit_of

Verdict: TypeAlias = Literal["met", "within the band", "missed"]
Checked: TypeAlias = Literal["finite elements", "finite elements in three dimensions", "analytic model alone", "exact"]


class Record(BaseModel):
    """Stored data: frozen, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Stated(Record):
    """One quantity of the design; zero where it is round-off of what symmetry makes zero.

    Where finite elements answer it, `value` is theirs and `band` the half-width by meshes and sampling; `sampling` is
    the part that is not by meshes. `push_spread` says by how much engaged stiffness moves with the spread of pushes.
    """

    name: str
    label: str
    value: float
    band: float | None
    sampling: float | None = None
    uncorrected: float
    checked_by: Checked
    push_spread: float | None = None

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


class Requirement(Stated):
    """A requirement; percentages are of its `size`, the larger end, or one unit where that is zero.

    `active` says whether it limits the objective at the optimum without steps; `relax_to`, where it is missed, which
    end the smallest relaxation in all would take; `tightened_percent` by how much the search kept it inside its ends.
    """

    at_least: float | None
    at_most: float | None
    size: float
    margin: float
    margin_percent: float
    band_percent: float | None
    verdict: Verdict
    active: bool
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


class Round(Record):
    """One round of search, finite elements and correction: largest difference of both models, in per cent."""

    design: dict[str, float]
    gap_percent: float
    evaluations: int


class FrontDesign(Record):
    """A design that no other beats in both objectives, their values by finite elements and by the corrected model."""

    design: dict[str, float]
    values: list[float]
    predicted: list[float]
    margins_percent: list[float]
    met: bool
    stage: str


class Scattered(Record):
    """Share of stages with scattered necks that keep every requirement, and what couplings under tolerance rest on."""

    share: float
    stages: int
    notes: list[str]


class Step(Record):
    """How far a search was: evaluations by the analytic model, best objective, and what was missed in all."""

    evaluations: int
    objective: float | None
    missed: float


class Designed(Record):
    """What `flexfem design` found.

    Attributes
    ----------
    design, relaxed : dict
        The free dimensions in file units, and as they would be without steps, in the model.
    stage : str
        Text of the stage file.
    feasible : bool
        Whether every requirement is met or within its band.
    agreed : bool
        Whether model and finite elements came to agree within `accuracy_percent`.
    sensitivities : dict
        By dimension and quantity (`Stated.name`), per cent for 1 %; None of what is not known or zero.
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
    rounds: list[Round] = Field(min_length=1)
    front: list[FrontDesign]
    scattered: Scattered | None = None
    history: list[Step] = Field(min_length=1)
    evaluations: dict[str, int]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]

    @property
    def notes(self) -> list[str]:
        """By how much the search tightened requirements, and what scatter does, in sentences."""
        tight = [
            f"{each.label} by {each.tightened_percent:.2g} %" for each in self.requirements if each.tightened_percent
        ]
        found = list[str]()
        if tight:
            by = f"accuracy_percent, {self.accuracy_percent:g} %, by which model and finite elements may differ"
            found.append(
                "the search tightened requirements by their bands, and with continuous dimensions by "
                f"{by}: {', '.join(tight)}"
            )
        if self.scattered is not None:
            share = f"{100 * self.scattered.share:.3g} % of {self.scattered.stages:,} stages whose necks scatter"
            found += [f"{share} keep every requirement, by the corrected model", *self.scattered.notes]
        return found

    @property
    def decisive(self) -> list[Stated]:
        """Objectives and active requirements, each quantity once."""
        found = dict[str, Stated]()
        for each in (*self.objectives, *(one for one in self.requirements if one.active)):
            found.setdefault(each.name, each)
        return list(found.values())


def is_design(path: str | os.PathLike[str]) -> bool:
    """Whether a file is plainly the record of a design; what else it may be is not looked at."""
    try:
        return {"objectives", "sensitivities"} <= unsealed(path).keys()
    except BadInput:
        return False  # whoever reads it says what is wrong


def read_design(path: str | os.PathLike[str]) -> Designed:
    """Read a stored design. Raises BadInput when it is none of this version, or not as it was stored."""
    try:
        return Designed.model_validate_json(json.dumps(unsealed(path)))
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"]))
        said = f"{where}: not what this version of flexfem design stores, which makes it again"
        raise BadInput(f"{place_of(path)}: {said}") from None
