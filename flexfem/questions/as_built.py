"""The stiffness of a stage as it was made, from its nine measured necks."""

from __future__ import annotations

import os
from itertools import product
from pathlib import Path
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from pydantic import Field, ValidationError, model_validator

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import AnalyticResult, analyse, stiffness_with_necks
from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import checked_path, one_line, place_of, problem_of, refusal, sentence
from flexfem.files.toml import Table, bad_key, read_csv, validate
from flexfem.mechanism.designs import lower
from flexfem.mechanism.dimensioned import in_unit
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import HingeName
from flexfem.questions import warnings as warning
from flexfem.questions.setup import DEFAULT, Analytic, about, question
from flexfem.refused import BadInput
from flexfem.results import EXACT, SOLVED, Quantity, Result
from flexfem.units import MICROMETRE

DRAWS, SEED = 4000, 2003
QUANTILES = (0.025, 0.975)
PLAUSIBLE = (0.5, 2.0)  # a measured neck over the drawn one; beyond it the unit or the hinge is more likely wrong
WIDEST = 0.2  # standard deviation over the neck
HINGES = tuple(product(CHAINS, HINGE_NAMES))

Neck: TypeAlias = Annotated[float, *quantities.above_zero(quantities.NECK), *in_unit("um")]
Deviation: TypeAlias = Annotated[float, *quantities.from_zero(quantities.NECK), *in_unit("um")]


class MeasuredNeck(Table):
    """One neck as measured, mm, and the standard deviation of that."""

    chain: int = Field(ge=1, le=3, description="The chain of the hinge", examples=[2])
    hinge: HingeName = Field(description="Which of its hinges")
    neck: Neck = Field(alias="neck_um", examples=[512.0])
    """As measured; half to twice the drawn one, or it is refused"""
    sd: Deviation = Field(default=0.0, alias="sd_um", examples=[3.0])
    """Standard deviation of the measurement, of all nine necks or of none; at most a fifth of the neck"""


class Necks(Sourced):
    """The nine measured necks of a stage, each once."""

    kind: ClassVar[str] = "necks file"

    neck: tuple[MeasuredNeck, ...] = Field(json_schema_extra={"minItems": 9, "maxItems": 9})
    """A neck as measured; each of the nine once"""

    @model_validator(mode="after")
    def _every_hinge_once(self) -> Necks:
        places = [(each.chain, each.hinge) for each in self.neck]
        for index, one in enumerate(places):
            if one in places[:index]:
                raise refusal("each hinge once", "neck", index)
        missing = [f"{name} of chain {chain}" for chain, name in HINGES if (chain, name) not in places]
        if missing:
            raise refusal(f"nine hinges: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing", "neck")
        without = [index for index, each in enumerate(self.neck) if "sd" not in each.model_fields_set]
        if 0 < len(without) < len(self.neck):  # none given is not one of zero
            raise refusal("sd_um of all nine necks or of none", "neck", without[0])
        return self

    def array(self, what: str) -> Array:
        """`neck` or `sd` of all hinges (3 chains, 3 hinges), mm."""
        found = {(each.chain, each.hinge): getattr(each, what) for each in self.neck}
        return np.array([found[hinge] for hinge in HINGES]).reshape(3, 3)


class AsBuilt(Result):
    """Stiffness of a stage with its nine measured necks, and its scatter by that of the measurement."""

    title = "stage as built"
    columns = ("component",)
    stiffness = Quantity("stiffness as built", "stiffness matrix", ("direction", "component"), EXACT, "matrix")
    drawn = Quantity("stiffness as drawn", "stiffness matrix", ("direction", "component"), EXACT, "matrix", shown=False)
    deviation = Quantity("deviation from the drawing", "percent", ("direction",))
    spread = Quantity("standard deviation", "stiffness", ("direction",), SOLVED)
    low = Quantity("95 % of stages from", "stiffness", ("direction",), SOLVED)
    high = Quantity("to", "stiffness", ("direction",), SOLVED)
    necks = Quantity("neck", "um", ("chain", "hinge"), shown=False)
    sd = Quantity("standard deviation of the neck", "um", ("chain", "hinge"), shown=False)
    unanswered = Quantity("draws without an answer", shown=False)


def read_necks(path: str | os.PathLike[str], stage: Stage) -> Necks:
    """Read the nine necks of a stage: CSV with columns chain, hinge, neck_um and, if known, sd_um; or TOML, [[neck]].

    Raises BadInput, naming file and line, also for a neck that is not half to twice the drawn one.
    """
    path, lines = checked_path(path), list[int]()
    if path.suffix.lower() == ".toml":
        necks = validate(Necks, path)
    else:
        necks, lines = _of_table(path)
    for k, one in enumerate(necks.neck):
        drawn, um, where = stage.hinge(one.chain, one.hinge).neck, MICROMETRE.factor, f"neck.{one.chain}.{one.hinge}"
        low, high = (share * drawn for share in PLAUSIBLE)
        wrong = ""
        if not low <= one.neck <= high:
            expected = f"{um * low:g} to {um * high:g}, half to twice the drawn neck: is the unit right?"
            wrong = f"{where}.neck_um = {um * one.neck:g}, expected {expected}"
        elif one.sd > WIDEST * one.neck:
            wrong = f"{where}.sd_um = {um * one.sd:g}, expected at most {WIDEST:g} of the neck"
        if wrong:
            raise BadInput(f"{place_of(path, lines[k])}: {wrong}") if lines else bad_key(path, ("neck", k), wrong)
    return necks


def _of_table(path: Path) -> tuple[Necks, list[int]]:
    """The necks of a CSV file, and their lines."""
    chain, hinge, neck, sd = (each.alias or name for name, each in MeasuredNeck.model_fields.items())
    rows = read_csv(path, (chain, hinge, neck), (sd,))
    data = {"neck": [{key: _value(cell) for key, cell in row.items() if cell} for row in rows.values()]}
    lines = list(rows)
    try:
        return Necks.model_validate(data), lines
    except ValidationError as error:
        first = problem_of(error.errors(include_url=False)[0], data)
        at = [part for part in first.path if isinstance(part, int)]
        said = f"{first.path[-1]} is missing" if first.kind == "missing" else sentence(first, Necks, data)
        raise BadInput(one_line(f"{place_of(path, lines[at[0]] if at else None)}: {said}")) from None


def _value(cell: str) -> int | float | str:
    """A cell as a number where it is one."""
    try:
        return int(cell) if cell.isdecimal() else float(cell)
    except ValueError:
        return cell


@question
def as_built(stage: Stage, necks: Path, *, analytic: Analytic = DEFAULT) -> AsBuilt:
    """Stiffness of a stage with its nine measured necks, and its scatter by that of the measurement.

    Parameters
    ----------
    necks : path
        CSV file with columns chain, hinge, neck_um and, if known, sd_um; or TOML with these in [[neck]].
    {shared}
    """
    check_feasible(stage)
    warnings, measured = list[str](), read_necks(necks, stage)
    chosen = analytic.chosen(stage, warnings)
    neck, sd = measured.array("neck"), measured.array("sd")
    changes = {hinge: {"neck": value} for hinge, value in zip(HINGES, neck.ravel().tolist(), strict=True)}
    made = chosen.stage.replace(override=changes)
    drawn, found = (analyse(*chosen._replace(stage=each)) for each in (chosen.stage, made))
    scattered = _scattered(made, found, sd)
    answered = scattered[np.all(np.isfinite(scattered), axis=1)]
    low, high = np.quantile(answered, QUANTILES, axis=0)
    known = f"each known to {MICROMETRE.factor * np.max(sd):.3g} um (standard deviation) or better; {DRAWS} draws"
    left_out = DRAWS - len(answered)
    notes = [known if np.any(sd) else "no standard deviation is given: no scatter is known"]
    return AsBuilt(
        about(stage, files={"necks": measured}),
        {
            "stiffness": found.stiffness,
            "drawn": drawn.stiffness,
            "deviation": 100 * (np.diag(found.stiffness) / np.diag(drawn.stiffness) - 1),
            "spread": np.std(answered, axis=0, ddof=1),
            "low": low,
            "high": high,
            "necks": neck,
            "sd": sd,
            "unanswered": left_out,
        },
        settings={"analytic model": found.name},
        warnings=[*warnings, *warning.of_result(made, found)],
        notes=notes + ([f"{left_out} draws have no answer and are left out"] if left_out else []),
    )


def _scattered(made: Stage, of: AnalyticResult, sd: Array) -> Array:
    """Diagonals (draws, 3) of the stiffness of stages whose necks are normally scattered."""
    necks = lower(made).neck + sd * np.random.default_rng(SEED).normal(size=(DRAWS, 3, 3))
    links = body_compliance(made)[None] if of.links else None
    K = stiffness_with_necks(made, necks, of.formula, of.freedoms, links)
    return np.asarray(np.diagonal(K, axis1=1, axis2=2))
