"""A file of claims: what each says, which numbers would bear it out, and the stages that it is judged over."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from flexfem.arrays import Array
from flexfem.files.json_schema import COUNT, Keywords, either, has, keywords, only, ruled, when, without
from flexfem.files.keypath import key_path
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import refusal, suggestion
from flexfem.files.toml import Label, Table, bad_key, validate
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.refused import BadInput
from flexfem.study.columns import FACTOR_RULES, WAYS, Column, Factor, acting, columns_of, unasked, with_mean
from flexfem.verdicts.measures import MEASURES
from flexfem.questions.case import CommandMrad, CommandUm

Side: TypeAlias = Literal["three", "six"]
SIDES: tuple[Side, ...] = ("three", "six")
MOST_DESIGNS = 10_000  # two stages each, 0.04 s a stage


def _known_measure(name: str) -> str:
    if name not in MEASURES:
        raise refusal(f"one of {', '.join(MEASURES)}{suggestion(name, tuple(MEASURES))}")
    return name


_LIMITED = either(has("low_percent"), has("high_percent"))
_RULES = (
    when(has("equals"), without("low_percent", "high_percent", "missing")),
    when(has("missing"), without("low_percent", "high_percent")),
    either(_LIMITED, has("equals"), has("missing")),
)


class Claim(Table):
    """One claim: what is measured and which numbers (per cent, or `equals`) bear it out; `missing` leaves it open."""

    model_config = ConfigDict(json_schema_extra=ruled(*_RULES))

    id: Label = Field(description="Its name, which no other claim has", examples=["six-commanded"])
    statement: Label = Field(description="What is claimed, in your words", examples=["the error is about 10 %"])
    where: Label = Field(description="Where it stands", examples=["Section V"])
    measure: Annotated[str, AfterValidator(_known_measure), Keywords(lambda: {"enum": list(MEASURES)})] = Field(
        description="The measurement that decides"
    )
    reading: Label | None = Field(
        default=None,
        description="How the statement is read, where it can be read in several ways",
        examples=["all commands"],
    )
    low_percent: float | None = Field(default=None, description="The least that bears it out", examples=[8.0])
    high_percent: float | None = Field(default=None, description="The most that bears it out", examples=[12.0])
    equals: tuple[Annotated[float, keywords(**COUNT)], ...] | None = Field(
        default=None, min_length=1, description="Instead of limits: the numbers that bear it out", examples=[[3.0, 6.0]]
    )
    missing: Label | None = Field(
        default=None,
        description="Instead of limits: what is missing to decide, so that it stays open",
        examples=["Table II"],
    )

    @model_validator(mode="after")
    def _one_expectation(self) -> Claim:
        limits = self.low_percent is not None or self.high_percent is not None
        if limits + (self.equals is not None) + (self.missing is not None) != 1:
            raise refusal("either low_percent and high_percent (or one of them), or equals, or missing", "id")
        if self.low_percent is not None and self.high_percent is not None and self.low_percent > self.high_percent:
            raise refusal("at most high_percent", "low_percent")
        return self

    def holds(self, values: Array, slack: float = 0.0) -> NDArray[np.bool_]:
        """Whether the measured values (n, k) of n stages are all as expected, each limit moved outwards by `slack`."""
        if self.equals is not None:
            if values.shape[-1] != len(self.equals):
                return np.zeros(len(values), dtype=bool)
            return np.asarray(np.all(np.abs(values - np.array(self.equals)) <= max(slack, 0.0), axis=-1))
        low = -np.inf if self.low_percent is None else self.low_percent - slack
        high = np.inf if self.high_percent is None else self.high_percent + slack
        return np.asarray(np.all((values >= low) & (values <= high), axis=-1))


class StagePair(Table):
    """The paper's two stages, as files relative to the file of claims."""

    three: Label = Field(description="File of the stage of mobility three", examples=["mobility3.toml"])
    six: Label = Field(description="File of the stage of mobility six", examples=["mobility6.toml"])


class EnsembleFactor(Factor):
    """A factor of one of the two stages, or of both, where it has one value for the two."""

    named: ClassVar[tuple[str, ...]] = (*Factor.named, "stage")

    stage: Side | None = Field(default=None, description="Of which stage it is a factor; by default of both alike")

    model_config = ConfigDict(
        json_schema_extra=ruled(*FACTOR_RULES, {"not": only(*Factor.named, "stage")}, without("points"))
    )

    @model_validator(mode="after")
    def _can_be_drawn(self) -> EnsembleFactor:
        if self.kind == "given":
            raise refusal(WAYS)
        if self.points is not None:
            raise refusal("no points: stages of an ensemble are drawn at random", "points")
        return self

    @property
    def sides(self) -> tuple[Side, ...]:
        """The stages that it is a factor of."""
        return SIDES if self.stage is None else (self.stage,)


class Ensemble(Table):
    """Plausible stages: `designs` pairs of them, drawn independently from a `seed`, the rest as in the stage files."""

    designs: int = Field(
        ge=1,
        le=MOST_DESIGNS,
        description="How many pairs are drawn, independently; those that cannot be made are left out and counted",
        examples=[200],
    )
    seed: int = Field(ge=0, lt=2**63, description="What they are drawn from", examples=[1])
    factor: tuple[EnsembleFactor, ...] = Field(
        min_length=1,
        max_length=100,
        description="A number that differs between pairs, as a factor of a study; the rest is as in the two stage "
        "files",
    )

    @model_validator(mode="after")
    def _keys_are_set_once(self) -> Ensemble:
        set_by: dict[tuple[str, str], int] = {}
        for index, factor in enumerate(self.factor):
            for key in [(side, path) for side in factor.sides for path in factor.paths]:
                first = set_by.setdefault(key, index)
                if first != index:
                    at = key_path(("ensemble", "factor", first))
                    raise refusal(f"each key of a stage set once, and {at} sets {key[1]} of it", "factor", index)
        return self


class Claims(Sourced):
    """A file of claims; the amplitudes are the workspace."""

    kind: ClassVar[str] = "claims file"

    name: Label = Field(description="Of the page of verdicts", examples=["Claims of the paper"])
    amplitude_um: CommandUm = Field(description="Largest command in x and y", examples=[50.0])
    amplitude_mrad: CommandMrad = Field(description="Largest command in theta", examples=[1.0])
    stages: StagePair = Field(description="The two stages, by files relative to this one")
    ensemble: Ensemble | None = Field(
        default=None,
        description="Plausible stages over which claims are judged. Without it verdicts are on the two stages alone, "
        "and say so",
    )
    claim: tuple[Claim, ...] = Field(
        min_length=1,
        max_length=100,
        description="What is claimed, the measurement that decides, and the numbers that bear it out",
    )

    @model_validator(mode="after")
    def _ids_differ(self) -> Claims:
        ids = [claim.id for claim in self.claim]
        for index, name in enumerate(ids):
            if name in ids[:index]:
                raise refusal("an id that no other claim has", "claim", index, "id")
        return self

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source: not those of claims, which say themselves `where` they stand."""
        return tuple(path for path in super().numbers if not path.startswith("claim["))

    @property
    def amplitude(self) -> Array:
        """Largest commands (3,), mm, mm, rad."""
        return 1e-3 * np.array([self.amplitude_um, self.amplitude_um, self.amplitude_mrad])


class Varying(NamedTuple):
    """A column of an ensemble: `column` of the stages `sides`; `said` is its name."""

    said: str
    sides: tuple[Side, ...]
    column: Column


class LoadedClaims(NamedTuple):
    """A file of claims with its stages, mobility three and six, and the columns of its ensemble."""

    claims: Claims
    three: Stage
    six: Stage
    path: Path
    columns: tuple[Varying, ...]


def load_claims(path: str | os.PathLike[str]) -> LoadedClaims:
    """Read a file of claims and its two stages. Raises BadInput."""
    claims = validate(Claims, path)
    three, six = (
        load_feasible(Path(os.path.normpath(Path(path).parent / file)))
        for file in (claims.stages.three, claims.stages.six)
    )
    found: list[Varying] = []
    for index, factor in enumerate(claims.ensemble.factor if claims.ensemble else ()):
        stages = [{"three": three, "six": six}[side] for side in factor.sides]
        try:
            for column in columns_of([factor]):
                (same, *others) = [acting(with_mean(column, stage), stage, unasked()) for stage in stages]
                if any(other.factor.mean != same.factor.mean for other in others):
                    raise BadInput(f"mean is missing, and the two stages differ in {column.name}")
                said = column.name + ("" if factor.stage is None else f" of stage {factor.stage}")
                found.append(Varying(said, factor.sides, same))
        except BadInput as error:
            at = ("ensemble", "factor", index)
            raise bad_key(path, at, f"{key_path(at)}.{error}") from None
    return LoadedClaims(claims, three, six, Path(path), tuple(found))
