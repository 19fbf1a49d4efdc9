"""What the paper claims, and what comes out: every claim of a file measured, with a verdict and its numbers."""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from flexfem.files.provenance import Sourced, doubts
from flexfem.files.refusals import refusal, suggestion
from flexfem.files.toml import Table, validate
from flexfem.files.writing import markdown_table
from flexfem.stage.schema import Label, Stage, load_feasible
from flexfem.verify import warning
from flexfem.verify.alternatives import Alternative, alternatives, markdown_alternatives
from flexfem.verify.measures import MEASURES, Evidence, Measured, errors_of_model
from flexfem.verify.protocol import Solve, solve_stage
from flexfem.verify.result import Record, versions

Ruling: TypeAlias = Literal["holds", "does not hold", "cannot be decided"]


def _known_measure(name: str) -> str:
    if name not in MEASURES:
        raise refusal(f"one of {', '.join(MEASURES)}{suggestion(name, tuple(MEASURES))}")
    return name


class Claim(Table):
    """One claim: what is measured and which numbers (per cent, or `equals`) bear it out; `missing` leaves it open."""

    id: Label
    statement: Label
    where: Label
    measure: Annotated[str, AfterValidator(_known_measure)]
    reading: Label | None = None
    low_percent: float | None = None
    high_percent: float | None = None
    equals: tuple[float, ...] | None = Field(default=None, min_length=1)
    missing: Label | None = None

    @model_validator(mode="after")
    def _one_expectation(self) -> Claim:
        limits = self.low_percent is not None or self.high_percent is not None
        if limits + (self.equals is not None) + (self.missing is not None) != 1:
            raise refusal("either low_percent and high_percent (or one of them), or equals, or missing", "id")
        if self.low_percent is not None and self.high_percent is not None and self.low_percent > self.high_percent:
            raise refusal("at most high_percent", "low_percent")
        return self

    def answer(self, values: tuple[float, ...]) -> Ruling:
        """Verdict on measured values: all of them must be as expected."""
        if self.missing is not None:
            return "cannot be decided"
        if self.equals is not None:
            return "holds" if values == self.equals else "does not hold"
        low, high = self.low_percent, self.high_percent
        within = all((low is None or value >= low) and (high is None or value <= high) for value in values)
        return "holds" if within else "does not hold"


class StagePair(Table):
    """The paper's two stages, as files relative to the file of claims."""

    three: Label
    six: Label


class Claims(Sourced):
    """A file of claims; the amplitudes are the workspace."""

    kind: ClassVar[str] = "claims file"

    name: Label
    amplitude_um: float = Field(gt=0, le=1e6)
    amplitude_mrad: float = Field(gt=0, le=1e3)
    stages: StagePair
    claim: tuple[Claim, ...] = Field(min_length=1, max_length=100)

    @model_validator(mode="after")
    def _ids_differ(self) -> Claims:
        ids = [claim.id for claim in self.claim]
        for index, name in enumerate(ids):
            if name in ids[:index]:
                raise refusal("an id that no other claim has", "claim", index, "id")
        return self

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source: the workspace; a claim says itself `where` it stands."""
        return tuple(path for path in super().numbers if not path.startswith("claim["))


class Verdict(Record):
    """What became of a claim: `values` are what was held against the expectation, `found` says so in a sentence."""

    id: str
    statement: str
    where: str
    reading: str | None
    verdict: Ruling
    found: str
    values: list[float]
    missing: str | None


class ClaimsReport(Record):
    """Verdicts and alternatives of a file of claims; `assumed`, `not_stated` : key paths of what is not the paper's."""

    name: str
    file: str
    verdicts: list[Verdict]
    alternatives: list[Alternative]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]


def load_claims(path: str | os.PathLike[str]) -> tuple[Claims, Stage, Stage]:
    """Read a file of claims and its two stages, mobility three and six. Raises BadInput."""
    claims = validate(Claims, path)
    three, six = (
        load_feasible(Path(os.path.normpath(Path(path).parent / file)))
        for file in (claims.stages.three, claims.stages.six)
    )
    return claims, three, six


def measure_claims(path: str | os.PathLike[str], solve: Solve = solve_stage) -> list[Verdict]:
    """Measure every claim of a file, in its order. Raises BadInput, ComputationFailed."""
    return _measured(*load_claims(path), functools.cache(solve))


def report_claims(path: str | os.PathLike[str], solve: Solve = solve_stage) -> ClaimsReport:
    """Measure every claim of a file, and what else could explain those that do not come out.

    Raises BadInput, ComputationFailed.
    """
    claims, three, six = load_claims(path)
    solve = functools.cache(solve)
    found = doubts([("", three), ("", six), ("claims: ", claims)])
    return ClaimsReport(
        name=claims.name,
        file=str(path),
        verdicts=_measured(claims, three, six, solve),
        alternatives=alternatives(three, six, solve),
        assumed=found.assumed,
        not_stated=found.not_stated,
        warnings=[f"stage {side.name!r}: {text}" for side in (three, six) for text in warning.of_stage(side)],
        versions=versions(),
    )


def _measured(claims: Claims, three: Stage, six: Stage, solve: Solve) -> list[Verdict]:
    amplitude = 1e-3 * np.array([claims.amplitude_um, claims.amplitude_um, claims.amplitude_mrad])
    evidence = Evidence(errors_of_model(three, 3, solve), errors_of_model(six, 6, solve), amplitude)
    found = doubts([("", three), ("", six)])
    kinds = (("on assumed dimensions", found.assumed), ("on dimensions without a source", found.not_stated))
    on = " and ".join(what for what, keys in kinds if keys)
    return [_verdict(claim, MEASURES[claim.measure](evidence), on) for claim in claims.claim]


def _verdict(claim: Claim, finding: Measured, on: str) -> Verdict:
    found = finding.found + (f", {on}" if on and finding.dimensional else "")
    return Verdict(
        id=claim.id,
        statement=claim.statement,
        where=claim.where,
        reading=claim.reading,
        verdict=claim.answer(finding.values),
        found=found + (f"; missing: {claim.missing}" if claim.missing else ""),
        values=list(finding.values),
        missing=claim.missing,
    )


def markdown_claims(verdicts: list[Verdict]) -> str:
    """The verdicts as a Markdown table."""
    rows = []
    for each in verdicts:
        claimed = each.statement + (f" *Read as: {each.reading}.*" if each.reading else "")
        rows.append((claimed, each.where, f"**{each.verdict}**", each.found))
    return markdown_table(("claim", "where", "verdict", "found"), rows) + "\n"


def claims_page(report: ClaimsReport) -> str:
    """Verdicts and alternatives as a Markdown page."""
    kinds = (("assumed", report.assumed), ("without a source", report.not_stated))
    doubt = " and ".join(f"partly {what}" for what, keys in kinds if keys)
    opening = f"Dimensions and workspace are {doubt}.\n\n" if doubt else ""
    opening += "".join(f"Warning: {text}.\n\n" for text in report.warnings)
    return (
        f"# {report.name}\n\n{opening}{markdown_claims(report.verdicts)}\n"
        f"## What else could have produced the errors, in per cent\n\n{markdown_alternatives(report.alternatives)}"
    )
