"""Stiffness of a manufactured stage, from its nine measured neck thicknesses."""

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
PLAUSIBLE = (0.5, 2.0)  # measured neck / drawn neck; outside this range the unit or the hinge is probably wrong
LARGEST_DEVIATION = 0.2  # standard deviation / neck
HINGES = tuple(product(CHAINS, HINGE_NAMES))

Neck: TypeAlias = Annotated[float, *quantities.above_zero(quantities.NECK), *in_unit("um")]
Deviation: TypeAlias = Annotated[float, *quantities.from_zero(quantities.NECK), *in_unit("um")]


class MeasuredNeck(Table):
    """A measured neck thickness and the standard deviation of the measurement, mm."""

    chain: int = Field(ge=1, le=3, description="Chain of the hinge", examples=[2])
    hinge: HingeName = Field(description="Hinge of this chain")
    neck: Neck = Field(alias="neck_um", examples=[512.0])
    """Measured neck thickness; must be between half and twice the drawn one"""
    sd: Deviation = Field(default=0.0, alias="sd_um", examples=[3.0])
    """Standard deviation of the measurement, for all nine necks or for none; at most a fifth of the neck"""


class Necks(Sourced):
    """The nine measured necks of a stage, one entry per hinge."""

    kind: ClassVar[str] = "necks file"

    neck: tuple[MeasuredNeck, ...] = Field(json_schema_extra={"minItems": 9, "maxItems": 9})
    """A measured neck; one entry for each of the nine hinges"""

    @model_validator(mode="after")
    def _every_hinge_once(self) -> Necks:
        hinges = [(entry.chain, entry.hinge) for entry in self.neck]
        for index, hinge in enumerate(hinges):
            if hinge in hinges[:index]:
                raise refusal("each hinge once", "neck", index)
        missing = [f"{name} of chain {chain}" for chain, name in HINGES if (chain, name) not in hinges]
        if missing:
            raise refusal(f"nine hinges: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing", "neck")
        without = [index for index, entry in enumerate(self.neck) if "sd" not in entry.model_fields_set]
        if 0 < len(without) < len(self.neck):  # a missing deviation is not a deviation of zero
            raise refusal("sd_um of all nine necks or of none", "neck", without[0])
        return self

    def array(self, field: str) -> Array:
        """Return `neck` or `sd` of all hinges (3 chains, 3 hinges), mm."""
        values = {(entry.chain, entry.hinge): getattr(entry, field) for entry in self.neck}
        return np.array([values[hinge] for hinge in HINGES]).reshape(3, 3)


class AsBuilt(Result):
    """Stiffness of a stage with its nine measured necks, and its scatter due to the measurement uncertainty."""

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
    unanswered = Quantity("draws without a solution", shown=False)


def read_necks(path: str | os.PathLike[str], stage: Stage) -> Necks:
    """Read the nine necks of a stage: CSV with columns chain, hinge, neck_um and, if known, sd_um; or TOML, [[neck]].

    Raises BadInput with file and line, also for a neck that is not between half and twice the drawn one.
    """
    path, lines = checked_path(path), list[int]()
    if path.suffix.lower() == ".toml":
        necks = validate(Necks, path)
    else:
        necks, lines = _read_csv(path)
    um = MICROMETRE.factor
    for k, entry in enumerate(necks.neck):
        drawn, where = stage.hinge(entry.chain, entry.hinge).neck, f"neck.{entry.chain}.{entry.hinge}"
        low, high = (ratio * drawn for ratio in PLAUSIBLE)
        problem = ""
        if not low <= entry.neck <= high:
            expected = f"{um * low:g} to {um * high:g}, half to twice the drawn neck: is the unit right?"
            problem = f"{where}.neck_um = {um * entry.neck:g}, expected {expected}"
        elif entry.sd > LARGEST_DEVIATION * entry.neck:
            problem = f"{where}.sd_um = {um * entry.sd:g}, expected at most {LARGEST_DEVIATION:g} of the neck"
        if problem:
            raise BadInput(f"{place_of(path, lines[k])}: {problem}") if lines else bad_key(path, ("neck", k), problem)
    return necks


def _read_csv(path: Path) -> tuple[Necks, list[int]]:
    """Return the necks of a CSV file and the line numbers of its rows."""
    chain, hinge, neck, sd = (field.alias or name for name, field in MeasuredNeck.model_fields.items())
    rows = read_csv(path, (chain, hinge, neck), (sd,))
    data = {"neck": [{key: _number(cell) for key, cell in row.items() if cell} for row in rows.values()]}
    lines = list(rows)
    try:
        return Necks.model_validate(data), lines
    except ValidationError as error:
        first = problem_of(error.errors(include_url=False)[0], data)
        index = next((part for part in first.path if isinstance(part, int)), None)
        text = f"{first.path[-1]} is missing" if first.kind == "missing" else sentence(first, Necks, data)
        raise BadInput(one_line(f"{place_of(path, None if index is None else lines[index])}: {text}")) from None


def _number(cell: str) -> int | float | str:
    """Return a cell as a number if it is one, otherwise as text."""
    try:
        return int(cell) if cell.isdecimal() else float(cell)
    except ValueError:
        return cell


@question
def as_built(stage: Stage, necks: Path, *, analytic: Analytic = DEFAULT) -> AsBuilt:
    """Stiffness of a stage with its nine measured necks, and its scatter due to the measurement uncertainty.

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
    drawn, as_made = (analyse(*chosen._replace(stage=variant)) for variant in (chosen.stage, made))
    draws = _stiffness_of_draws(made, as_made, sd)
    solved = draws[np.all(np.isfinite(draws), axis=1)]
    low, high = np.quantile(solved, QUANTILES, axis=0)
    accuracy = f"standard deviation of each neck at most {MICROMETRE.factor * np.max(sd):.3g} um; {DRAWS} draws"
    left_out = DRAWS - len(solved)
    notes = [accuracy if np.any(sd) else "no standard deviation is given: the scatter is not known"]
    return AsBuilt(
        about(stage, files={"necks": measured}),
        {
            "stiffness": as_made.stiffness,
            "drawn": drawn.stiffness,
            "deviation": 100 * (np.diag(as_made.stiffness) / np.diag(drawn.stiffness) - 1),
            "spread": np.std(solved, axis=0, ddof=1),
            "low": low,
            "high": high,
            "necks": neck,
            "sd": sd,
            "unanswered": left_out,
        },
        settings={"analytic model": as_made.name},
        warnings=[*warnings, *warning.of_result(made, as_made)],
        notes=notes + ([f"{left_out} draws have no solution and are excluded"] if left_out else []),
    )


def _stiffness_of_draws(made: Stage, model: AnalyticResult, sd: Array) -> Array:
    """Return the stiffness diagonals (draws, 3) of stages with normally distributed necks; sd (3, 3), mm."""
    necks = lower(made).neck + sd * np.random.default_rng(SEED).normal(size=(DRAWS, 3, 3))
    links = body_compliance(made)[None] if model.links else None
    K = stiffness_with_necks(made, necks, model.formula, model.freedoms, links)
    return np.asarray(np.diagonal(K, axis1=1, axis2=2))
