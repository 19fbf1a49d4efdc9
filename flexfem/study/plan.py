"""A study file: base stage, factors, sampling, and which model answers."""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from flexfem.analytic.model import DEFAULT_FORMULA
from flexfem.design import Label, Stage
from flexfem.errors import BadInput
from flexfem.layout.feasibility import load_feasible
from flexfem.provenance import Sourced, is_assumed
from flexfem.refusals import place_of, refusal, shown, suggestion
from flexfem.study.factors import Column, Factor, acting, columns_of, with_mean
from flexfem.study.figure import Figure
from flexfem.study.outputs import outputs_of
from flexfem.study.scheme import EXTENSIBLE, MOST, Drive, Sampling
from flexfem.tomlfile import read_toml, validate
from flexfem.verify.case import known_formula

RESERVED = ("design", "status", "reason")


_APPLIES = {  # keys that not every model takes
    "formula": ("analytic", "verify"),
    "mobility": ("analytic", "verify"),
    "links": ("analytic",),
    "resolution": ("fe", "verify"),
    "time_limit_s": ("fe", "verify"),
    "bands": ("verify",),
}


class Study(Sourced):
    """What a study file says; see cases/README.md for every key."""

    name: Label
    stage: Label
    model: Literal["analytic", "fe", "verify"]
    formula: Annotated[str, AfterValidator(known_formula)] = DEFAULT_FORMULA
    mobility: Literal[3, 6, 12, 21] | None = None
    links: bool = False
    resolution: int = Field(default=4, ge=4, le=64)
    bands: bool = True
    check: Literal["closed_form", "drawing"] | None = None
    time_limit: float = Field(default=60.0, gt=0, le=86_400, alias="time_limit_s")
    sampling: Sampling
    factor: tuple[Factor, ...] = Field(min_length=1, max_length=100)
    drive: Drive | None = None
    figure: tuple[Figure, ...] = Field(default=(), max_length=50)

    @model_validator(mode="after")
    def _keys_of_its_model(self) -> Study:
        for name, field in type(self).model_fields.items():
            key = field.alias or name
            if name in self.model_fields_set and self.model not in _APPLIES.get(key, (self.model,)):
                raise refusal(f'no {key} with model = "{self.model}"', key)
        if self.links and self.mobility != 21:
            raise refusal("mobility = 21 with it: elastic links go with all freedoms of the hinges", "links")
        if self.check == "closed_form" and self.model != "analytic":
            raise refusal("drawing: what is meshed is drawn first", "check")
        return self

    @model_validator(mode="after")
    def _factors_fit_the_sampling(self) -> Study:
        grid = self.sampling.method == "grid"
        for index, factor in enumerate(self.factor):
            if grid and factor.distribution is not None:
                raise refusal('values or a range with method = "grid"', "factor", index, "distribution")
            if grid and factor.kind == "range" and factor.points is None:
                raise refusal('points with method = "grid"', "factor", index)
            if not grid and factor.points is not None:
                raise refusal('no points but with method = "grid"', "factor", index, "points")
        if grid and self.count > MOST:
            raise refusal(f"a grid of at most {MOST} designs, not {self.count}", "factor")
        if self.sampling.base is not None and self.count > MOST:
            raise refusal(f"base * (factors + 2) of at most {MOST}, not {self.count}", "sampling", "base")
        return self

    @model_validator(mode="after")
    def _columns_differ(self) -> Study:
        names, set_by = set(RESERVED) | set(self.outputs), dict[str, int]()
        for index, factor in enumerate(self.factor):
            for column in columns_of([factor]):
                if column.name in names:
                    raise refusal(f"a column name of its own, not {shown(column.name)} again", "factor", index)
                names.add(column.name)
            for path in factor.paths:
                first = set_by.setdefault(path, index)
                if first != index:
                    raise refusal(f"each key set once, and factor[{first}] sets {path}", "factor", index)
        return self

    @model_validator(mode="after")
    def _figures_can_be_drawn(self) -> Study:
        factors = [column.name for column in columns_of(self.factor)]
        for index, figure in enumerate(self.figure):
            served = {"map": ("grid",), "sensitivity": ("saltelli",)}.get(figure.kind)
            if served and self.sampling.method not in served:
                raise refusal(f'method = "{served[0]}" for a {figure.kind}', "figure", index, "kind")
            if figure.kind == "distribution" and self.sampling.method == "grid":
                raise refusal("a random sample for a distribution, not a grid", "figure", index, "kind")
            for place, (column, output) in figure.columns.items():
                known = self.outputs if output else factors if figure.kind == "map" else (*factors, *self.outputs)
                if column not in known:
                    what = "an output of this study" if output else "a column of this study"
                    raise refusal(f"{what}{suggestion(column, known)}", "figure", index, *place)
        return self

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source, not those that only set up the computation."""
        return tuple(path for path in super().numbers if path != "time_limit_s")

    @property
    def count(self) -> int:
        """Number of designs."""
        columns = columns_of(self.factor)
        if self.sampling.method == "grid":
            return math.prod(column.factor.points or len(column.factor.values or ()) for column in columns)
        if self.sampling.base is not None:
            return self.sampling.base * (len(columns) + 2)
        return self.sampling.designs or 0

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return outputs_of(self.drive is not None, self.model == "verify", self.bands)

    @property
    def draws(self) -> bool:
        """Whether the bodies of every design are drawn, to see that none overlap."""
        return (self.check or ("closed_form" if self.model == "analytic" else "drawing")) == "drawing"


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its base stage read and found feasible, and its columns; `stem` names its results."""

    path: Path
    study: Study
    stage: Stage
    columns: tuple[Column, ...]
    stem: str

    @property
    def count(self) -> int:
        """Number of designs."""
        return self.study.count

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return self.study.outputs

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths, of the stage and of the study, whose provenance says that they are assumed."""
        own = (key for key, source in self.study.provenance.items() if is_assumed(source))
        return (*(f"stage: {key}" for key in self.stage.assumed), *(f"study: {key}" for key in own))

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Key paths of the numbers, of the stage and of the study, whose source is not stated."""
        stage = (f"stage: {key}" for key in self.stage.not_stated)
        return (*stage, *(f"study: {key}" for key in self.study.not_stated))

    @property
    def hash(self) -> str:
        """SHA-256 of all that answers depend on: no title, figure, provenance, path, nor how long one may take.

        How many designs there are counts only where it changes the first ones too.
        """
        unneeded = {"name", "stage", "factor", "figure", "provenance", "check", "time_limit"}
        content = self.study.model_dump(mode="json", exclude=unneeded)
        content |= {"stage": self.stage.hash, "draws": self.study.draws}
        if self.study.sampling.method in EXTENSIBLE:
            content["sampling"] = content["sampling"] | {"designs": None, "base": None}
        # a hinge with an override does not follow the factor of its like, though it may be as the others are
        content["override"] = sorted((o.chain, o.hinge, sorted(o.changes)) for o in self.stage.override)
        content["columns"] = [
            [name, keys, factor.model_dump(mode="json", exclude={"key", "keys", "label"})]
            for name, keys, factor in self.columns
        ]
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


def load_study(path: str | os.PathLike[str]) -> LoadedStudy:
    """Read a study file and its base stage.

    Raises
    ------
    BadInput
        As `tomlfile.validate`, or the base stage cannot be read or made; one line naming file, line and key.
    """
    study = validate(Study, path)
    try:
        stage = load_feasible(os.path.normpath(Path(path).parent / study.stage))
    except BadInput as error:
        line = read_toml(path).lines.line(("stage",))
        raise BadInput(f"{place_of(path, line)}: stage = {shown(study.stage)}: {error}") from None
    if study.model != "analytic" and stage.model == "corrected":
        line = read_toml(path).lines.line(("model",))
        raise BadInput(
            f'{place_of(path, line)}: model = {shown(study.model)} on a stage with model = "corrected", expected '
            '"analytic": the finite elements are plane'
        )
    columns: list[Column] = []
    for index, factor in enumerate(study.factor):
        try:
            columns += [acting(with_mean(column, stage), stage) for column in columns_of([factor])]
        except BadInput as error:
            line = read_toml(path).lines.line(("factor", index))
            raise BadInput(f"{place_of(path, line)}: factor[{index}].{error}") from None
    return LoadedStudy(Path(path), study, stage, tuple(columns), Path(path).stem)
