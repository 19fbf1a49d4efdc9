"""The stored record of a design; quantities are in the units that their names end in."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterable
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


class Record(BaseModel):
    """Stored data: frozen, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Stated(Record):
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
        sampling = "" if self.sampling is None else f", of which {self.sampling:.2g} by sampling"
        spread = (
            ""
            if self.push_spread is None
            else f", ± {self.push_spread:.2g} by the spread of the forces"
        )
        return f"{text} {self.unit_text(plain)}".rstrip() + sampling + spread


class Goal(Stated):
    """An objective, to be maximised or minimised."""

    better: Literal["larger", "smaller"]


class Requirement(Stated):
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
            "value without a band is exact, or by the analytic model alone"
        ]
        tight = [
            f"{r.label} by {r.tightened_percent:.2g} %"
            for r in self.requirements
            if r.tightened_percent
        ]
        if tight:
            notes.append(
                "the search tightened requirements by their bands, and with continuous "
                f"dimensions by {self.accuracy_percent:g} % (accuracy_percent), the allowed "
                f"difference of model and finite elements: {', '.join(tight)}"
            )
        if self.scattered is not None:
            share = (
                f"{100 * self.scattered.share:.3g} % of {self.scattered.stages:,} stages with "
                "scattered necks"
            )
            notes += [
                f"{share} meet every requirement, by the corrected model",
                *self.scattered.notes,
            ]
        agreed = "agree" if self.agreed else "do not agree"
        agreement = (
            f"corrected model and finite elements {agreed} within {self.accuracy_percent:g} % at "
            "the design"
        )
        return [*notes, agreement]

    def tables(self, plain: bool = True) -> list[TextTable]:
        """Return the tables of all sections; `plain` for terminals."""
        return [table for tables in self.sections(plain).values() for table in tables]

    def sections(self, plain: bool = True) -> dict[str, list[TextTable]]:
        """Return the tables by section, without empty ones."""
        sections: dict[str, list[TextTable]] = {}

        def add(
            section: str, caption: str, head: list[str], rows: Iterable[list[str]], names: int = 1
        ) -> None:
            if filled := list(rows):
                sections.setdefault(section, []).append(TextTable(head, filled, names, caption))

        limit = "limits the objective"
        check = ["checked by", "uncorrected model"]
        labels = {each.name: each.label for each in (*self.requirements, *self.objectives)}
        objectives = [goal.label_with_unit(plain) for goal in self.objectives]
        add(
            "design",
            "Dimensions of the design",
            [
                f"dimension (units of the {self.kind} file)",
                "designed",
                "without steps, by the model",
                "limit",
            ],
            (
                [
                    name,
                    f"{value:.6g}",
                    f"{self.relaxed[name]:.6g}",
                    "at an end of its range" * (name in self.at_ends),
                ]
                for name, value in self.design.items()
            ),
        )
        add(
            "design",
            "Objectives",
            ["objective", "value", "better", *check],
            (
                [
                    goal.label,
                    goal.formatted(plain),
                    goal.better,
                    goal.checked_by,
                    f"{goal.uncorrected:.6g}",
                ]
                for goal in self.objectives
            ),
        )
        add(
            "requirements",
            "Requirements with their margins",
            ["requirement", "limits", "value", "verdict", "margin (% of the limit)", limit, *check],
            (
                [
                    r.label,
                    r.limits,
                    r.formatted(plain),
                    r.verdict,
                    f"{r.margin_percent:.3g}"
                    + (f" ± {r.band_percent:.2g}" if r.band_percent else ""),
                    limit * r.active,
                    r.checked_by,
                    f"{r.uncorrected:.6g}",
                ]
                for r in self.requirements
            ),
        )
        joint = [
            (r.label, "with the others", r.value, -r.margin_percent)
            for r in self.requirements
            if r.verdict == "missed"
        ]
        sole = [
            (relaxed.requirement, "alone", relaxed.relax_to, relaxed.percent)
            for relaxed in self.alternatives
        ]
        add(
            "requirements",
            "Smallest relaxations, by the model",
            ["requirement", "relaxed", "to", "by (%)"],
            (
                [
                    name,
                    how,
                    *(
                        ["not sufficient", ""]
                        if to is None or by is None
                        else [f"{to:.6g}", f"{by:.3g}"]
                    ),
                ]
                for name, how, to, by in (*joint, *sole)
            ),
            2,
        )
        add(
            "sensitivity",
            "Change (%) per 1 % increase of a dimension",
            ["dimension", *labels.values()],
            (
                [name, *("not known" if row[key] is None else f"{row[key]:+.3g}" for key in labels)]
                for name, row in self.sensitivities.items()
            ),
        )
        add(
            "front",
            "Pareto front of both objectives, solved by finite elements",
            [
                "design",
                *self.design,
                *objectives,
                *(f"{title}, corrected model" for title in objectives),
                *(f"margin of {r.label} (%)" for r in self.requirements),
                "requirements",
            ],
            (
                [
                    str(k),
                    *(
                        f"{x:.6g}"
                        for x in (*point.design.values(), *point.values, *point.predicted)
                    ),
                    *(f"{x:.3g}" for x in point.margins_percent),
                    "met" if point.met else "not met",
                ]
                for k, point in enumerate(self.front, 1)
            ),
        )
        counts = ([name, f"{count:,}"] for name, count in self.evaluations.items())
        add("search", "Evaluations", ["model", "designs"], counts)
        rounds = (
            [str(k), f"{r.evaluations:,}", f"{r.gap_percent:.3g}"]
            for k, r in enumerate(self.rounds, 1)
        )
        add("search", "Rounds", ["round", "designs by the model", "largest difference (%)"], rounds)
        return sections

    @property
    def decisive(self) -> list[Stated]:
        """Objectives and active requirements, each quantity once."""
        by_name = dict[str, Stated]()
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
