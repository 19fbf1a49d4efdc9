"""Contents of a study file: base stage, factors, sampling, model, outputs, constraints and figures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AliasChoices, BaseModel, Field, field_validator, model_validator

from flexfem.arguments import FINEST, MOST_LAYERS
from flexfem.files import quantities
from flexfem.files.expressions import names_in
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import KeyPath, key_path, refusal, shown, suggestion
from flexfem.files.tables import KEPT, Label
from flexfem.hinges.choice import (
    DEFAULT_FORMULA,
    ELASTIC,
    FORMULA,
    OF_MODEL,
    FormulaName,
    Mobility,
)
from flexfem.mechanism.keys import LIFE_CONSTANTS, PARAMETERS, key_suggestion, keys
from flexfem.questions import warnings as warning
from flexfem.study.columns import FEASIBLE, RESERVED, outputs_of
from flexfem.study.factors import WAYS, Column, Factor, columns_of, given_in
from flexfem.study.tables import (
    MOST,
    Constraint,
    Correlation,
    DriftTable,
    DriveQuestion,
    Figure,
    Frequencies,
    LifeTable,
    Method,
    Output,
    Sampling,
    normal_correlation,
)

# a larger sample begins with the smaller one
EXTENSIBLE: tuple[Method, ...] = ("sobol", "monte_carlo", "saltelli")
# of a stage
QUESTIONS = (
    "budget",
    "converge",
    "drift",
    "gravity",
    "large",
    "modes",
    "reach",
    "stiffness",
    "summary",
)
# keys without an effect on a mechanism
OF_STAGE = (
    "formula",
    "paper_formula",
    "mobility",
    "links",
    "bands",
    "drive",
    "frequencies",
    "life",
    "drift",
    "tolerance",
)
UNCORRELATED: dict[Method, str] = {
    "saltelli": "Sobol indices split the variance among independent factors",
    "grid": "a grid contains all combinations of values",
    "table": "its rows are used unchanged",
}
BASE_KEYS = ("mechanism", "stage")  # of the file of the base; either one
BAND = ".band"  # after the path of a number: the column of the half-width of its band
SINGULAR = 1e-9  # eigenvalue of a correlation matrix, below which it is singular
# models of the keys that not every model takes
APPLIES = {
    "formula": ("analytic", "verify"),
    "mobility": ("analytic", "verify"),
    "links": ("analytic",),
    "resolution": ("fe", "verify", "three_dimensional", "both"),
    "thickness_resolution": ("three_dimensional",),
    "time_limit_s": ("fe", "verify", "three_dimensional", "both"),
    "bands": ("verify",),
    "frequencies": ("analytic", "fe", "verify"),  # in the plane
    "life": ("analytic", "fe", "verify"),
    "drift": ("analytic", "fe", "verify"),
}


class _Names:
    """Names of the columns of a study file, in their order; those of keys are known, too."""

    def __init__(self, outputs: Iterable[str]) -> None:
        self.known = set(outputs)
        self.reserved = {*RESERVED, FEASIBLE, *self.known}

    def add(self, name: str, own_keys: tuple[str, ...], *at: str | int) -> None:
        """Add a column. Raises a refusal for a name that another column or key has."""
        taken = name in self.known or name in self.reserved
        if taken or (name in keys() and name not in own_keys):
            raise refusal(f"a unique name, not {shown(name)} again", *at)
        self.known.add(name)

    def require_known(
        self,
        expression: str,
        place: KeyPath,
    ) -> None:
        """Raise a refusal for a name in an expression that no column or key has."""
        for name in names_in(expression):
            if name not in self.known and name not in keys():
                close = key_suggestion(name, sorted({*self.known, *keys()}))
                raise refusal(f"columns and keys by name, not {shown(name)}{close}", *place)


class Asked(Sourced):
    """Questions about designs of a base stage or mechanism: what study files and requirements files
    have in common.
    """

    array: ClassVar[str]  # the array of tables with the keys that differ between designs
    subject: ClassVar[str]

    name: Label = Field(examples=["Stiffness against range"])
    """Title of figures and, of a design, name of the designed stage"""
    mechanism: Label = Field(
        validation_alias=AliasChoices(*BASE_KEYS),
        examples=["mine.toml"],
    )
    """File of the base, relative to this file. It has the values of all numbers that do not vary.
    The key may also be `stage`. Keys of a mechanism are `parameters.NAME`, and its outputs are the
    numbers of `ask` """
    formula: FormulaName = Field(default=DEFAULT_FORMULA, description=FORMULA)
    mobility: Mobility | None = Field(
        default=None,
        description=OF_MODEL,
        examples=[6],
    )
    links: bool = Field(default=False, description=f"{ELASTIC}; slower, one design after the other")
    drive: DriveQuestion | None = None
    """Requests the range of a drive"""
    frequencies: Frequencies | None = None
    """Requests natural frequencies in the plane, with or without a payload; the table may be empty.
    Factors can then set `material.density_kg_m3`. Every design is drawn, some 10 ms each. Not with
    `three_dimensional` """
    life: LifeTable | None = None
    """Requests fatigue lives at an amplitude of the pose. The material needs fatigue constants,
    which factors can then set. Not with `three_dimensional` """
    drift: DriftTable | None = None
    """Requests the drift with temperature; the table has no keys. The stage must state both
    coefficients of expansion, which factors can then set: `material.expansion_um_per_m_k`,
    `frame.expansion_um_per_m_k`. With `links` every pad is drawn, which takes up to 0.15 s more a
    design. Not with `three_dimensional` """
    ask: tuple[Label, ...] = Field(
        default=(), max_length=100, examples=[["drift.stress.uniform.analytic.1.base"]]
    )
    """Other numbers by their paths in the JSON output of a command, such as
    `drift.pose.uniform.analytic.x`. Each is a column of that name, computed for one design after
    the other """
    output: tuple[Output, ...] = Field(default=(), max_length=50)
    """A derived output: a name for an expression"""

    @model_validator(mode="after")
    def _keys_fit_the_base(self) -> Self:
        for key in given_in(self) if self.on_mechanism else ():
            if key in OF_STAGE:
                raise refusal(
                    f"no {key} in a {self.subject} of a mechanism, whose numbers are those of ask",
                    key,
                )
        if self.on_mechanism and not self.ask:
            raise refusal(f"ask = [...]: the numbers that a {self.subject} of a mechanism computes")
        if not self.on_mechanism and any(path.startswith("drive.") for path in self.ask):
            raise refusal(f"a question of {', '.join(QUESTIONS)} about a stage", "ask")
        if self.links and self.mobility != 21:
            raise refusal(
                "mobility = 21 with it: elastic links need all freedoms of the hinges", "links"
            )
        for index, factor in enumerate(self.varied):
            if not self.driven and any(keys()[path].of_drive for path in factor.paths):
                expected = (
                    "[drive] actuators = true with a number of an actuator: no other output "
                    "depends on it"
                )
                raise refusal(expected, self.array, index)
        return self

    @field_validator("ask")
    @classmethod
    def _asks_questions(cls, paths: tuple[str, ...]) -> tuple[str, ...]:
        for index, path in enumerate(paths):
            name, _, number = path.partition(".")
            if name not in (*QUESTIONS, "drive") or not number:
                raise refusal(
                    f"question.quantity.labels with a question of {', '.join(QUESTIONS)}",
                    "ask",
                    index,
                )
            if path in paths[:index]:
                raise refusal("each path once", "ask", index)
        return paths

    @model_validator(mode="after")
    def _keys_are_set_once(self) -> Self:
        set_by = dict[str, int]()
        for index, factor in enumerate(self.varied):
            for path in factor.paths:
                first = set_by.setdefault(path, index)
                if first != index:
                    sets = f"each key set once, and {key_path((self.array, first))} sets {path}"
                    raise refusal(sets, self.array, index)
        return self

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        """Refuse columns of the same name, and unknown names in expressions."""
        names = _Names(self.known)
        for index, factor in enumerate(self.varied):
            for column in columns_of([factor]):
                names.add(column.name, column.keys, self.array, index)
        for place, expression in self.expressions.items():
            names.require_known(expression, place)
            if place[0] == "output":
                names.add(self.output[int(place[1])].name, (), *place[:2], "name")
        return self

    @property
    def varied(self) -> tuple[Factor, ...]:
        """The factors, or the free dimensions of a design."""
        factors: tuple[Factor, ...] = getattr(self, self.array)
        return factors

    @property
    def factor_columns(self) -> tuple[Column, ...]:
        """The columns of the factors, stars expanded."""
        return columns_of(self.varied)

    @property
    def on_mechanism(self) -> bool:
        """Whether factors set parameters of a mechanism file."""
        return any(
            keys()[path].table == PARAMETERS for factor in self.varied for path in factor.paths
        )

    @property
    def rotation(self) -> float | None:
        """Largest rotation of a base hinge, rad; None without a stroke."""
        drive = self.drive
        if drive is None or drive.stroke_um is None or drive.lever_arm_mm is None:
            return None
        return 1e-3 * drive.stroke_um / drive.lever_arm_mm

    @property
    def driven(self) -> bool:
        """Whether the actuators of the base stage drive the designs."""
        return self.drive is not None and self.drive.actuators

    @property
    def requested(self) -> list[str]:
        """Names of the optional groups of columns."""
        tables = [
            name for name in ("frequencies", "life", "drift") if getattr(self, name) is not None
        ]
        return [*tables, *["travel"] * (self.rotation is not None), *["drive"] * self.driven]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the requested output columns, without numbers of other questions."""
        moved = () if self.life is None else self.life.amplitude
        return () if self.on_mechanism else outputs_of(*self.requested, moved=moved)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all output columns in their order: `columns`, then the numbers of other
        questions.
        """
        return (*self.columns, *self.ask)

    @property
    def known(self) -> tuple[str, ...]:
        """Names, besides those of factors, derived outputs and keys, that expressions may use."""
        return self.outputs

    @property
    def unused_keys(self) -> frozenset[str]:
        """Key paths of material and frame on which no output depends."""
        used_by = {"density": self.frequencies, "expansion": self.drift} | dict.fromkeys(
            LIFE_CONSTANTS, self.life
        )
        return frozenset(
            path for path, key in keys().items() if used_by.get(key.attribute, self) is None
        )

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """Expressions by their key paths, derived outputs first."""
        return {
            ("output", k, "expression"): output.expression for k, output in enumerate(self.output)
        }

    def names_of(self, *expressions: str) -> frozenset[str]:
        """Return the names in expressions and in the derived outputs that these use."""
        return self.behind(name for text in expressions for name in names_in(text))

    def behind(self, names: Iterable[str]) -> frozenset[str]:
        """Return names of columns together with those on which the derived outputs among them
        depend.
        """
        expanded = set(names)
        for output in reversed(self.output):  # an output uses only those before it
            if output.name in expanded:
                expanded |= {*names_in(output.expression)}
        return frozenset(expanded)


class Study(Asked):
    """Contents of a study file."""

    kind: ClassVar[str] = "study file"
    array: ClassVar[str] = "factor"
    subject: ClassVar[str] = "study"

    model: Literal["analytic", "fe", "verify", "three_dimensional", "both"] = Field(
        examples=["analytic"]
    )
    """`analytic`; `fe`, finite elements in the plane model of the stage; `three_dimensional`,
    finite elements of the extruded stage; `verify`, the error percentages of `analytic` against
    `fe` for a stage; or `both`, the numbers of both models of a mechanism. `formula` and `mobility`
    are for `analytic` and `verify`, `links` for `analytic` """
    resolution: int = Field(
        default=4,
        ge=4,
        le=FINEST,
    )
    """Number of triangles across every neck, with `fe`, `verify`, `three_dimensional`, `both`"""
    layers: int = Field(
        default=2,
        ge=1,
        le=MOST_LAYERS,
        alias="thickness_resolution",
    )
    """Layers of elements in half the thickness, with `three_dimensional`. Two have an error of 0.2
    % on the reference stages and take 2 s a design with identical chains, 6 s with different ones;
    three 0.1 %, 4 s and 10 s """
    bands: bool = True
    """Whether `verify` also computes the mesh band of each percentage, from three meshes"""
    check: Literal["closed_form", "drawing"] | None = None
    """How designs are checked for overlapping bodies: `drawing` draws every design. By default
    `closed_form` with `analytic`; meshed designs are always drawn """
    time_limit: quantities.Seconds = Field(default=60.0, alias="time_limit_s")
    """Time for one design with `fe`, `verify`, `both` or `three_dimensional` (meshing only), from
    when the worker has loaded it, without time in which the worker or the whole run is suspended. A
    worker that takes 10 s longer is killed and replaced """
    sampling: Sampling
    """Which designs are computed, at most 10^9"""
    factor: tuple[Factor, ...] = Field(min_length=1, max_length=100)
    """A number that differs between designs, in the unit of its key"""
    correlation: tuple[Correlation, ...] = Field(default=(), max_length=500)
    """Rank correlation of two factors, by a Gaussian copula: every factor keeps its distribution.
    Not with `saltelli` (Sobol indices split the variance among independent factors), `grid` or
    `table` """
    constraint: tuple[Constraint, ...] = Field(default=(), max_length=50)
    """Limits of an expression for a feasible design"""
    figure: tuple[Figure, ...] = Field(default=(), max_length=50)
    """A figure of `flexfem study plot`"""

    @model_validator(mode="after")
    def _keys_fit_the_model(self) -> Study:
        for key in given_in(self):
            if self.model not in APPLIES.get(key, (self.model,)):
                raise refusal(f'no {key} with model = "{self.model}"', key)
        if self.on_mechanism and self.model == "verify":
            raise refusal(
                "analytic, fe, three_dimensional or both in a study of a mechanism", "model"
            )
        if not self.on_mechanism and self.model == "both":
            raise refusal(
                "analytic, fe, three_dimensional or verify in a study of a stage", "model"
            )
        if self.check == "closed_form" and self.model != "analytic":
            raise refusal("drawing: meshed designs are always drawn", "check")
        if self.driven and self.model == "three_dimensional":
            expected = (
                'no actuators with model = "three_dimensional": a drive is solved in the plane only'
            )
            raise refusal(expected, "drive", "actuators")
        return self

    @model_validator(mode="after")
    def _factors_fit_sampling(self) -> Study:
        method = self.sampling.method
        grid = method == "grid"
        table = method == "table"
        for index, factor in enumerate(self.factor):
            if table != (factor.kind == "given"):
                raise refusal(
                    f'{"no values" if table else WAYS} with method = "{method}"', "factor", index
                )
            if grid and factor.distribution is not None:
                raise refusal(
                    'values or a range with method = "grid"', "factor", index, "distribution"
                )
            if grid and factor.kind == "range" and factor.points is None:
                raise refusal('points with method = "grid"', "factor", index)
            if not grid and factor.points is not None:
                raise refusal('points with method = "grid" only', "factor", index, "points")
        if self.count > MOST:
            at = ("factor",) if grid else ("sampling", "base")
            raise refusal(
                f"{'a grid' if grid else 'base * (factors + 2)'} of at most {MOST}, not "
                f"{self.count}",
                *at,
            )
        return self

    @model_validator(mode="after")
    def _refusals_leave_factors_independent(self) -> Study:
        for index, constraint in enumerate(self.constraint):
            if self.sampling.method == "saltelli" and constraint in self.refusing:
                expected = 'an output in it with method = "saltelli": refused designs would make the factors dependent'  # noqa: E501
                raise refusal(expected, "constraint", index, "value")
        return self

    @model_validator(mode="after")
    def _correlations_are_possible(self) -> Study:
        factors = {column.name: column.factor for column in self.factor_columns}
        pairs = set[frozenset[str]]()
        method = self.sampling.method
        if self.correlation and method in UNCORRELATED:
            raise refusal(f'none with method = "{method}": {UNCORRELATED[method]}', "correlation")
        for index, correlation in enumerate(self.correlation):
            for place, name in enumerate(correlation.factors):
                at = ("correlation", index, "factors", place)
                if name not in factors:
                    raise refusal(f"the column of a factor{suggestion(name, factors)}", *at)
                if factors[name].kind == "values":
                    raise refusal("a range or distribution: ranks of a list have ties", *at)
            if frozenset(correlation.factors) in pairs:
                raise refusal("each pair once", "correlation", index, "factors")
            pairs.add(frozenset(correlation.factors))
        if np.linalg.eigvalsh(normal_correlation(list(factors), self.correlation)).min() < SINGULAR:
            raise refusal(
                "consistent coefficients: this correlation matrix is not positive definite",
                "correlation",
            )
        return self

    @model_validator(mode="after")
    def _figures_show_columns(self) -> Study:
        factors = [column.name for column in self.factor_columns]
        outputs = [*self.outputs, *(output.name for output in self.output)]
        for index, figure in enumerate(self.figure):
            if figure.kind in ("distribution", "sensitivity") and self.sampling.method == "grid":
                raise refusal(
                    f"a random sample for a {figure.kind}, not a grid", "figure", index, "kind"
                )
            for place, (column, is_output) in figure.columns.items():
                known = (*factors, *outputs)
                if is_output:
                    known = (*outputs,)
                elif figure.kind == "map":
                    known = (*factors,)
                if column not in known:
                    expected = "an output of this study" if is_output else "a column of this study"
                    raise refusal(f"{expected}{suggestion(column, known)}", "figure", index, *place)
        return self

    def model_copy(
        self,
        *,
        update: Mapping[str, Any] | None = None,
        deep: bool = False,
    ) -> Self:
        """Return a copy with values replaced by name, unchecked: another model ignores settings
        that do not apply.
        """
        copy = BaseModel.model_copy(self, update=update, deep=deep)
        copy.__dict__.pop(KEPT, None)
        return copy

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source, without settings of the computation."""
        return tuple(path for path in super().numbers if path != "time_limit_s")

    @property
    def count(self) -> int:
        """Number of designs."""
        if self.sampling.method == "grid":
            return math.prod(
                column.factor.points or len(column.factor.values or ())
                for column in self.factor_columns
            )
        if self.sampling.base is not None:
            return self.sampling.base * (len(self.factor_columns) + 2)
        return self.sampling.designs or 0

    @property
    def requested(self) -> list[str]:
        """Names of the optional groups of columns."""
        verified = self.model == "verify"
        return [*super().requested, *["verify"] * verified, *["bands"] * (verified and self.bands)]

    @property
    def banded(self) -> tuple[str, ...]:
        """The numbers of `ask` whose bands are columns too: those of a mechanism that finite
        elements compute.
        """
        return self.ask if self.on_mechanism and self.model != "analytic" else ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of all output columns in their order: those without bands, then the bands."""
        return (*super().outputs, *(f"{path}{BAND}" for path in self.banded))

    @property
    def stress_below(self) -> str:
        """Text on the largest mesh error of the highest neck stress; "" without a mesh."""
        return "" if self.model == "analytic" else warning.stress_below(self.resolution)

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """Expressions by their key paths, derived outputs first."""
        return super().expressions | {
            ("constraint", k, "value"): c.value for k, c in enumerate(self.constraint)
        }

    def uses_no_output(self, expression: str) -> bool:
        """Return whether an expression uses factors and keys only, and no output of the model."""
        return self.names_of(expression).isdisjoint(self.outputs)

    @property
    def refusing(self) -> list[Constraint]:
        """Constraints on factors and keys only, which refuse a design before it is solved."""
        return [
            constraint for constraint in self.constraint if self.uses_no_output(constraint.value)
        ]

    @property
    def draws(self) -> bool:
        """Whether the bodies of every design are drawn to check that they do not overlap."""
        return (
            self.check or ("closed_form" if self.model == "analytic" else "drawing")
        ) == "drawing"
