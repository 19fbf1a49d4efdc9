"""Stiffness of a manufactured stage or mechanism, from its measured neck thicknesses."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias, TypeVar

import numpy as np
from pydantic import Field, ValidationError, model_validator

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import AnalyticResult, analyse, stiffness_with_necks
from flexfem.analytic.plates import respond
from flexfem.arrays import Array, inverse
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import (
    SHOWN,
    checked_path,
    key_path,
    one_line,
    place_of,
    problem_of,
    refusal,
    sentence,
    shown,
    suggestion,
)
from flexfem.files.toml import Label, Table, bad_key, read_csv, validate
from flexfem.mechanism.designs import lower
from flexfem.mechanism.dimensioned import in_unit
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import check_layout
from flexfem.mechanism.plate_file import located
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import warnings as warning
from flexfem.questions.plates import ELASTIC, ELASTIC_READ, PART_RESOLUTION, ElasticParts, parts_in, parts_of
from flexfem.questions.setup import DEFAULT, Analytic, about, for_mechanisms, question
from flexfem.refused import BadInput
from flexfem.results import EXACT, SOLVED, About, Quantity, Result
from flexfem.units import MICROMETRE

DRAWS, LEAST_DRAWS, SEED = 4000, 400, 2003
WORK = 5e8  # draws of a mechanism times the third power of its hinges, at most: a minute
QUANTILES = (0.025, 0.975)
OF_LIMITS = 2.67  # standard error of these quantiles times the root of the draws: sqrt(p (1 - p)) / normal density
PLAUSIBLE = (0.5, 2.0)  # measured neck / drawn neck; outside this range the unit or the hinge is probably wrong
LARGEST_DEVIATION = 0.2  # standard deviation / neck
HINGES = tuple(product(CHAINS, HINGE_NAMES))
IN_MEMORY = 2**21  # numbers of the matrices of networks that are solved together
Kind = TypeVar("Kind", bound="AsBuilt")
HingePlace: TypeAlias = tuple[int | None, str]  # chain, none in a mechanism, and name of the hinge

Neck: TypeAlias = Annotated[float, *quantities.above_zero(quantities.NECK), *in_unit("um")]
Deviation: TypeAlias = Annotated[float, *quantities.from_zero(quantities.NECK), *in_unit("um")]


class MeasuredNeck(Table):
    """A measured neck thickness and the standard deviation of the measurement, mm."""

    chain: int | None = Field(default=None, ge=1, le=3, examples=[2])
    """Chain of a hinge of the nine-hinge stage; a hinge of a mechanism has none"""
    hinge: Label = Field(examples=["elbow"])
    """Hinge of this chain: base, elbow or platform; or a hinge of a mechanism, by its name in `flexfem check`"""
    neck: Neck = Field(alias="neck_um", examples=[512.0])
    """Measured neck thickness; must be between half and twice the drawn one"""
    sd: Deviation = Field(default=0.0, alias="sd_um", examples=[3.0])
    """Standard deviation of the measurement, for all necks or for none; at most a fifth of the neck"""

    @property
    def place(self) -> HingePlace:
        """Chain and name of the hinge."""
        return self.chain, self.hinge


class Necks(Sourced):
    """The measured necks of a stage or a mechanism, one entry per hinge."""

    kind: ClassVar[str] = "necks file"

    neck: tuple[MeasuredNeck, ...] = Field(min_length=1)
    """A measured neck; one entry for each of the nine hinges of a stage, or for any hinges of a mechanism"""

    @model_validator(mode="after")
    def _every_hinge_once(self) -> Necks:
        hinges = [entry.place for entry in self.neck]
        for index, hinge in enumerate(hinges):
            if hinge in hinges[:index]:
                raise refusal("each hinge once", "neck", index)
        without = [index for index, entry in enumerate(self.neck) if "sd" not in entry.model_fields_set]
        if 0 < len(without) < len(self.neck):  # a missing deviation is not a deviation of zero
            raise refusal("sd_um of all necks or of none", "neck", without[0])
        return self

    def over(self, drawn: Mapping[HingePlace, float]) -> tuple[Array, Array]:
        """Return necks and standard deviations (hinges,), mm; an unlisted hinge has the drawn neck, and deviation 0."""
        listed = {entry.place: entry for entry in self.neck}
        neck = [listed[place].neck if place in listed else value for place, value in drawn.items()]
        return np.array(neck), np.array([listed[place].sd if place in listed else 0.0 for place in drawn])


class AsBuilt(Result):
    """Stiffness of a stage with its measured necks, and its scatter due to the measurement uncertainty."""

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


class MechanismAsBuilt(AsBuilt):
    """Stiffness of a mechanism with its measured necks, and its scatter due to the measurement uncertainty."""

    title = "mechanism as built"
    low = Quantity("95 % of mechanisms from", "stiffness", ("direction",), SOLVED)
    necks = Quantity("neck", "um", ("hinge",), shown=False)
    sd = Quantity("standard deviation of the neck", "um", ("hinge",), shown=False)


def read_necks(path: str | os.PathLike[str], drawn: Mapping[HingePlace, float]) -> Necks:
    """Read measured necks: CSV with columns chain, of a stage, hinge, neck_um and, if known, sd_um; or TOML, [[neck]].

    drawn : necks of all hinges, mm; a stage needs a measured neck of each.

    Raises BadInput with file and line, also for a neck that is not between half and twice the drawn one.
    """
    path, lines, chained = checked_path(path), list[int](), any(chain is not None for chain, _ in drawn)
    if path.suffix.lower() == ".toml":
        necks = validate(Necks, path)
    else:
        necks, lines = _read_csv(path, chained)

    def refused(problem: str, *at: str | int) -> BadInput:
        index = next((part for part in at if isinstance(part, int)), None)
        text = f"{key_path(at, necks)}{problem}"
        return (
            BadInput(f"{place_of(path, None if index is None else lines[index])}: {text}")
            if lines
            else bad_key(path, at[:2], text)
        )

    for k, entry in enumerate(necks.neck):
        if chained != (entry.chain is not None):
            found = "" if entry.chain is None else f" = {entry.chain}"
            raise refused(
                f"{found}, expected 1, 2 or 3 for a hinge of a stage, none for one of a mechanism", "neck", k, "chain"
            )
        if entry.place not in drawn:
            names = dict.fromkeys(name for _, name in drawn)
            close = suggestion(entry.hinge, names) or f", one of {one_line(', '.join(names), SHOWN)}"
            raise refused(f" = {shown(entry.hinge)}, expected the name of a hinge{close}", "neck", k, "hinge")
        low, high = (MICROMETRE.factor * ratio * drawn[entry.place] for ratio in PLAUSIBLE)
        neck, sd = MICROMETRE.factor * entry.neck, MICROMETRE.factor * entry.sd
        if not low <= neck <= high:
            expected = f"{low:g} to {high:g}, half to twice the drawn neck: is the unit right?"
            raise refused(f" = {neck:g}, expected {expected}", "neck", k, "neck_um")
        if sd > LARGEST_DEVIATION * neck:
            raise refused(f" = {sd:g}, expected at most {LARGEST_DEVIATION:g} of the neck", "neck", k, "sd_um")
    places = {entry.place for entry in necks.neck}
    missing = [f"{name} of chain {chain}" for chain, name in drawn if chained and (chain, name) not in places]
    if missing:
        raise refused(
            f": expected nine hinges: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing", "neck"
        )
    return necks


def _read_csv(path: Path, chained: bool) -> tuple[Necks, list[int]]:
    """Return the necks of a CSV file and the line numbers of its rows; `chained`: with the column of the chain."""
    chain, hinge, neck, sd = (field.alias or name for name, field in MeasuredNeck.model_fields.items())
    rows = read_csv(path, (chain, hinge, neck)[not chained :], (sd,))
    data = {
        "neck": [
            {key: cell if key == hinge else _number(cell) for key, cell in row.items() if cell} for row in rows.values()
        ]
    }
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


def _answer(
    kind: type[Kind], subject: About, drawn: Array, made: Array, draws: Array, necks: tuple[Array, Array], **texts: Any
) -> Kind:
    """Return the result from stiffness (3, 3) as drawn and as made, and diagonals (draws, 3) with scattered necks."""
    (neck, sd), solved = necks, draws[np.all(np.isfinite(draws), axis=1)]
    low, high = np.quantile(solved, QUANTILES, axis=0)
    left_out, count = len(draws) - len(solved), len(solved)
    accuracy = (
        f"standard deviation of each neck at most {MICROMETRE.factor * np.max(sd):.3g} um; {len(draws)} draws: the "
        f"standard error of the standard deviation is {100 / np.sqrt(2 * count):.2g} % of it, that of each limit "
        f"{100 * OF_LIMITS / np.sqrt(count):.2g} % of it"
    )
    texts["notes"] = [
        *texts.get("notes", ()),
        accuracy if np.any(sd) else "no standard deviation is given: the scatter is not known",
    ]
    texts["notes"] += [f"{left_out} draws have no solution and are excluded"] * (left_out > 0)
    values = {
        "stiffness": made,
        "drawn": drawn,
        "deviation": 100 * (np.diag(made) / np.diag(drawn) - 1),
        "spread": np.std(solved, axis=0, ddof=1),
        "low": low,
        "high": high,
        "necks": neck,
        "sd": sd,
        "unanswered": left_out,
    }
    return kind(subject, values, **texts)


def _of_mechanism(mechanism: Mechanism, necks: Path) -> MechanismAsBuilt:
    """See `flexfem.as_built`."""
    layout = mechanism.layout
    drawn: dict[HingePlace, float] = {(None, joint.name): joint.profile.neck for joint in layout.joints}
    measured = read_necks(necks, drawn)
    neck, sd = measured.over(drawn)
    made = _with_necks(mechanism, neck)
    parts = parts_in(made, mesh_layout(made, PART_RESOLUTION))
    material = made.youngs_modulus, made.poissons_ratio, made.thickness

    def freedoms(added: Array) -> Array:
        """Return the beam integrals (..., hinges, 3) of hinges that are thicker by (..., hinges)."""
        found = [joint.profile.compliance(*material, added[..., h]) for h, joint in enumerate(made.joints)]
        return np.stack([np.diagonal(each, axis1=-2, axis2=-1) for each in found], axis=-2)

    unchanged = freedoms(np.zeros(len(neck)))

    def diagonals(added: Array) -> Array:
        """Return stiffness diagonals (draws, 3) with hinges that are thicker by (draws, hinges)."""
        change = np.sqrt(freedoms(added) / unchanged)
        changed = change[..., :, None] * parts.hinges * change[..., None, :]
        return np.diagonal(_stiffness(made, parts._replace(hinges=changed)), axis1=1, axis2=2)

    count = int(np.clip(WORK / len(neck) ** 3, LEAST_DRAWS, DRAWS)) if np.any(sd) else 2
    scatter = sd * np.random.default_rng(SEED).normal(size=(count, len(neck)))
    blocks = np.array_split(scatter, -(-9 * scatter.size * len(neck) // IN_MEMORY))
    unlisted = len(drawn) - len(measured.neck)
    notes = [
        ELASTIC_READ,
        "a hinge with a thicker neck is thicker by the same amount over its whole length; for the scatter, its "
        "compliance changes like its beam integrals",
        *[f"{unlisted} of {len(drawn)} hinges are not listed: they have the drawn neck, without deviation"]
        * (unlisted > 0),
    ]
    return _answer(
        MechanismAsBuilt,
        about(mechanism, files={"necks": measured}),
        _stiffness(layout, parts_of(mechanism)),
        _stiffness(made, parts),
        np.concatenate([diagonals(block) for block in blocks]),
        (neck, sd),
        axes={"hinge": [joint.name for joint in layout.joints]},
        settings={"analytic model": ELASTIC},
        notes=notes,
    )


def _stiffness(layout: Layout, parts: ElasticParts) -> Array:
    """Return the stiffness (..., 3, 3) of the output."""
    return inverse(respond(layout, parts.bodies, layout.ports[:3], parts.hinges).compliance)


def _with_necks(mechanism: Mechanism, necks: Array) -> Layout:
    """Return the layout with necks (hinges,), mm. Raises BadInput if its parts do not fit together."""
    layout, joints = mechanism.layout, list[Joint]()
    for joint, neck in zip(layout.joints, necks.tolist(), strict=True):
        profile = joint.profile.with_neck(neck)
        joints.append(joint._replace(profile=profile, cut=max(joint.cut, profile.end_height)))
    made = layout._replace(joints=tuple(joints))
    with located(mechanism):
        check_layout(made)
    return made


@for_mechanisms(_of_mechanism)
@question
def as_built(stage: Stage, necks: Path, *, analytic: Analytic = DEFAULT) -> AsBuilt:
    """Stiffness of a stage or mechanism with its measured necks, and its scatter due to the measurement uncertainty.

    Parameters
    ----------
    necks : path
        CSV file with columns chain, only for a stage, hinge, neck_um and, if known, sd_um; or TOML with these in
        [[neck]]. A stage needs all nine necks; an unlisted hinge of a mechanism has the drawn neck.
    {shared}
    """
    check_feasible(stage)
    warnings = list[str]()
    places: dict[HingePlace, float] = {(chain, name): stage.hinge(chain, name).neck for chain, name in HINGES}
    measured = read_necks(necks, places)
    chosen = analytic.chosen(stage, warnings)
    neck, sd = (each.reshape(3, 3) for each in measured.over(places))
    changes = {hinge: {"neck": value} for hinge, value in zip(HINGES, neck.ravel().tolist(), strict=True)}
    made = chosen.stage.replace(override=changes)
    drawn, as_made = (analyse(*chosen._replace(stage=variant)) for variant in (chosen.stage, made))
    return _answer(
        AsBuilt,
        about(stage, files={"necks": measured}),
        drawn.stiffness,
        as_made.stiffness,
        _stiffness_of_draws(made, as_made, sd),
        (neck, sd),
        settings={"analytic model": as_made.name},
        warnings=[*warnings, *warning.of_result(made, as_made)],
    )


def _stiffness_of_draws(made: Stage, model: AnalyticResult, sd: Array) -> Array:
    """Return the stiffness diagonals (draws, 3) of stages with normally distributed necks; sd (3, 3), mm."""
    necks = lower(made).neck + sd * np.random.default_rng(SEED).normal(size=(DRAWS, 3, 3))
    links = body_compliance(made)[None] if model.links else None
    K = stiffness_with_necks(made, necks, model.formula, model.freedoms, links)
    return np.asarray(np.diagonal(K, axis1=1, axis2=2))
