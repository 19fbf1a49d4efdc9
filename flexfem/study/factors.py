"""Factors of a study, each a list, a range or a distribution, and their columns."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

from pydantic import Field, model_validator

from flexfem.files.quantities import AnyNumber, AnyPositive
from flexfem.files.refusals import refusal, shown
from flexfem.files.tables import Keywords, Label, Table
from flexfem.mechanism.keys import key_suggestion, keys, matching_keys

MANY = 100_000  # most values or points of one factor
MANY_KEYS = 100  # most keys of one factor
Kind: TypeAlias = Literal["given", "values", "range", "normal", "uniform"]
# required and optional keys
_KEYS_OF: dict[Kind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "given": ((), ()),
    "values": (("values",), ()),
    "range": (("from", "to"), ("scale", "points")),
    "normal": (("distribution", "sd"), ("mean", "lower", "upper")),
    "uniform": (("distribution", "lower", "upper"), ()),
}
WAYS = "values, or from and to, or a distribution"
NAMED = ("key", "keys", "label")  # keys that name a factor of any kind


def _matching(pattern: str) -> Keywords:
    """Return the schema of the known key paths, and of a pattern for those with actuator names of
    the stage file.
    """
    return Keywords(lambda: {"anyOf": [{"enum": list(keys())}, {"pattern": pattern}]})


KeyName: TypeAlias = Annotated[Label, _matching(r"^((override\.\d\.)?actuator|parameters)\.")]
KeyPattern: TypeAlias = Annotated[
    Label, _matching(r"^((override\.[\d*]\.)?actuator|parameters)\.|\*")
]


class Factor(Table):
    """One factor: a list, a range (`from` to `to`) or a distribution; without any of these, a
    column of your own table.

    All numbers are in the units of the stage file.
    """

    named: ClassVar[tuple[str, ...]] = NAMED

    key: KeyPattern | None = Field(default=None, examples=["hinges.base.radius_mm"])
    """Key path of a number of the stage file. `override.2.elbow.neck_mm` is that of one hinge, here
    in chain 2, even where the stage file has no such override. A star stands for several
    independent factors: `override.*.*.neck_mm`. A hinge with its own override in the stage file
    does not follow `hinges.elbow.neck_mm` """
    keys: tuple[KeyName, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=MANY_KEYS,
        examples=[["hinges.base.neck_mm", "hinges.elbow.neck_mm"]],
    )
    """Instead of `key`: several keys that take the same value"""
    label: Label | None = Field(default=None, examples=["neck of the base hinge"])
    """Name of the column, by default the key"""
    values: tuple[AnyNumber, ...] | None = Field(
        default=None, min_length=1, max_length=MANY, examples=[[0.3, 0.5, 0.8]]
    )
    """List of values: the points of a grid, otherwise equally likely"""
    start: AnyNumber | None = Field(
        default=None,
        alias="from",
        examples=[0.3],
    )
    """Start of a range, with `to`"""
    end: AnyNumber | None = Field(
        default=None,
        alias="to",
        examples=[1.0],
    )
    """End of the range"""
    scale: Literal["linear", "log"] = "linear"
    """Scale on which the range is uniform"""
    points: int | None = Field(
        default=None,
        ge=2,
        le=MANY,
        examples=[5],
    )
    """Number of points of a range, in a grid only"""
    distribution: Literal["normal", "uniform"] | None = None
    """`normal` with `sd`, `mean` and, to truncate it, `design_arrays`, `upper`; `uniform` with
    `design_arrays`, `upper`. The values of a list or range must be within the limits of the key; a
    distribution may exceed them, and a design outside is `refused` with its reason """
    mean: AnyNumber | None = Field(default=None, examples=[0.5])
    """Mean of a normal distribution, by default the value of the base stage"""
    sd: AnyPositive | None = Field(default=None, examples=[0.005])
    """Standard deviation"""
    lower: AnyNumber | None = Field(default=None, examples=[0.48])
    """Lower bound of a distribution"""
    upper: AnyNumber | None = Field(default=None, examples=[0.52])
    """Upper bound of a distribution"""

    @model_validator(mode="after")
    def _names_keys(self) -> Factor:
        if (self.key is None) == (self.keys is None):
            raise refusal("either key or keys")
        if self.key is not None and "*" in self.key:
            if not matching_keys(self.key):
                raise refusal(
                    "stars for hinge names or chains: hinges.*.neck_mm, override.*.*.neck_mm", "key"
                )
            if self.label is not None:
                raise refusal("no label with a star: every factor is named by its own key", "label")
        elif self.key is not None:
            _check_key(self.key, "key")
        for index, key in enumerate(self.keys or ()):
            _check_key(key, "keys", index)
            if key in (self.keys or ())[:index]:
                raise refusal("each key once", "keys", index)
        return self

    @model_validator(mode="after")
    def _is_one_kind(self) -> Factor:
        required, optional = _KEYS_OF[self.kind]
        choice = f"distribution = {shown(self.kind)}" if self.distribution else f"the {self.kind}"
        require_keys(self, f"{choice} (a factor has {WAYS})", required, (*self.named, *optional))
        return self

    @model_validator(mode="after")
    def _ends_are_in_order(self) -> Factor:
        for low, high, name in ((self.start, self.end, "to"), (self.lower, self.upper, "upper")):
            if low is not None and high is not None and low >= high:
                raise refusal(f"> {low:g}, the lower end", name)
        if self.scale == "log" and self.start is not None and self.start <= 0:
            raise refusal("> 0 on a logarithmic scale", "from")
        return self

    @model_validator(mode="after")
    def _numbers_are_possible(self) -> Factor:
        values = self.values or ()
        if len(set(values)) < len(values):
            raise refusal("each value once", "values")
        for name, end in (("from", self.start), ("to", self.end)):
            if end is not None:
                self._require_possible(end, name)
        for index, value in enumerate(values):
            self._require_possible(value, "values", index)
        return self

    def _require_possible(self, value: float, *place: str | int) -> None:
        """Raise a refusal for a number outside the limits of a key."""
        for key in (keys()[path] for path in self.paths):
            expected = key.number.expected(value)
            if expected is not None:
                raise refusal(f"{expected} for {key.path}", *place)

    @property
    def kind(self) -> Kind:
        """Kind of the factor: given by a table, a list, a range, or the name of its distribution."""
        if self.distribution is not None:
            return self.distribution
        if self.values is not None:
            return "values"
        return "range" if self.model_fields_set - {*self.named} else "given"

    @property
    def paths(self) -> tuple[str, ...]:
        """All keys of the factor, stars expanded."""
        if self.keys is not None:
            return self.keys
        if self.key is not None and "*" in self.key:
            return matching_keys(self.key)
        return (self.key or "",)


def given_in(table: Table) -> list[str]:
    """Return the keys that a table of a file has."""
    return [
        field.alias or name
        for name, field in type(table).model_fields.items()
        if name in table.model_fields_set
    ]


def require_keys(
    table: Table, choice: str, required: tuple[str, ...], optional: tuple[str, ...]
) -> None:
    """Refuse a table without a key that a choice in it requires, or with a key that the choice does
    not use.
    """
    given = given_in(table)
    for name in required:
        if name not in given:
            raise refusal(f"{name} with {choice}")
    for name in given:
        if name not in (*required, *optional):
            raise refusal(f"no {name} with {choice}", name)


def _check_key(key: str, *at: str | int) -> None:
    if "*" in key:
        raise refusal("no star in keys: all of them take the same value", *at)
    if key not in keys():
        close = key_suggestion(key, keys()) or ", see flexfem schema stage"
        raise refusal(f"a number of the stage format{close}", *at)


class Column(NamedTuple):
    """One independent factor: the `name` of its column, the `keys` that take its value, and
    `factor` with its mean.
    """

    name: str
    keys: tuple[str, ...]
    factor: Factor


def columns_of(factors: Iterable[Factor]) -> tuple[Column, ...]:
    """Return the columns of factors in their order, stars expanded."""
    columns = list[Column]()
    for factor in factors:
        if factor.key is not None and "*" in factor.key:
            columns += [Column(path, (path,), factor) for path in factor.paths]
        else:
            name = factor.label or factor.key or " = ".join(factor.paths)
            columns.append(Column(name, factor.paths, factor))
    return tuple(columns)
