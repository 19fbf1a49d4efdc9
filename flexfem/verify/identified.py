"""What measured slopes say of necks and fixture, as it is stored, and in a sentence."""

from __future__ import annotations

from typing import Literal, TypeAlias

from scipy.stats import chi2

from flexfem.units import MICROMETRE, Direction
from flexfem.verify.result import Matrix, OfStage, Record
from flexfem.verify.slope_fit import Estimate

Unknown: TypeAlias = Literal["pole", "springs"]
POOR = 0.01  # chance below which a fit is none


class Alone(Record):
    """The best fit with one cause alone: its numbers, chi square, and whether the data allow it at the confidence."""

    numbers: list[float]
    chi_square: float
    allowed: bool


class Region(Record):
    """Chi square above its least (offsets, compliances) over the neck offset, mm, and the fixture's first number."""

    offset: list[float]
    fixture: list[float]
    above: Matrix
    limit: float


class Identification(OfStage):
    """What `flexfem identify` answers; mm, N, rad.

    model : of the stage.   confidence : of the intervals, per cent.   unknown : the fixture's numbers, `pole`: by how
    much its pole is softer than described; `springs`: series compliances of translation and rotation, mm/N and
    rad/(N mm).   measured, sd, fitted : slopes by direction.   offset : of all nine necks, positive wider.
    dof : data beyond what the fit can set.   condition : of the sensitivities, None where they depend on each other.
    correlation : of offset and first number of the fixture, None likewise.   told_apart : whether the data tell both
    causes apart.
    """

    name: str
    source: str
    model: str
    confidence: float
    unknown: Unknown
    measured: dict[Direction, float]
    sd: dict[Direction, float]
    nominal: dict[Direction, float]
    fitted: dict[Direction, float]
    offset: Estimate
    fixture: dict[str, Estimate]
    stiffness: dict[Direction, float | None]
    chi_square: float
    dof: int
    condition: float | None
    correlation: float | None
    neither: Alone
    necks_alone: Alone
    fixture_alone: Alone
    told_apart: bool
    finding: str
    region: Region


def unexplained(chi_square: float, dof: int) -> bool:
    """Whether a fit is none: chance alone would hardly leave so much."""
    return dof > 0 and bool(chi2.sf(chi_square, dof) < POOR)


def finding(of: Identification) -> str:
    """What the data say, in a sentence or two."""
    um, offset = MICROMETRE.factor, of.necks_alone.numbers[0]
    necks = f"necks {abs(um * offset):.3g} {MICROMETRE.plain} {'wider' if offset > 0 else 'thinner'} than drawn"
    alone = of.neither.allowed, of.necks_alone.allowed, of.fixture_alone.allowed
    if unexplained(of.chi_square, of.dof):
        usual = f"where chance goes beyond {chi2.isf(POOR, of.dof):.3g} once in {1 / POOR:.0f}"
        return (
            f"Nothing of this explains the data: chi square {of.chi_square:.3g} at the best fit, {usual}. "
            "Look at the standard deviations, or for another cause."
        )
    nothing = " The data need neither: the stage as drawn on a rigid fixture agrees with them." if alone[0] else ""
    if not of.told_apart:
        more = {
            (True, True): f" {necks[0].upper()}{necks[1:]} alone and a soft fixture alone both agree with them.",
            (True, False): f" {necks[0].upper()}{necks[1:]} alone agree with them, a soft fixture alone does not.",
            (False, True): " A soft fixture alone agrees with them, no neck offset alone does.",
        }
        return "These data cannot tell them apart." + (nothing or more.get(alone[1:], ""))
    if alone[1]:
        return f"The necks explain the data: {necks}, and no soft fixture alone does."
    if alone[2]:
        return "A soft fixture explains the data, and no neck offset alone does."
    both = "Both are needed: neither a neck offset nor a soft fixture alone explains the data."
    return both + (" The pole as described is within its interval." if _as_described(of) else "")


def _as_described(of: Identification) -> bool:
    """Whether the interval of the pole holds the one that the set-up describes."""
    pole = of.fixture.get("pole")
    return pole is not None and (pole.low or 0.0) <= 1 and (pole.high is None or pole.high >= 1)
