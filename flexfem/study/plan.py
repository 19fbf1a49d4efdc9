"""What a study file says: base stage, factors, sampling, model, outputs, constraints and figures."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, reduce
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from flexfem.analytic.model import DEFAULT_FORMULA
from flexfem.arguments import FINEST, MOST_LAYERS
from flexfem.arrays import AnyArray, Array
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import COUNT, OF_THE_KEY, keywords
from flexfem.files.refusals import KeyPath, key_path, refusal, shown, suggestion
from flexfem.files.toml import Label, Table
from flexfem.mechanism.keys import LIFE_CONSTANTS, key_suggestion, keys
from flexfem.questions import warnings as warning
from flexfem.questions.case import ELASTIC, FORMULA, OF_MODEL, FormulaName, Mobility
from flexfem.study.columns import FEASIBLE, RESERVED, outputs_of
from flexfem.study.factors import WAYS, Column, Factor, columns_of, require_keys

LONGEST = 400  # characters, which also limits how deep operations stand one inside the other
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
    "min": lambda *each: reduce(np.minimum, each),
    "max": lambda *each: reduce(np.maximum, each),
}
_OPERATIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
_WORD = re.compile(
    rf"(?P<function>({'|'.join(_FUNCTIONS)})(?=\s*\())|`(?P<quoted>[^`]+)`"
    r"|(?<![\w.])(?P<name>[A-Za-z_]\w*(?:\.\w+|\[\d+\])*)|(?P<other>[^-+*/(),.\w\s])"
)
_ALLOWED = f"numbers, names (others in `backticks`), + - * / **, brackets, {', '.join(_FUNCTIONS)}"


def names_in(text: str) -> tuple[str, ...]:
    """Names that an expression uses, each once. Raises ValueError, saying what was expected, where it is none."""
    return _parsed(text)[1]


def value_of(text: str, values: Mapping[str, Array]) -> Array:
    """Value of an expression, in the shape of the named values; not finite where it has none."""
    tree, names = _parsed(text)
    with np.errstate(all="ignore"):
        known = {f"_{k}": np.asarray(values[name], np.float64) for k, name in enumerate(names)}
        return np.asarray(_value(tree, known), dtype=np.float64)


@lru_cache(maxsize=256)
def _parsed(text: str) -> tuple[ast.expr, tuple[str, ...]]:
    """The tree of an expression of arithmetic alone, and the names that stand in it as `_0`, `_1`."""
    if len(text) > LONGEST:
        raise ValueError(f"at most {LONGEST} characters, not {len(text)}")
    names = list[str]()

    def numbered(found: re.Match[str]) -> str:
        name = found["quoted"] or found["name"]
        if found["other"]:
            raise ValueError(_ALLOWED)
        if name and name not in names:
            names.append(name)
        return f" _{names.index(name)} " if name else found["function"]

    try:
        tree = ast.parse(" ".join(_WORD.sub(numbered, text).split()), mode="eval").body
        with np.errstate(all="ignore"):
            _value(tree, {f"_{k}": np.ones(1) for k in range(len(names))})
    except (SyntaxError, MemoryError, RecursionError, KeyError, TypeError, OverflowError):
        raise ValueError(_ALLOWED) from None
    if not names:
        raise ValueError("the name of a column or key, not numbers alone")
    return tree, tuple(names)


def _value(node: ast.expr, known: Mapping[str, Array]) -> Any:
    """Value of a tree; a number is one of numpy, of which no power takes for ever or raises."""
    match node:
        case ast.Constant(value=float() | int() as number):
            return np.float64(number)
        case ast.Name(id=name):
            return known[name]
        case ast.UnaryOp(op=sign, operand=inner):
            return _OPERATIONS[type(sign)](_value(inner, known))
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATIONS[type(sign)](_value(left, known), _value(right, known))
        case ast.Call(func=ast.Name(id=name), args=[_, *others] as given, keywords=[]) if bool(others) == (
            name in ("min", "max")
        ):
            return _FUNCTIONS[name](*(_value(each, known) for each in given))
    raise ValueError(_ALLOWED)


Method: TypeAlias = Literal["grid", "latin_hypercube", "sobol", "monte_carlo", "saltelli", "table"]
MOST = 10**9  # designs; a design and 100 columns are a kilobyte
MOST_HELD = 200_000  # designs of a Latin hypercube, which is held in memory as a whole
EXTENSIBLE: tuple[Method, ...] = ("sobol", "monte_carlo", "saltelli")  # more designs begin with the same ones
FigureKind: TypeAlias = Literal["map", "distribution", "sensitivity", "pareto"]
Better: TypeAlias = Literal["larger", "smaller"]
NAME = r"^[A-Za-z][A-Za-z0-9_]{0,59}$"
_KEYS_OF: dict[FigureKind, tuple[tuple[str, ...], tuple[str, ...]]] = {  # needed, possible
    "map": (("x", "y", "value"), ()),
    "distribution": (("values",), ()),
    "sensitivity": (("values",), ()),
    "pareto": (("x", "y"), ("x_better", "y_better", "drawn")),
}


_WANTED: dict[Method, tuple[str, ...]] = {  # keys that a method needs beside it; it takes no others
    "grid": (),
    "table": ("file",),
    "saltelli": ("base", "seed"),
    **dict.fromkeys(("latin_hypercube", "sobol", "monte_carlo"), ("designs", "seed")),
}


class Sampling(Table):
    """How designs are drawn: `designs` of them, or `base` * (factors + 2) for Saltelli's scheme, from a `seed`; or
    taken from a `file`."""

    method: Method = Field(examples=["sobol"])
    """`grid`, of which the last factor counts fastest; `latin_hypercube`; `sobol`; `monte_carlo`; `saltelli`, for
    sensitivity; or `table`, your own designs"""
    file: Label | None = Field(default=None, examples=["designs.csv"])
    """With `table`: your own designs, CSV (commas, points, at most 64 MiB) or Parquet (at most 2 GiB),
    beside the study file; one row a design, one column a factor, named by its label or key, in file units. Factors then
    have a key alone. An edited table is another study"""
    designs: int | None = Field(default=None, ge=1, le=MOST, examples=[256])
    """How many, drawn by their number wherever that is; of a `latin_hypercube`, held in memory, at most 200000. More
    designs of `sobol`, `monte_carlo` or `saltelli` begin with the same ones, and keep their parts. A grid has none"""
    base: int | None = Field(default=None, ge=2, le=MOST, examples=[64])
    """With `saltelli`, instead: a power of two; there are base × (factors + 2) designs"""
    seed: int | None = Field(default=None, ge=0, lt=2**63, examples=[1])
    """What designs are drawn from"""

    @model_validator(mode="after")
    def _keys_of_its_method(self) -> Sampling:
        require_keys(self, f'method = "{self.method}"', _WANTED[self.method], ("method",))
        if self.base is not None and self.base & (self.base - 1):
            raise refusal("a power of two", "base")
        if self.method == "latin_hypercube" and (self.designs or 0) > MOST_HELD:
            raise refusal(f'at most {MOST_HELD} with method = "{self.method}", which holds all in memory', "designs")
        return self


def _expression(text: str) -> str:
    try:
        names_in(text)
    except ValueError as error:
        raise refusal(str(error)) from None
    return text


Expression = Annotated[str, AfterValidator(_expression), keywords(minLength=1)]


class Output(Table):
    """A derived output: a column `name`, arithmetic on other columns and keys, shown with `label` and `unit`."""

    name: str = Field(pattern=NAME, examples=["kxx_over_ktt"])
    """Of its column"""
    expression: Expression = Field(examples=["kxx_n_per_mm / ktt_n_mm_per_rad"])
    """Arithmetic on columns and keys, with + - * / ** and brackets, abs, sqrt, exp, log, log10, min, max; names with
    blanks in backticks"""
    label: Label | None = Field(default=None, examples=["Kxx over Ktt"])
    """In figures"""
    unit: Label | None = Field(default=None, examples=["rad/mm²"])
    """In figures"""


def require_ends(table: Table, least: str, most: str) -> None:
    """Refuse a table without either of two ends, or with a greatest value below the least one."""
    low, high = getattr(table, least), getattr(table, most)
    if low is None and high is None:
        raise refusal(f"{least}, {most} or both")
    if low is not None and high is not None and low > high:
        raise refusal(f">= {low:g}, the least", most)


class Constraint(Table):
    """Ends between which an expression of columns and keys must lie for a design to count."""

    value: Expression = Field(examples=["hinges.base.neck_mm / hinges.base.radius_mm"])
    """An expression. Of factors and keys alone: a design beyond the ends is `refused` before anything is solved (not
    with `saltelli`). Of outputs: it is answered, `feasible` is false in the table, and fronts and maps leave it out and
    count it"""
    least: float | None = Field(default=None, examples=[0.05], json_schema_extra=OF_THE_KEY)
    """The lower end"""
    most: float | None = Field(default=None, examples=[0.2], json_schema_extra=OF_THE_KEY)
    """The upper end"""
    label: Label | None = Field(default=None, examples=["t/R of the base hinges"])
    """In messages"""

    @model_validator(mode="after")
    def _has_an_end(self) -> Constraint:
        require_ends(self, "least", "most")
        return self

    @property
    def said(self) -> str:
        """What it limits, in the words of the study."""
        return self.label or self.value

    @property
    def expected(self) -> str:
        """Between which ends, in words."""
        ends = (("at least", self.least), ("at most", self.most))
        return " and ".join(f"{word} {end:g}" for word, end in ends if end is not None)

    def broken(self, values: Array) -> AnyArray:
        """Which values (n,) are outside, those that are no finite number among them."""
        low = -np.inf if self.least is None else self.least
        high = np.inf if self.most is None else self.most
        return np.asarray(~(np.isfinite(values) & (values >= low) & (values <= high)))


class Correlation(Table):
    """Two factors, by their columns, and the rank correlation (Spearman's) that they are drawn with."""

    factors: tuple[Label, Label] = Field(
        examples=[["neck of base", "radius of base"]], json_schema_extra={"uniqueItems": True}
    )
    """Two columns"""
    coefficient: float = Field(gt=-1, lt=1, examples=[0.6], json_schema_extra=COUNT)
    """Their rank correlation (Spearman's)"""

    @model_validator(mode="after")
    def _of_two(self) -> Correlation:
        if self.factors[0] == self.factors[1]:
            raise refusal("another factor than the first", "factors", 1)
        return self


def normal_correlation(columns: list[str], given: tuple[Correlation, ...]) -> Array:
    """Correlation matrix of the normal deviates whose ranks are correlated as `given`; the others are independent.

    `r = 2 sin(pi rho / 6)` for a rank correlation: K. Pearson, On further methods of determining correlation (1907).
    """
    matrix = np.eye(len(columns))
    for each in given:
        one, other = (columns.index(name) for name in each.factors)
        matrix[one, other] = matrix[other, one] = 2.0 * np.sin(np.pi * each.coefficient / 6.0)
    return matrix


class Figure(Table):
    """One figure: a map of `value` over `x` and `y`, `values` as histograms or Sobol indices, or a Pareto front."""

    kind: FigureKind = Field(examples=["pareto"])
    """`map` of an output over two factors, in whose cells means over the other factors are; `distribution` and
    `sensitivity` of outputs, not of a grid; or `pareto`, the front of two columns"""
    title: Label | None = Field(default=None, examples=["Stiffness against range"])
    """Of the figure"""
    x: Label | None = Field(default=None, examples=["range_x_um"])
    """Column, of a map a factor"""
    y: Label | None = Field(default=None, examples=["kxx_n_per_mm"])
    """Another, of a map a factor"""
    value: Label | None = Field(default=None, examples=["kxx_n_per_mm"])
    """Of a map: the output"""
    values: tuple[Label, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=12,
        examples=[["kxx_n_per_mm", "range_x_um"]],
        json_schema_extra={"uniqueItems": True},
    )
    """Of a `distribution` or `sensitivity`: outputs"""
    x_better: Better = "larger"
    """Of a front: which `x` is wanted"""
    y_better: Better = "larger"
    """Of a front: which `y` is wanted"""
    drawn: int = Field(default=4, ge=1, le=12)
    """Of a front: how many designs are drawn beside it"""

    @model_validator(mode="after")
    def _keys_of_its_kind(self) -> Figure:
        needed, possible = _KEYS_OF[self.kind]
        require_keys(self, f'kind = "{self.kind}"', needed, ("kind", "title", *possible))
        if self.x is not None and self.x == self.y:
            raise refusal("another column than x", "y")
        if self.values is not None and len(set(self.values)) < len(self.values):
            raise refusal("no column twice", "values")
        return self

    @property
    def columns(self) -> dict[tuple[str | int, ...], tuple[str, bool]]:
        """Columns it shows by their key in the file, each with whether it must be an output (else a factor will do)."""
        found: dict[tuple[str | int, ...], tuple[str, bool]] = {}
        for name in ("x", "y", "value"):
            column = getattr(self, name)
            if column is not None:
                found[(name,)] = (column, name == "value")
        return found | {("values", index): (column, True) for index, column in enumerate(self.values or ())}


Amplitude: TypeAlias = Annotated[float, *quantities.either_sign(quantities.AMPLITUDE)]


class DriveQuestion(Table):
    """Which drive a study asks about: the base stage's own actuators, or a stroke that turns the base hinges alone."""

    actuators: bool = False
    """Not with `three_dimensional`: asks about the base stage's own `[[actuator]]` tables, outputs `drive_range_x_um`
    and `engaged_kxx_n_per_mm` and their like. Their numbers are then keys, too: `actuator.base.arm_mm`, and on one
    chain `override.2.actuator.base.preload_n` (a star for the chain); a number that the actuator does not state is
    none. The drive is part of such a study's identity. Contacts on straight links are placed for all designs at once;
    on a bent link, or by `point_mm`, every geometry is drawn, 6 ms each"""
    stroke_um: Annotated[float, *quantities.above_zero(quantities.COMMAND_UM)] | None = Field(
        default=None, examples=[17.4]
    )
    """Of a piezo: gives the travels, which count the base hinges alone and are no range of a drive"""
    lever_arm_mm: Annotated[float, *quantities.above_zero(quantities.LENGTH)] | None = Field(
        default=None, examples=[10.0]
    )
    """From the base hinge to where that piezo pushes link 1"""

    @model_validator(mode="after")
    def _asks_something(self) -> DriveQuestion:
        if (self.stroke_um is None) != (self.lever_arm_mm is None):
            missing = "stroke_um" if self.stroke_um is None else "lever_arm_mm"
            raise refusal(f"stroke_um and lever_arm_mm together: {missing} is missing")
        if self.stroke_um is None and not self.actuators:
            raise refusal("actuators = true, or stroke_um and lever_arm_mm")
        return self

    @property
    def rotation(self) -> float | None:
        """Largest rotation of a base hinge, rad; None where no stroke is given."""
        return 1e-3 * self.stroke_um / self.lever_arm_mm if self.stroke_um and self.lever_arm_mm else None


class Frequencies(Table):
    """Natural frequencies of the platform in the plane are asked for, with a payload on it or without."""

    payload_kg: Annotated[float, *quantities.from_zero(quantities.MASS)] = Field(default=0.0, examples=[0.2])
    """Mass on the platform at its centre"""
    payload_kg_mm2: Annotated[float, *quantities.from_zero(quantities.INERTIA)] = Field(default=0.0, examples=[40.0])
    """Its moment of inertia about that"""


class DriftTable(Table):
    """Pose by a change of temperature, and the largest by its gradients, are asked for; it has no keys."""


class LifeTable(Table):
    """Fatigue lives are asked for, at an amplitude of the pose about its mean, and the amplitude for a wanted life."""

    amplitude_x_um: Amplitude = Field(default=0.0, examples=[20.0])
    """Of the pose in x; one of the three or more"""
    amplitude_y_um: Amplitude = Field(default=0.0, examples=[20.0])
    """Of the pose in y"""
    amplitude_theta_mrad: Amplitude = Field(default=0.0, examples=[0.5])
    """Of the pose in theta"""
    ratio: float = Field(default=-1.0, ge=-1, le=0.99, json_schema_extra=COUNT)
    """Least over greatest displacement"""
    cycles: Annotated[float, *quantities.above_zero(quantities.CYCLES)] = Field(default=1e6, json_schema_extra=COUNT)
    """The wanted life"""
    notch_sensitivity: float = Field(default=1.0, ge=0, le=1, json_schema_extra=COUNT)
    """What of the stress concentration counts: 0 nothing, 1 all of it"""

    @model_validator(mode="after")
    def _moves(self) -> LifeTable:
        if not any(self.moved):
            raise refusal("amplitude_x_um, amplitude_y_um or amplitude_theta_mrad, other than zero")
        return self

    @property
    def amplitude(self) -> tuple[float, float, float]:
        """Amplitude of the pose, mm, mm, rad."""
        return 1e-3 * self.amplitude_x_um, 1e-3 * self.amplitude_y_um, 1e-3 * self.amplitude_theta_mrad

    @property
    def moved(self) -> tuple[bool, ...]:
        """Which directions the amplitude has."""
        return tuple(each != 0 for each in self.amplitude)


QUESTIONS = ("budget", "converge", "drift", "gravity", "large", "modes", "reach", "stiffness", "summary")  # of a stage
UNCORRELATED: dict[Method, str] = {
    "saltelli": "Sobol indices split the variance among independent factors",
    "grid": "a grid holds all pairs of values alike",
    "table": "its rows are taken as they are",
}
SINGULAR = 1e-9  # least eigenvalue of a correlation matrix, as of round-off
APPLIES = {  # keys that not every model takes
    "formula": ("analytic", "verify"),
    "mobility": ("analytic", "verify"),
    "links": ("analytic",),
    "resolution": ("fe", "verify", "three_dimensional"),
    "layers": ("three_dimensional",),
    "time_limit_s": ("fe", "verify", "three_dimensional"),
    "bands": ("verify",),
    "frequencies": ("analytic", "fe", "verify"),  # in the plane
    "life": ("analytic", "fe", "verify"),
    "drift": ("analytic", "fe", "verify"),
}


class Study(Sourced):
    """What a study file says."""

    kind: ClassVar[str] = "study file"

    name: Label = Field(examples=["Stiffness against range at yield"])
    """Title of figures"""
    stage: Label = Field(examples=["stage.toml"])
    """File of the base stage, relative to the study's"""
    model: Literal["analytic", "fe", "verify", "three_dimensional"] = Field(examples=["analytic"])
    """What answers: `analytic`; `fe`, finite elements in the stage's plane model; `three_dimensional`, of the stage
    extruded; `verify`, the error percentages of the one against the other"""
    formula: FormulaName = Field(default=DEFAULT_FORMULA, description=f"{FORMULA}; with `analytic` and `verify`")
    mobility: Mobility | None = Field(
        default=None, description=f"{OF_MODEL}; with `analytic` and `verify`", examples=[6]
    )
    links: bool = Field(default=False, description=f"{ELASTIC}, with `analytic`; one design after the other, slower")
    resolution: int = Field(default=4, ge=4, le=FINEST)
    """Triangles across every neck, with `fe`, `verify`, `three_dimensional`"""
    layers: int = Field(default=2, ge=1, le=MOST_LAYERS)
    """In half the thickness, with `three_dimensional`: 2 is 0.2 % off on the reference stages, 2 s a design with alike
    chains, 6 s with unlike ones; 3 is 0.1 % off, 4 s and 10 s"""
    bands: bool = True
    """Whether `verify` finds the mesh band of each percentage, from three meshes"""
    check: Literal["closed_form", "drawing"] | None = None
    """Whether every design is drawn to see that no bodies overlap; by default `closed_form` with `analytic`, and what
    is meshed is always drawn"""
    time_limit: Annotated[float, *quantities.above_zero(quantities.TIME)] = Field(default=60.0, alias="time_limit_s")
    """For one design of `fe`, `verify`, `three_dimensional` (meshing only); a worker that takes 10 s longer is killed
    and replaced. Counted from when the worker has loaded the design; time in which it, or the whole run, is stopped
    does not count"""
    sampling: Sampling
    """Which designs. At most 10^9 of them"""
    factor: tuple[Factor, ...] = Field(min_length=1, max_length=100)
    """What differs between designs; numbers in the unit of the key"""
    correlation: tuple[Correlation, ...] = Field(default=(), max_length=500)
    """Two factors that go together, by a Gaussian copula: every factor keeps its distribution. Not with `saltelli`
    (Sobol indices split the variance among independent factors), `grid` or `table`"""
    drive: DriveQuestion | None = None
    """Asks how far a drive goes"""
    frequencies: Frequencies | None = None
    """Asks for natural frequencies in the plane, with a payload or without; the table may be empty.
    `material.density_kg_m3` is then a key that factors can set. Every design is drawn, some 5 ms each. Not with
    `three_dimensional`"""
    life: LifeTable | None = None
    """Asks for fatigue lives at an amplitude of the pose. The material needs fatigue constants, which factors can then
    set. Not with `three_dimensional`"""
    drift: DriftTable | None = None
    """Asks for the drift with temperature; the table has no keys. The stage must state both coefficients of expansion,
    which factors can then set: `material.expansion_um_per_m_k`, `frame.expansion_um_per_m_k`. With `links` every pad is
    drawn, up to 0.15 s a design more. Not with `three_dimensional`"""
    ask: tuple[Label, ...] = Field(default=(), max_length=100, examples=[["drift.stress.uniform.analytic.1.base"]])
    """Other numbers by their paths in the JSON of a command, such as `drift.pose.uniform.analytic.x`: columns of these
    names, found for one design after the other by the study's model"""
    output: tuple[Output, ...] = Field(default=(), max_length=50)
    """A derived output, found from the answers when the table is collected"""
    constraint: tuple[Constraint, ...] = Field(default=(), max_length=50)
    """Ends for an expression, between which a design counts"""
    figure: tuple[Figure, ...] = Field(default=(), max_length=50)
    """What `flexfem study plot` draws"""

    @model_validator(mode="after")
    def _keys_of_its_model(self) -> Study:
        for name, field in type(self).model_fields.items():
            key = field.alias or name
            if name in self.model_fields_set and self.model not in APPLIES.get(key, (self.model,)):
                raise refusal(f'no {key} with model = "{self.model}"', key)
        if self.links and self.mobility != 21:
            raise refusal("mobility = 21 with it: elastic links go with all freedoms of the hinges", "links")
        if self.check == "closed_form" and self.model != "analytic":
            raise refusal("drawing: what is meshed is drawn first", "check")
        return self

    @field_validator("ask")
    @classmethod
    def _asks_questions(cls, paths: tuple[str, ...]) -> tuple[str, ...]:
        for index, path in enumerate(paths):
            name, _, number = path.partition(".")
            if name not in QUESTIONS or not number:
                raise refusal(f"question.quantity.labels with a question of {', '.join(QUESTIONS)}", "ask", index)
            if path in paths[:index]:
                raise refusal("a path that is not in the list before", "ask", index)
        return paths

    @model_validator(mode="after")
    def _drive_is_of_its_model(self) -> Study:
        if self.driven and self.model == "three_dimensional":
            expected = 'no actuators with model = "three_dimensional": a drive is solved in the plane'
            raise refusal(expected, "drive", "actuators")
        for index, factor in enumerate(self.factor):
            if not self.driven and any(keys()[path].of_drive for path in factor.paths):
                expected = "[drive] actuators = true with a number of an actuator: no other output depends on it"
                raise refusal(expected, "factor", index)
        return self

    @model_validator(mode="after")
    def _factors_are_as_sampled(self) -> Study:
        method = self.sampling.method
        grid, table = method == "grid", method == "table"
        for index, factor in enumerate(self.factor):
            if table != (factor.kind == "given"):
                raise refusal(f'{"no values" if table else WAYS} with method = "{method}"', "factor", index)
            if grid and factor.distribution is not None:
                raise refusal('values or a range with method = "grid"', "factor", index, "distribution")
            if grid and factor.kind == "range" and factor.points is None:
                raise refusal('points with method = "grid"', "factor", index)
            if not grid and factor.points is not None:
                raise refusal('no points but with method = "grid"', "factor", index, "points")
        if self.count > MOST:
            at = ("factor",) if grid else ("sampling", "base")
            raise refusal(f"{'a grid' if grid else 'base * (factors + 2)'} of at most {MOST}, not {self.count}", *at)
        return self

    @model_validator(mode="after")
    def _names_are_unlike(self) -> Study:
        """Two columns of one name, and a key that two factors set, are refused; expressions name what there is."""
        set_by = dict[str, int]()
        for index, factor in enumerate(self.factor):
            for path in factor.paths:
                first = set_by.setdefault(path, index)
                if first != index:
                    raise refusal(f"each key set once, and {key_path(('factor', first))} sets {path}", "factor", index)
        known = require_own_names("factor", self.factor, self.output, self.outputs, (*RESERVED, FEASIBLE))
        for index, constraint in enumerate(self.constraint):
            require_known(constraint.value, known, "constraint", index, "value")
            if self.sampling.method == "saltelli" and self.needs_no_answer(constraint.value):
                expected = 'an output in it with method = "saltelli": refused designs would make the factors dependent'
                raise refusal(expected, "constraint", index, "value")
        return self

    @model_validator(mode="after")
    def _correlations_are_possible(self) -> Study:
        factors = {column.name: column.factor for column in self.factor_columns}
        pairs, method = set[frozenset[str]](), self.sampling.method
        if self.correlation and method in UNCORRELATED:
            raise refusal(f'none with method = "{method}": {UNCORRELATED[method]}', "correlation")
        for index, each in enumerate(self.correlation):
            for place, name in enumerate(each.factors):
                at = ("correlation", index, "factors", place)
                if name not in factors:
                    raise refusal(f"a factor by its column{suggestion(name, factors)}", *at)
                if factors[name].kind == "values":
                    raise refusal("a range or distribution: ranks of a list have ties", *at)
            if frozenset(each.factors) in pairs:
                raise refusal("each pair once", "correlation", index, "factors")
            pairs.add(frozenset(each.factors))
        if np.linalg.eigvalsh(normal_correlation(list(factors), self.correlation)).min() < SINGULAR:
            raise refusal("coefficients that go together: no factors can be correlated like this", "correlation")
        return self

    @model_validator(mode="after")
    def _figures_show_columns(self) -> Study:
        factors = [column.name for column in self.factor_columns]
        outputs = [*self.outputs, *(output.name for output in self.output)]
        for index, figure in enumerate(self.figure):
            if figure.kind in ("distribution", "sensitivity") and self.sampling.method == "grid":
                raise refusal(f"a random sample for a {figure.kind}, not a grid", "figure", index, "kind")
            for place, (column, output) in figure.columns.items():
                known = outputs if output else factors if figure.kind == "map" else (*factors, *outputs)
                if column not in known:
                    what = "an output of this study" if output else "a column of this study"
                    raise refusal(f"{what}{suggestion(column, known)}", "figure", index, *place)
        return self

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source, not those that only set up the computation."""
        return tuple(path for path in super().numbers if path != "time_limit_s")

    @property
    def factor_columns(self) -> tuple[Column, ...]:
        """The columns of the factors, stars expanded."""
        return columns_of(self.factor)

    @property
    def count(self) -> int:
        """Number of designs."""
        if self.sampling.method == "grid":
            return math.prod(column.factor.points or len(column.factor.values or ()) for column in self.factor_columns)
        if self.sampling.base is not None:
            return self.sampling.base * (len(self.factor_columns) + 2)
        return self.sampling.designs or 0

    @property
    def rotation(self) -> float | None:
        """How far a base hinge may turn, rad; None without a drive."""
        return None if self.drive is None else self.drive.rotation

    @property
    def driven(self) -> bool:
        """Whether it asks about the actuators of the base stage."""
        return self.drive is not None and self.drive.actuators

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the output columns in the table of columns that it asks for."""
        asked = {
            "travel": self.rotation is not None,
            "drive": self.driven,
            "verify": self.model == "verify",
            "bands": self.model == "verify" and self.bands,
        }
        asked |= {name: getattr(self, name) is not None for name in ("frequencies", "life", "drift")}
        moved = (True, True, True) if self.life is None else self.life.moved
        return outputs_of(*(name for name, is_asked in asked.items() if is_asked), moved=moved)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order: of the table of columns, then numbers of questions."""
        return (*self.columns, *self.ask)

    @property
    def unused_keys(self) -> frozenset[str]:
        """Key paths of material and frame that none of its answers depends on."""
        asked = {"density": self.frequencies, "expansion": self.drift} | dict.fromkeys(LIFE_CONSTANTS, self.life)
        return frozenset(path for path, key in keys().items() if asked.get(key.attribute, self) is None)

    @property
    def stress_below(self) -> str:
        """By how much, at most, the highest neck stress is low by the mesh, in words; "" without one."""
        return "" if self.model == "analytic" else warning.stress_below(self.resolution)

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """Expressions by their key paths."""
        found: dict[KeyPath, str] = {("output", k, "expression"): each.expression for k, each in enumerate(self.output)}
        return found | {("constraint", k, "value"): each.value for k, each in enumerate(self.constraint)}

    def needs_no_answer(self, expression: str) -> bool:
        """Whether an expression needs no answer of the model: factors and keys alone."""
        return names_behind(names_in(expression), self.output).isdisjoint(self.outputs)

    @property
    def draws(self) -> bool:
        """Whether the bodies of every design are drawn, to see that none overlap."""
        return (self.check or ("closed_form" if self.model == "analytic" else "drawing")) == "drawing"


def names_behind(names: Iterable[str], outputs: Sequence[Output]) -> frozenset[str]:
    """Some names, and those that the derived outputs among them are made of, each after those that it uses."""
    found = set(names)
    for output in reversed(outputs):
        if output.name in found:
            found |= {*names_in(output.expression)}
    return frozenset(found)


def require_own_names(
    array: str, factors: Sequence[Factor], outputs: Sequence[Output], columns: Iterable[str], taken: Iterable[str]
) -> set[str]:
    """Names that expressions may use beside keys: `columns`, those of factors, and of derived outputs.

    Refuses, at its key path, a factor in an `array` or a derived output whose name is there before, `taken` or a key,
    and one whose expression names what is not there before it.
    """
    known, taken = set(columns), {*taken}

    def add(name: str, own: tuple[str, ...], *at: str | int) -> None:
        if name in known or name in taken or (name in keys() and name not in own):
            raise refusal(f"a name of its own, not {shown(name)} again", *at)
        known.add(name)

    for index, factor in enumerate(factors):
        for column in columns_of([factor]):
            add(column.name, column.keys, array, index)
    for index, output in enumerate(outputs):
        require_known(output.expression, known, "output", index, "expression")
        add(output.name, (), "output", index, "name")
    return known


def require_known(expression: str, known: Iterable[str], *at: str | int) -> None:
    """Refuse an expression, at a key path, with a name that is neither known nor a key of the stage file."""
    names = {*known, *keys()}
    for name in names_in(expression):
        if name not in names and name not in keys():  # those of actuators are not among the listed ones
            raise refusal(f"columns and keys by name, not {shown(name)}{key_suggestion(name, sorted(names))}", *at)
