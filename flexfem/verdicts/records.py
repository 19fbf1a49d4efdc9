"""What became of the claims of a file, as it is stored."""

from __future__ import annotations

from pydantic import Field

from flexfem.verdicts.shares import Dependence, Ruling, StageShare
from flexfem.verify.alternatives import Alternative
from flexfem.verify.result import Record


class Verdict(Record):
    """What became of a claim.

    found : what the two stages of the file say, in a sentence; `values` are what was held against the expectation.
    ensemble : what an ensemble of stages says; `shares` of it in which the claim holds, the paper's hinge formula
        first; `depends` on which number.   argument : why, whatever the dimensions.
    """

    id: str
    statement: str
    where: str
    reading: str | None
    verdict: Ruling
    found: str
    values: list[float]
    ensemble: str | None = None
    shares: list[StageShare] = Field(default_factory=list)
    depends: Dependence | None = None
    argument: str | None = None
    missing: str | None


class EnsembleRange(Record):
    """What a column of an ensemble was drawn from; ends between which the judged stages are, in the file's unit."""

    name: str
    least: float
    most: float


class EnsembleReport(Record):
    """The stages that claims were judged over.

    drawn : pairs; of these `infeasible` and `off_chart` are left out and `judged` are not.
    metal_off : largest difference of an error of the file's own stages by such metal from finite elements, percentage
        points; None where it has no metal of that kind.
    """

    drawn: int
    infeasible: int
    off_chart: int
    judged: int
    seed: int
    ranges: list[EnsembleRange]
    metal_off: float | None


class ClaimsReport(Record):
    """Verdicts and alternatives of a file of claims; `assumed`, `not_stated` : key paths of what is not the paper's."""

    name: str
    file: str
    verdicts: list[Verdict]
    ensemble: EnsembleReport | None = None
    alternatives: list[Alternative]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]
