"""The stored record of a design; quantities are in the units that their names end in."""

from __future__ import annotations

import json
import os
import tomllib
from textwrap import shorten
from typing import Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexfem.arrays import LONGEST
from flexfem.files.refusals import place_of
from flexfem.files.tables import Label
from flexfem.files.toml import kind_of
from flexfem.refused import BadInput
from flexfem.results import About, TextTable, number, unsealed
from flexfem.study.tables import limits_text
from flexfem.units import Unit

Verdict: TypeAlias = Literal["met", "within the band", "missed"]
Checked: TypeAlias = Literal[
    "finite elements", "finite elements in three dimensions", "analytic model alone", "exact"
]


LIMITING = "limits the objective"  # heading and entry
CHECK = ["source of the value", "analytic model", "difference (%)"]  # headings
SOURCES: dict[Checked, str] = {
    "finite elements": "checked by finite elements",
    "finite elements in three dimensions": "checked by finite elements in three dimensions",
    "analytic model alone": "analytic model",
    "exact": "exact",
}


class Record(BaseModel):
    """Stored data: frozen, without unknown keys."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
    )


class DesignedQuantity(Record):
    """One quantity of the design; zero if symmetry makes it zero up to round-off.

    `value` is by finite elements where available; `band` is then its half-width by meshes and
    sampling, with `sampling` the part of sampling alone. `push_spread` is the change of engaged
    stiffness with the spread of actuator forces."""

    name: str
    label: str
    unit: str
    value: float
    band: float | None
    sampling: float | None = None
    uncorrected: float
    checked_by: Checked
    push_spread: float | None = None

    def unit_text(self, plain: bool) -> str:
        """Return the unit, for terminals in ASCII if `plain`."""
        return Unit(1.0, self.unit).label(plain)

    def label_with_unit(self, plain: bool = False) -> str:
        """Return the label with its unit, if any, in brackets; `plain` for terminals."""
        return f"{self.label} ({self.unit_text(plain)})" if self.unit else self.label

    def formatted(self, plain: bool = False) -> str:
        """Return value, band and unit as text, with the part of sampling in the band."""
        text = number(self.value, self.band) if self.band else f"{self.value:.6g}"
        text = f"{text} {self.unit_text(plain)}".rstrip()
        if self.sampling is not None:
            text += f", of which {self.sampling:.2g} by sampling"
        if self.push_spread is not None:
            text += f", ± {self.push_spread:.2g} by the spread of the forces"
        return text

    @property
    def is_checked(self) -> bool:
        """Whether the value is by finite elements."""
        return self.checked_by.startswith("finite")

    @property
    def difference_percent(self) -> float | None:
        """Difference of finite elements from the uncorrected model, %; None without both."""
        if not self.is_checked or not self.uncorrected or not self.value:
            return None
        return 100 * (self.value / self.uncorrected - 1)

    @property
    def source(self) -> str:
        """The value's source as text, with the difference from the analytic model."""
        text = SOURCES[self.checked_by]
        if self.difference_percent is None:
            return text
        return f"{text}, difference {self.difference_percent:+.2g} % from the analytic model"

    @property
    def checks(self) -> list[str]:
        """The source of the value, the value by the uncorrected model, and their difference."""
        difference = self.difference_percent
        return [
            SOURCES[self.checked_by],
            f"{self.uncorrected:.6g}",
            "" if difference is None else f"{difference:+.2g}",
        ]


class Goal(DesignedQuantity):
    """An objective, to be maximised or minimised."""

    better: Literal["larger", "smaller"]


class Requirement(DesignedQuantity):
    """A requirement; percentages are of its `size`, the larger end, or one unit where that is zero.

    An `active` requirement limits the objective at the optimum without steps; `tightened_percent`
    is the distance that the search kept from its ends."""

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
    def limits(self) -> str:
        """Its ends as text, without unit."""
        return limits_text(self.at_least, self.at_most)

    @property
    def margin_text(self) -> str:
        """The margin with its band, per cent."""
        band = f" ± {self.band_percent:.2g}" if self.band_percent else ""
        return f"{self.margin_percent:.3g}{band}"


class SoleRelaxation(Record):
    """The smallest sufficient relaxation of one requirement alone, by the model; None if there is
    none.
    """

    requirement: str
    relax_to: float | None
    percent: float | None


class Round(Record):
    """One round of search, finite elements and correction, with the largest difference between both
    models.
    """

    design: dict[str, float]
    gap_percent: float
    evaluations: int


class FrontDesign(Record):
    """A design of the Pareto front, with its objectives by finite elements and by the corrected
    model.
    """

    design: dict[str, float]
    values: list[float]
    predicted: list[float]
    margins_percent: list[float]
    met: bool
    stage: str


class Scattered(Record):
    """Share of stages with scattered necks that keep every requirement, and notes on couplings
    under tolerance.
    """

    share: float
    stages: int
    notes: list[str]


class Step(Record):
    """Progress of a search: evaluations of the analytic model, best objective, and sum of the
    violations.
    """

    evaluations: int
    objective: float | None
    missed: float


class Designed(Record):
    """The result of `flexfem design`.

    Attributes
    ----------
    design, relaxed : dict
        The free dimensions in file units, and those of the optimum without steps, by the model.
    stage : str
        Text of the stage or mechanism file.
    feasible : bool
        Whether every requirement is met or within its band.
    agreed : bool
        Whether model and finite elements agree within `accuracy_percent` at the end.
    sensitivities : dict
        By dimension and quantity (`Stated.name`), per cent for 1 %; None where unknown, or for a
        quantity of zero.
    """

    name: Label
    file: str
    base: str
    hash: str
    seed: int
    accuracy_percent: float
    design: dict[str, float]
    units: dict[str, str] = {}  # of the dimensions
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

    def __repr__(self) -> str:
        goals = "; ".join(f"{goal.label}: {goal.formatted(plain=True)}" for goal in self.objectives)
        return shorten(f"<Designed of {self.heading()}; {goals}>", LONGEST, placeholder=" ...>")

    @property
    def about(self) -> About:
        """Name, file, hash and assumptions."""
        return About(self.name, self.file, self.hash, self.assumed, self.not_stated)

    @property
    def kind(self) -> str:
        """Kind of the designed plate, "stage" or "mechanism"."""
        return (kind_of(tomllib.loads(self.stage)) or "stage").removesuffix(" file")

    @property
    def state(self) -> str:
        """Verdict on all requirements as text."""
        nearest = "does not meet all requirements, and is the nearest design found"
        return "meets all requirements" if self.feasible else nearest

    def heading(self) -> str:
        """Return the result in one line."""
        return f"{self.name}: it {self.state}; seed {self.seed}"

    def sentences(self) -> list[str]:
        """Return notes on the tables: bands, tightened requirements, scatter, and agreement of the
        models.
        """
        notes = [
            "±: band of the meshes, and for a coupling under tolerance of the random stages; a "
            "value without a band is exact, or by the analytic model; a value that is checked by "
            "finite elements is theirs"
        ]
        tight = [
            f"{each.label} by {each.tightened_percent:.2g} %"
            for each in self.requirements
            if each.tightened_percent
        ]
        if tight:
            notes.append(
                "the search tightened requirements by their bands, and with continuous "
                f"dimensions by {self.accuracy_percent:g} % (accuracy_percent), the allowed "
                f"difference of model and finite elements: {', '.join(tight)}"
            )
        if self.scattered is not None:
            notes.append(
                f"{100 * self.scattered.share:.3g} % of {self.scattered.stages:,} stages with "
                "scattered necks meet every requirement, by the corrected model"
            )
            notes += self.scattered.notes
        agreed = "agree" if self.agreed else "do not agree"
        notes.append(
            f"corrected model and finite elements {agreed} within {self.accuracy_percent:g} % at "
            "the design"
        )
        return notes

    def tables(self, plain: bool = True) -> list[TextTable]:
        """Return the tables of all sections; `plain` for terminals."""
        return [table for tables in self.sections(plain).values() for table in tables]

    def sections(self, plain: bool = True) -> dict[str, list[TextTable]]:
        """Return the tables by section, without empty ones; `plain` for terminals."""
        tables = {
            "design": [self._dimensions(), self._objectives(plain)],
            "requirements": [self._margins(plain), self._relaxations()],
            "sensitivity": [self._sensitivities()],
            "front": [self._front(plain)],
            "search": [self._evaluations(), self._rounds()],
        }
        filled = {name: [each for each in found if each.rows] for name, found in tables.items()}
        return {name: found for name, found in filled.items() if found}

    def _dimensions(self) -> TextTable:
        head = [
            f"dimension (units of the {self.kind} file)",
            "designed",
            "without steps, by the model",
            "limit",
        ]
        rows = []
        for name, value in self.design.items():
            limit = "at an end of its range" if name in self.at_ends else ""
            rows.append([name, f"{value:.6g}", f"{self.relaxed[name]:.6g}", limit])
        return TextTable(head, rows, 1, "Dimensions of the design")

    def _objectives(self, plain: bool) -> TextTable:
        head = ["objective", "value", "better", *CHECK]
        rows = [
            [goal.label, goal.formatted(plain), goal.better, *goal.checks]
            for goal in self.objectives
        ]
        return TextTable(head, rows, 1, "Objectives")

    def _margins(self, plain: bool) -> TextTable:
        head = [
            "requirement",
            "limits",
            "value",
            "verdict",
            "margin (% of the limit)",
            LIMITING,
            *CHECK,
        ]
        rows = [
            [
                each.label,
                each.limits,
                each.formatted(plain),
                each.verdict,
                each.margin_text,
                LIMITING if each.active else "",
                *each.checks,
            ]
            for each in self.requirements
        ]
        return TextTable(head, rows, 1, "Requirements with their margins")

    def _relaxations(self) -> TextTable:
        """The smallest relaxations of missed requirements with the others, then of each alone."""
        rows = [
            [each.label, "with the others", f"{each.value:.6g}", f"{-each.margin_percent:.3g}"]
            for each in self.requirements
            if each.verdict == "missed"
        ]
        for alone in self.alternatives:
            to = ["not sufficient", ""]
            if alone.relax_to is not None and alone.percent is not None:
                to = [f"{alone.relax_to:.6g}", f"{alone.percent:.3g}"]
            rows.append([alone.requirement, "alone", *to])
        head = ["requirement", "relaxed", "to", "by (%)"]
        return TextTable(head, rows, 2, "Smallest relaxations, by the model")

    def _sensitivities(self) -> TextTable:
        labels = {each.name: each.label for each in (*self.requirements, *self.objectives)}
        rows = []
        for dimension, changes in self.sensitivities.items():
            texts = [
                "not known" if changes[name] is None else f"{changes[name]:+.3g}" for name in labels
            ]
            rows.append([dimension, *texts])
        head = ["dimension", *labels.values()]
        return TextTable(head, rows, 1, "Change (%) per 1 % increase of a dimension")

    def _front(self, plain: bool) -> TextTable:
        objectives = [goal.label_with_unit(plain) for goal in self.objectives]
        head = [
            "design",
            *self.design,
            *objectives,
            *(f"{title}, corrected model" for title in objectives),
            *(f"margin of {each.label} (%)" for each in self.requirements),
            "requirements",
        ]
        rows = []
        for place, point in enumerate(self.front, 1):
            values = [*point.design.values(), *point.values, *point.predicted]
            rows.append(
                [
                    str(place),
                    *(f"{value:.6g}" for value in values),
                    *(f"{margin:.3g}" for margin in point.margins_percent),
                    "met" if point.met else "not met",
                ]
            )
        caption = "Pareto front of both objectives, solved by finite elements"
        return TextTable(head, rows, 1, caption)

    def _evaluations(self) -> TextTable:
        rows = [[name, f"{count:,}"] for name, count in self.evaluations.items()]
        return TextTable(["model", "designs"], rows, 1, "Evaluations")

    def _rounds(self) -> TextTable:
        rows = [
            [str(place), f"{each.evaluations:,}", f"{each.gap_percent:.3g}"]
            for place, each in enumerate(self.rounds, 1)
        ]
        head = ["round", "designs by the model", "largest difference (%)"]
        return TextTable(head, rows, 1, "Rounds")

    @property
    def decisive(self) -> list[DesignedQuantity]:
        """Objectives and active requirements, each quantity once."""
        by_name = dict[str, DesignedQuantity]()
        for quantity in (*self.objectives, *(r for r in self.requirements if r.active)):
            by_name.setdefault(quantity.name, quantity)
        return list(by_name.values())


def is_design(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a design record; its validity is not checked."""
    try:
        return {"objectives", "sensitivities"} <= unsealed(path).keys()
    except BadInput:
        return False  # the function that reads it reports the reason


def read_design(path: str | os.PathLike[str]) -> Designed:
    """Read a stored design. Raises BadInput when it is of another version, or was changed since it
    was stored.
    """
    try:
        return Designed.model_validate_json(json.dumps(unsealed(path)))
    except ValidationError as error:
        where = ".".join(map(str, error.errors()[0]["loc"]))
        problem = f"{where}: not a record of this version of flexfem; run flexfem design again"
        raise BadInput(f"{place_of(path)}: {problem}") from None
