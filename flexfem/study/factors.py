"""The factors of a study, each a list, a range or a distribution, and the columns that they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

from pydantic import Field, model_validator

from flexfem.files import quantities
from flexfem.files.quantities import OF_THE_KEY, Keywords, keywords
from flexfem.files.refusals import refusal, shown
from flexfem.files.toml import Label, Table
from flexfem.mechanism.keys import key_suggestion, keys, matching_keys
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput

MANY = 100_000  # values of one factor; more are a range
MANY_KEYS = 100  # more than the format has
Kind: TypeAlias = Literal["given", "values", "range", "normal", "uniform"]
_KEYS_OF: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {  # needed, possible
    "given": ((), ()),
    "values": (("values",), ()),
    "range": (("from", "to"), ("scale", "points")),
    "normal": (("distribution", "sd"), ("mean", "lower", "upper")),
    "uniform": (("distribution", "lower", "upper"), ()),
}
WAYS = "a factor is values, or from and to, or a distribution"
NAMED = ("key", "keys", "label")  # what a factor is of, whatever its kind


def _key_schema(others: str) -> dict[str, Any]:
    """The key paths that there are, and those of a pattern: the names of actuators are those of the file."""
    return {"anyOf": [{"enum": list(keys())}, {"pattern": others}]}


Number: TypeAlias = Annotated[float, *quantities.either_sign(quantities.OF_ANY_KEY), keywords(**OF_THE_KEY)]
Step: TypeAlias = Annotated[float, *quantities.above_zero(quantities.OF_ANY_KEY), keywords(**OF_THE_KEY)]
KeyName: TypeAlias = Annotated[Label, Keywords(lambda: _key_schema(r"^(override\.\d\.)?actuator\."))]
KeyPattern: TypeAlias = Annotated[Label, Keywords(lambda: _key_schema(r"^(override\.[\d*]\.)?actuator\.|\*"))]


class Factor(Table):
    """One factor: a list, a range (`start` to `end`) or a distribution; with none of them a table of designs has it.

    All numbers are in the units of the stage file.
    """

    named: ClassVar[tuple[str, ...]] = NAMED

    key: KeyPattern | None = Field(default=None, examples=["hinges.base.radius_mm"])
    """A number of the stage file by its key path; of one of the nine hinges, whether or not the stage file overrides
    it, as `override.2.elbow.neck_mm`, chain 2. A star, `override.*.*.neck_mm`, stands for as many independent factors.
    A hinge with an override of its own in the stage file does not follow `hinges.elbow.neck_mm`"""
    keys: tuple[KeyName, ...] | None = Field(
        default=None, min_length=1, max_length=MANY_KEYS, examples=[["hinges.base.neck_mm", "hinges.elbow.neck_mm"]]
    )
    """Instead of `key`: several that take one value"""
    label: Label | None = Field(default=None, examples=["neck of the base hinge"])
    """Name of the column; by default the key"""
    values: tuple[Number, ...] | None = Field(default=None, min_length=1, max_length=MANY, examples=[[0.3, 0.5, 0.8]])
    """A list: the points of a grid, else equally likely"""
    start: Number | None = Field(default=None, alias="from", examples=[0.3])
    """With `to`: where a range begins"""
    end: Number | None = Field(default=None, alias="to", examples=[1.0])
    """Where the range ends"""
    scale: Literal["linear", "log"] = "linear"
    """On which the range is uniform"""
    points: int | None = Field(default=None, ge=2, le=MANY, examples=[5])
    """Of a range in a grid, and of nothing else: how many"""
    distribution: Literal["normal", "uniform"] | None = None
    """`normal` with `sd`, `mean` and, to truncate it, `lower`, `upper`; `uniform` with `lower`, `upper`. A list or
    range stays within the limits of its key; a distribution may leave them, and a design outside is a row `refused`
    with its reason"""
    mean: Number | None = Field(default=None, examples=[0.5])
    """By default the base stage's own value"""
    sd: Step | None = Field(default=None, examples=[0.005])
    """Standard deviation"""
    lower: Number | None = Field(default=None, examples=[0.48])
    """Least value of a distribution"""
    upper: Number | None = Field(default=None, examples=[0.52])
    """Greatest value of a distribution"""

    @model_validator(mode="after")
    def _names_keys(self) -> Factor:
        if (self.key is None) == (self.keys is None):
            raise refusal("either key or keys")
        if self.key is not None and "*" in self.key:
            if not matching_keys(self.key):
                raise refusal("stars for hinge names or chains: hinges.*.neck_mm, override.*.*.neck_mm", "key")
            if self.label is not None:
                raise refusal("no label with a star: every factor is named by its own key", "label")
        elif self.key is not None:
            _check_key(self.key, "key")
        for index, key in enumerate(self.keys or ()):
            _check_key(key, "keys", index)
            if key in (self.keys or ())[:index]:
                raise refusal("a key that is not in the list before", "keys", index)
        return self

    @model_validator(mode="after")
    def _is_one_kind(self) -> Factor:
        needed, possible = _KEYS_OF[self.kind]
        choice = f"distribution = {shown(self.kind)}" if self.distribution else f"the {self.kind}"
        require_keys(self, f"{choice} ({WAYS})", needed, (*self.named, *possible))
        return self

    @model_validator(mode="after")
    def _numbers_are_possible(self) -> Factor:
        for low, high, name in ((self.start, self.end, "to"), (self.lower, self.upper, "upper")):
            if low is not None and high is not None and low >= high:
                raise refusal(f"> {low:g}, where it begins", name)
        if self.scale == "log" and self.start is not None and self.start <= 0:
            raise refusal("> 0 on a logarithmic scale", "from")
        if self.values is not None and len(set(self.values)) < len(self.values):
            raise refusal("no value twice", "values")
        numbers: dict[tuple[str | int, ...], float | None] = {("from",): self.start, ("to",): self.end}
        numbers |= {("values", index): value for index, value in enumerate(self.values or ())}
        for place, value in numbers.items():
            for key in (keys()[path] for path in self.paths):
                expected = None if value is None else key.expected(value)
                if expected is not None:
                    raise refusal(f"{expected} for {key.path}", *place)
        return self

    @property
    def kind(self) -> Kind:
        """What it is: given by a table, a list, a range, or which distribution."""
        if self.distribution is not None:
            return self.distribution
        if self.values is not None:
            return "values"
        return "range" if self.model_fields_set - {*self.named} else "given"

    @property
    def paths(self) -> tuple[str, ...]:
        """All keys it names, stars expanded."""
        return self.keys or (matching_keys(self.key) if self.key and "*" in self.key else (self.key or "",))


def require_keys(table: Table, choice: str, needed: tuple[str, ...], possible: tuple[str, ...]) -> None:
    """Refuse a table without a key that a choice in it needs, or with one that it has no use for."""
    fields = type(table).model_fields
    given = [field.alias or name for name, field in fields.items() if name in table.model_fields_set]
    for name in needed:
        if name not in given:
            raise refusal(f"{name} with {choice}")
    for name in given:
        if name not in (*needed, *possible):
            raise refusal(f"no {name} with {choice}", name)


def _check_key(key: str, *at: str | int) -> None:
    if "*" in key:
        raise refusal("no star in keys: all of them take one value", *at)
    if key not in keys():
        raise refusal(f"a number of the stage format{key_suggestion(key, keys()) or ', see flexfem schema stage'}", *at)


class Column(NamedTuple):
    """One independent factor: `name` of its column, the `keys` that take its value, `factor` mean filled in."""

    name: str
    keys: tuple[str, ...]
    factor: Factor


def columns_of(factors: Iterable[Factor]) -> tuple[Column, ...]:
    """The columns of factors, stars expanded, in their order."""
    found = list[Column]()
    for factor in factors:
        if factor.key is not None and "*" in factor.key:
            found += [Column(path, (path,), factor) for path in factor.paths]
        else:
            found.append(Column(factor.label or factor.key or " = ".join(factor.paths), factor.paths, factor))
    return tuple(found)


def columns_on(stage: Stage, factor: Factor, unused_keys: frozenset[str]) -> Iterator[Column]:
    """The columns of a factor of a base stage, whose own value is the mean where a normal distribution gives none.

    unused_keys : key paths that no output depends on.   Raises BadInput: the stage has no value of its
    own, or one for each key; or nothing of it follows the keys.
    """
    for column in columns_of([factor]):
        named, found = ", ".join(column.keys), [keys()[path] for path in column.keys]
        if factor.kind == "normal" and factor.mean is None:
            own = {key.value_in(stage) for key in found}
            if len(own) != 1 or own == {None}:
                raise BadInput(f"mean is missing, and the stage has no one value of {named}")
            column = column._replace(factor=factor.model_copy(update={"mean": own.pop()}))
        for key in found:
            if key.of_drive and not key.places_in(stage):
                names = ", ".join(actuator.name for actuator in stage.actuator) or "it has none"
                expected = f"a number that an actuator of the stage ({names}) states and that no override replaces"
                raise BadInput(f"key = {key.path}, expected {expected}")
        if not any(key.places_in(stage) for key in found if key.path not in unused_keys):
            expected = "a number that answers depend on: overrides stand in its place, or nothing asked for needs it"
            raise BadInput(f"key = {named}, expected {expected}")
        yield column
