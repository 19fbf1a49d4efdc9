"""Stiffness of a manufactured stage or mechanism, from its measured neck thicknesses."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np
from pydantic import Field, ValidationError, model_validator

from flexfem.analytic.plates import respond
from flexfem.arrays import Array, free_stiffness, inverse
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import plate_response
from flexfem.files import refusals
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import Neck, NeckDeviation
from flexfem.files.tables import Label, Table
from flexfem.files.toml import bad_key, read_csv, validate
from flexfem.mechanism.content import located
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.plate import check_layout
from flexfem.paper.designs import lower
from flexfem.paper.links import body_compliance
from flexfem.paper.model import analyse, stiffness_with_necks
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.questions import plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.plates import PART_RESOLUTION, ElasticParts
from flexfem.questions.setup import DEFAULT, ELASTIC, ELASTIC_READ, Analytic, Mesh, ModelAnswer
from flexfem.refused import BadInput
from flexfem.results import EXACT, SOLID, SOLVED, Progress, Quantity, Result
from flexfem.units import MICROMETRE

DRAWS = 4000
LEAST_DRAWS = 400
SEED = 2003
WORK = 5e8  # draws of a mechanism times the third power of its hinges, at most: a minute
QUANTILES = (0.025, 0.975)
# standard error of these quantiles times the root of the draws: sqrt(p (1 - p)) / normal density
OF_LIMITS = 2.67
PLAUSIBLE = (
    0.5,
    2.0,
)  # measured neck / drawn neck; outside this range the unit or the hinge is probably wrong
LARGEST_DEVIATION = 0.2  # standard deviation / neck
IN_MEMORY = 2**21  # numbers of the matrices of networks that are solved together
OTHERS = ("held", "free")  # the other directions of a stiffness along one
ALONG = ("others", "direction")
Refusal: TypeAlias = Callable[
    [tuple[str | int, ...], str], BadInput
]  # of the keys of a value, with a text
HingePlace: TypeAlias = tuple[int | None, str]  # chain, none in a mechanism, and name of the hinge


class MeasuredNeck(Table):
    """A measured neck thickness and the standard deviation of the measurement, mm."""

    chain: int | None = Field(default=None, ge=1, le=3, examples=[2])
    """Chain of a hinge of the nine-hinge stage; a hinge of a mechanism has none"""
    hinge: Label = Field(examples=["elbow"])
    """Hinge of this chain: base, elbow or platform; or a hinge of a mechanism, by its name in
    `flexfem check`
    """
    neck: Neck = Field(alias="neck_um", examples=[512.0])
    """Measured neck thickness; must be between half and twice the drawn one"""
    sd: NeckDeviation = Field(default=0.0, alias="sd_um", examples=[3.0])
    """Standard deviation of the measurement, for all necks or for none; at most a fifth of the neck
    """

    @property
    def place(self) -> HingePlace:
        """Chain and name of the hinge."""
        return self.chain, self.hinge


class Necks(Sourced):
    """The measured necks of a stage or a mechanism, one entry per hinge."""

    kind: ClassVar[str] = "necks file"

    neck: tuple[MeasuredNeck, ...] = Field(min_length=1)
    """A measured neck; one entry for each of the nine hinges of a stage, or for any hinges of a
    mechanism
    """

    @model_validator(mode="after")
    def _every_hinge_once(self) -> Necks:
        hinges = [entry.place for entry in self.neck]
        for index, hinge in enumerate(hinges):
            if hinge in hinges[:index]:
                raise refusals.refusal("each hinge once", "neck", index)
        without = [
            index for index, entry in enumerate(self.neck) if "sd" not in entry.model_fields_set
        ]
        if 0 < len(without) < len(self.neck):  # a missing deviation is not a deviation of zero
            raise refusals.refusal("sd_um of all necks or of none", "neck", without[0])
        return self

    def over(self, drawn: Mapping[HingePlace, float]) -> tuple[Array, Array]:
        """Return necks and standard deviations (hinges,), mm; an unlisted hinge has the drawn neck,
        and deviation 0.
        """
        listed = {entry.place: (entry.neck, entry.sd) for entry in self.neck}
        neck, sd = np.transpose([listed.get(place, (value, 0.0)) for place, value in drawn.items()])
        return neck, sd


class AsBuilt(Result):
    """Stiffness of a plate with its measured necks, and its scatter due to the measurement
    uncertainty.
    """

    title = "stage as built"
    main = ("deviation", {"others": "free"})
    labels: ClassVar = {"others": OTHERS}
    columns = ("component",)
    reading: ClassVar[tuple[str, ...]] = (
        "others: the other two directions, held at zero, or free, as they are where one force "
        "moves the output",
    )
    stiffness = Quantity(
        "stiffness as built", "stiffness matrix", ("direction", "component"), EXACT, "matrix"
    )
    drawn = Quantity(
        "stiffness as drawn",
        "stiffness matrix",
        ("direction", "component"),
        EXACT,
        "matrix",
        shown=False,
    )
    along = Quantity("stiffness as built", "stiffness", ALONG)
    deviation = Quantity("deviation from the drawing", "percent", ALONG)
    spread = Quantity("standard deviation", "stiffness", ALONG, SOLVED)
    low = Quantity("95 % of parts from", "stiffness", ALONG, SOLVED)
    high = Quantity("to", "stiffness", ALONG, SOLVED)
    necks = Quantity("neck", "um", ("chain", "hinge"), shown=False)
    sd = Quantity("standard deviation of the neck", "um", ("chain", "hinge"), shown=False)
    unanswered = Quantity("draws without a solution", shown=False)


class MechanismAsBuilt(AsBuilt, mechanism=True):
    """The same of a mechanism."""

    title = "mechanism as built"


def read_necks(path: str | os.PathLike[str], drawn: Mapping[HingePlace, float]) -> Necks:
    """Read measured necks: CSV with columns chain, of a stage, hinge, neck_um and, if known, sd_um;
    or TOML, [[neck]].

    drawn : necks of all hinges, mm; a stage needs a measured neck of each.

    Raises BadInput with file and line, also for a neck that is not between half and twice the drawn
    one."""
    path = refusals.checked_path(path)
    chained = any(chain is not None for chain, _ in drawn)
    refused: Refusal = partial(bad_key, path)
    if path.suffix.lower() == ".toml":
        necks = validate(Necks, path)
    else:
        necks, refused = _read_csv(path, chained)
    for k, entry in enumerate(necks.neck):
        for key, problem in _problems(entry, drawn, chained):
            raise refused(("neck", k), f"{refusals.key_path(('neck', k, key), necks)}{problem}")
    places = {entry.place for entry in necks.neck}
    if chained and (
        missing := [
            f"{name} of chain {chain}" for chain, name in drawn if (chain, name) not in places
        ]
    ):
        verb = "is" if len(missing) == 1 else "are"
        raise refused(("neck",), f"neck: expected nine hinges: {', '.join(missing)} {verb} missing")
    return necks


def _problems(
    entry: MeasuredNeck, drawn: Mapping[HingePlace, float], chained: bool
) -> Iterator[tuple[str, str]]:
    """Yield the keys of a measured neck that do not suit the drawn hinges, and what is expected."""
    if chained != (entry.chain is not None):
        found = "" if entry.chain is None else f" = {entry.chain}"
        yield (
            "chain",
            f"{found}, expected 1, 2 or 3 for a hinge of a stage, none for one of a mechanism",
        )
    if entry.place not in drawn:
        names = dict.fromkeys(name for _, name in drawn)
        listed = refusals.one_line(", ".join(names), refusals.SHOWN)
        close = refusals.suggestion(entry.hinge, names) or f", one of {listed}"
        yield "hinge", f" = {refusals.shown(entry.hinge)}, expected the name of a hinge{close}"
    low, high = (MICROMETRE.factor * ratio * drawn[entry.place] for ratio in PLAUSIBLE)
    neck = MICROMETRE.factor * entry.neck
    sd = MICROMETRE.factor * entry.sd
    if not low <= neck <= high:
        yield (
            "neck_um",
            f" = {neck:g}, expected {low:g} to {high:g}, half to twice the drawn neck: is the "
            "unit right?",
        )
    if sd > LARGEST_DEVIATION * neck:
        yield "sd_um", f" = {sd:g}, expected at most {LARGEST_DEVIATION:g} of the neck"


def _read_csv(path: Path, chained: bool) -> tuple[Necks, Refusal]:
    """Return the necks of a CSV file, with the column of the chain if `chained`, and a function
    that refuses a row.
    """
    chain, hinge, neck, sd = (
        field.alias or name for name, field in MeasuredNeck.model_fields.items()
    )
    rows = read_csv(path, (chain, hinge, neck)[not chained :], (sd,))
    cells = [{key: cell for key, cell in row.items() if cell} for row in rows.values()]
    data = {
        "neck": [
            {key: cell if key == hinge else _number(cell) for key, cell in row.items()}
            for row in cells
        ]
    }

    def refused(at: tuple[str | int, ...], text: str) -> BadInput:
        line = next((list(rows)[part] for part in at if isinstance(part, int)), None)
        return BadInput(refusals.one_line(f"{refusals.place_of(path, line)}: {text}"))

    try:
        return Necks.model_validate(data), refused
    except ValidationError as error:
        first = refusals.problems_of(error, data)[0]
    text = (
        f"{first.path[-1]} is missing"
        if first.kind == "missing"
        else refusals.sentence(first, Necks, data)
    )
    raise refused(first.path, text)


def _number(cell: str) -> int | float | str:
    """Return a cell as a number if it is one, otherwise as text."""
    try:
        return int(cell) if cell.isdecimal() else float(cell)
    except ValueError:
        return cell


def _answer(
    plate: Mechanism,
    model: str,
    measured: Necks,
    necks: tuple[Array, Array],
    stiffness: Mapping[str, Array],
    redrawn: Callable[[Array], Array],
    mesh: Mesh | None,
    in_depth: ModelAnswer,
    notes: Sequence[str] = (),
    **texts: Any,
) -> AsBuilt:
    """Return the result from necks and deviations (hinges,), and from the stiffness (3, 3) as drawn
    and as made.

    redrawn : stiffness (draws, 3, 3) with necks thicker by (draws, hinges), mm.
    in_depth : stiffness in three dimensions, which the scatter follows in proportion; or empty.
    """
    neck, sd = necks
    by_hinge = (3, 3) if isinstance(plate, Stage) else (len(neck),)
    values = {
        "necks": neck.reshape(by_hinge),
        "sd": sd.reshape(by_hinge),
        **stiffness,
        **in_depth.values,
    }
    made = _along(values["stiffness"])
    values["along"] = made
    values["deviation"] = 100 * (made / _along(values["drawn"]) - 1)
    texts["notes"] = [
        *notes,
        *["no standard deviation is given: the scatter is not known"] * (not np.any(sd)),
    ]
    if np.any(sd):
        count = int(np.clip(WORK / len(neck) ** 3, LEAST_DRAWS, DRAWS))
        scatter = sd * np.random.default_rng(SEED).normal(size=(count, len(neck)))
        blocks = np.array_split(scatter, -(-9 * scatter.size * len(neck) // IN_MEMORY))
        draws = np.concatenate([redrawn(block) for block in blocks])
        solved = draws[np.all(np.isfinite(draws), axis=(1, 2))]
        draws = _along(solved) * (made / _along(stiffness["stiffness"]))
        low, high = np.quantile(draws, QUANTILES, axis=0)
        left_out = count - len(draws)
        values |= {
            "spread": np.std(draws, axis=0, ddof=1),
            "low": low,
            "high": high,
            "unanswered": left_out,
        }
        texts["notes"] += [
            f"standard deviation of each neck at most {MICROMETRE.factor * np.max(sd):.3g} um; "
            f"{count} draws: the standard error of the standard deviation is "
            f"{100 / np.sqrt(2 * len(draws)):.2g} % of it, that of each limit "
            f"{100 * OF_LIMITS / np.sqrt(len(draws)):.2g} % of it",
            *[f"{left_out} draws have no solution and are excluded"] * (left_out > 0),
        ]
    axes = (
        {} if isinstance(plate, Stage) else {"hinge": [joint.name for joint in plate.layout.joints]}
    )
    kind = setup.kind_of(AsBuilt, plate)
    subject = setup.about(plate, files={"necks": measured})
    settings = {"analytic model": model, **setup.meshed(mesh)}
    return kind(subject, values, dict(in_depth.bands), axes, settings, **texts)


def _along(stiffness: Array) -> Array:
    """Return the stiffness (..., 2 others held or free, 3) along every direction."""
    return np.stack(
        [np.diagonal(stiffness, axis1=-2, axis2=-1), free_stiffness(stiffness)], axis=-2
    )


def _in_depth(
    plate: Mechanism,
    mesh: Mesh | None,
    pair: tuple[Stage | Layout, Stage | Layout],
    progress: Progress | None,
) -> ModelAnswer:
    """Return the stiffness as drawn and as made in three dimensions; nothing without a mesh."""
    mesh_once = cache(mesh_layout)

    def solve(resolution: int, layers: int) -> dict[str, Array]:
        solutions = (  # one after the other, because of their memory
            plates.solved(part, resolution, layers)
            if isinstance(part, Stage)
            else plate_response(part, mesh_once(part, resolution), plates.layers_of(plate, layers))
            for part in pair
        )
        drawn, made = (inverse(solution.compliance[:3, :3]) for solution in solutions)
        return {"drawn": drawn, "stiffness": made}

    whole = isinstance(plate, Stage)
    return (
        plates.by_elements(mesh, solve, progress, whole=whole)[SOLID] if mesh else ModelAnswer({})
    )


def _of_mechanism(
    mechanism: Mechanism, necks: Path, mesh: Mesh | None, progress: Progress | None
) -> AsBuilt:
    setup.require_hinges(mechanism, "whose necks are measured", "a mechanism with hinges")
    layout = mechanism.layout
    drawn: dict[HingePlace, float] = {
        (None, joint.name): joint.profile.neck for joint in layout.joints
    }
    measured = read_necks(necks, drawn)
    neck, sd = measured.over(drawn)
    made = _with_necks(mechanism, neck)
    parts = plates.parts_in(made, mesh_layout(made, PART_RESOLUTION))
    materials = [made.material_of(joint) for joint in made.joints]

    def freedoms(added: Array) -> Array:
        """Return the beam integrals (..., hinges, 3) of hinges that are thicker by (..., hinges)."""
        found = list[Array]()
        for h, (joint, material) in enumerate(zip(made.joints, materials, strict=True)):
            E, nu, *_ = material
            found.append(joint.profile.compliance(E, nu, made.thickness, added[..., h]))
        return np.stack([np.diagonal(each, axis1=-2, axis2=-1) for each in found], axis=-2)

    unchanged = freedoms(np.zeros(len(neck)))

    def redrawn(added: Array) -> Array:
        change = np.sqrt(freedoms(added) / unchanged)
        changed = change[..., :, None] * parts.hinges * change[..., None, :]
        return _stiffness(made, parts._replace(hinges=changed))

    unlisted = len(drawn) - len(measured.neck)
    notes = [
        ELASTIC_READ,
        "a hinge with a thicker neck is thicker by the same amount over its whole length; for "
        "the scatter, its compliance changes like its beam integrals",
        *[
            f"{unlisted} of {len(drawn)} hinges are not listed: they have the drawn neck, without "
            "deviation"
        ]
        * (unlisted > 0),
    ]
    stiffness = {
        "drawn": _stiffness(layout, plates.parts_of(mechanism)),
        "stiffness": _stiffness(made, parts),
    }
    deep = _in_depth(mechanism, mesh, (layout, made), progress)
    return _answer(mechanism, ELASTIC, measured, (neck, sd), stiffness, redrawn, mesh, deep, notes)


def _stiffness(layout: Layout, parts: ElasticParts) -> Array:
    """Return the stiffness (..., 3, 3) of the output."""
    return inverse(respond(layout, parts.bodies, layout.ports[:3], parts.hinges).compliance)


def _with_necks(mechanism: Mechanism, necks: Array) -> Layout:
    """Return the layout with necks (hinges,), mm. Raises BadInput if its parts do not fit together."""
    layout = mechanism.layout
    joints = list[Joint]()
    for joint, neck in zip(layout.joints, necks.tolist(), strict=True):
        profile = joint.profile.with_neck(neck)
        joints.append(joint._replace(profile=profile, cut=max(joint.cut, profile.least_cut)))
    made = layout._replace(joints=tuple(joints))
    with located(mechanism):
        check_layout(made)
    return made


@setup.options(not_for="analytic")
def as_built(
    stage: Mechanism,
    necks: Path,
    *,
    analytic: Analytic = DEFAULT,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> AsBuilt:
    """Stiffness of a stage or mechanism with its measured necks, and its scatter due to the
    measurement uncertainty.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    necks : path
        CSV file with columns chain, only for a stage, hinge, neck_um and, if known, sd_um; or TOML
        with these in [[neck]]. A stage needs all nine necks; an unlisted hinge of a mechanism has
        the drawn neck.
    analytic : Analytic
        The analytic model. Of a stage file only.
    solid : bool
        The whole plate by finite elements in three dimensions.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    AsBuilt
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        as_built` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.
    """
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = None if layers is None else setup.mesh_of(stage, "both", None, layers)
    if isinstance(stage, MechanismFile):
        return _of_mechanism(stage, necks, mesh, progress)
    warnings = list[str]()
    hinges = list(product(CHAINS, HINGE_NAMES))
    drawn: dict[HingePlace, float] = {hinge: stage.hinge(*hinge).neck for hinge in hinges}
    measured = read_necks(necks, drawn)
    chosen = analytic.chosen(stage, warnings)
    neck, sd = measured.over(drawn)
    changes = {hinge: {"neck": value} for hinge, value in zip(hinges, neck.tolist(), strict=True)}
    made = chosen.stage.replace(override=changes)
    as_drawn, model = (analyse(*chosen._replace(stage=variant)) for variant in (chosen.stage, made))
    links = body_compliance(made)[None] if model.links else None

    def redrawn(added: Array) -> Array:
        necks = lower(made).neck + added.reshape(-1, 3, 3)
        return stiffness_with_necks(made, necks, model.formula, model.freedoms, links)

    warnings += warning.of_result(made, model)
    stiffness = {"drawn": as_drawn.stiffness, "stiffness": model.stiffness}
    deep = _in_depth(stage, mesh, (chosen.stage, made), progress)
    return _answer(
        stage, model.name, measured, (neck, sd), stiffness, redrawn, mesh, deep, warnings=warnings
    )
