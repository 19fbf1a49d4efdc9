"""What a design is, as it is stored; quantities in the units that their names end in."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from typing import Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexfem.files.refusals import place_of
from flexfem.files.toml import Label
from flexfem.refused import BadInput
from flexfem.results import About, TextTable, number, unsealed
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
        unit = self.unit.label(plain)
        return f"{self.label} ({unit})" if unit else self.label

    def said(self, plain: bool = False) -> str:
        """Value, band and unit, and what part of the band is not by meshes."""
        text = number(self.value, self.band) if self.band else f"{self.value:.6g}"
        sampling = "" if self.sampling is None else f", of that {self.sampling:.2g} by sampling"
        spread = "" if self.push_spread is None else f", ± {self.push_spread:.2g} by the spread of the pushes"
        return f"{text} {self.unit.label(plain)}".rstrip() + sampling + spread


class Goal(Stated):
    """An objective, to be as large or as small as can be."""

    better: Literal["larger", "smaller"]


class Requirement(Stated):
    """A requirement; percentages are of its `size`, the larger end, or one unit where that is zero.

    `active` says whether it limits the objective at the optimum without steps; `tightened_percent` by how much the
    search kept it inside its ends.
    """

    at_least: float | None
    at_most: float | None
    size: float
    margin: float
    margin_percent: float
    band_percent: float | None
    verdict: Verdict
    active: bool
    tightened_percent: float = 0.0

    @property
    def wanted(self) -> str:
        """Its ends in words, without unit."""
        ends = (("at least", self.at_least), ("at most", self.at_most))
        return " and ".join(f"{word} {end:g}" for word, end in ends if end is not None)


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
    def about(self) -> About:
        """What it is of."""
        return About(self.name, self.file, self.hash, self.assumed, self.not_stated)

    @property
    def state(self) -> str:
        """Whether all requirements are met, in words."""
        nearest = "does not meet all requirements: the nearest that was found"
        return "meets all requirements" if self.feasible else nearest

    def heading(self) -> str:
        """What was found in one line."""
        return f"{self.name}: it {self.state}; seed {self.seed}"

    def sentences(self) -> list[str]:
        """How the tables are to be read: bands, what the search tightened, what scatter does, and how models agree."""
        found = [
            "±: band of the meshes, and of the stages drawn for a coupling under tolerance; without one a value is "
            "exact, or of the analytic model alone"
        ]
        tight = [
            f"{each.label} by {each.tightened_percent:.2g} %" for each in self.requirements if each.tightened_percent
        ]
        if tight:
            found.append(
                "the search tightened requirements by their bands, and with continuous dimensions by "
                f"accuracy_percent, {self.accuracy_percent:g} %, by which model and finite elements may differ: "
                f"{', '.join(tight)}"
            )
        if self.scattered is not None:
            share = f"{100 * self.scattered.share:.3g} % of {self.scattered.stages:,} stages whose necks scatter"
            found += [f"{share} keep every requirement, by the corrected model", *self.scattered.notes]
        agreed = "came to agree" if self.agreed else "did not come to agree"
        agreement = f"corrected model and finite elements {agreed} within {self.accuracy_percent:g} % at the design"
        return [*found, agreement]

    def tables(self, plain: bool = True) -> list[TextTable]:
        """All tables, one after the other; `plain` for terminals."""
        return [table for tables in self.sections(plain).values() for table in tables]

    def sections(self, plain: bool = True) -> dict[str, list[TextTable]]:
        """Tables by what they are about; none of what there is nothing to say about."""
        found: dict[str, list[TextTable]] = {}

        def add(section: str, caption: str, head: list[str], rows: Iterable[list[str]], names: int = 1) -> None:
            if made := list(rows):
                found.setdefault(section, []).append(TextTable(head, made, names, caption))

        limit, rests = "limits the objective", ["checked by", "model by itself"]
        every = {each.name: each.label for each in (*self.requirements, *self.objectives)}
        headed = [goal.headed(plain) for goal in self.objectives]
        add(
            "design", "Dimensions of the design",
            ["dimension (units of the stage file)", "designed", "without steps, by the model", "limit"],
            ([name, f"{value:.6g}", f"{self.relaxed[name]:.6g}", "at an end of its range" * (name in self.at_ends)]
             for name, value in self.design.items()),
        )  # fmt: skip
        add(
            "design", "Objectives", ["objective", "value", "better", *rests],
            ([each.label, each.said(plain), each.better, each.checked_by, f"{each.uncorrected:.6g}"]
             for each in self.objectives),
        )  # fmt: skip
        add(
            "requirements", "Requirements with their margins",
            ["requirement", "wanted", "value", "verdict", "margin (% of the end)", limit, *rests],
            ([each.label, each.wanted, each.said(plain), each.verdict,
              f"{each.margin_percent:.3g}" + (f" ± {each.band_percent:.2g}" if each.band_percent else ""),
              limit * each.active, each.checked_by, f"{each.uncorrected:.6g}"] for each in self.requirements),
        )  # fmt: skip
        relaxed = [(each.label, "with the others", each.value, -each.margin_percent)
                   for each in self.requirements if each.verdict == "missed"]  # fmt: skip
        sole = [(one.requirement, "alone", one.relax_to, one.percent) for one in self.alternatives]
        add(
            "requirements", "Smallest relaxations, by the model", ["requirement", "relaxed", "to", "by (%)"],
            ([name, how, *(["none is enough", ""] if to is None or by is None else [f"{to:.6g}", f"{by:.3g}"])]
             for name, how, to, by in (*relaxed, *sole)), 2,
        )  # fmt: skip
        add(
            "sensitivity", "Change (%) for 1 % more of a dimension", ["dimension", *every.values()],
            ([name, *("not known" if row[key] is None else f"{row[key]:+.3g}" for key in every)]
             for name, row in self.sensitivities.items()),
        )  # fmt: skip
        add(
            "front", "Designs that no other beats in both objectives, solved by finite elements",
            ["design", *self.design, *headed, *(f"{each}, corrected model" for each in headed),
             *(f"margin of {each.label} (%)" for each in self.requirements), "requirements"],
            ([str(k), *(f"{x:.6g}" for x in (*one.design.values(), *one.values, *one.predicted)),
              *(f"{x:.3g}" for x in one.margins_percent), "met" if one.met else "not met"]
             for k, one in enumerate(self.front, 1)),
        )  # fmt: skip
        counts = ([name, f"{count:,}"] for name, count in self.evaluations.items())
        add("search", "Evaluations", ["model", "designs"], counts)
        rounds = ([str(k), f"{r.evaluations:,}", f"{r.gap_percent:.3g}"] for k, r in enumerate(self.rounds, 1))
        add("search", "Rounds", ["round", "designs by the model", "largest difference (%)"], rounds)
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
