"""Reports without a solution: the content of a stage or mechanism file, and a comparison of hinge
formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem import arguments
from flexfem.arrays import Array, brief
from flexfem.files.refusals import key_path
from flexfem.hinges.chart import thickness_chart, thickness_factors
from flexfem.hinges.formulas import FORMULAS, formula
from flexfem.hinges.shapes import SHAPE_FORMULAS
from flexfem.mechanism.assembly import GROUND
from flexfem.mechanism.content import located
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.gaps import names_of_parts, smallest_gaps
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.parts import PlateBody, Reduction
from flexfem.mechanism.plate import body_polygon, check_layout, joint_polygon
from flexfem.mechanism.profiles import FILE_KEYS
from flexfem.paper.designs import stage_frames
from flexfem.paper.drives import drive_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.paper.stage_file import Plane, actuators_of, of_drive, of_heat
from flexfem.questions import warnings as warning
from flexfem.results import Ends
from flexfem.units import LENGTH, RATE

POINTS = 121  # of a curve
MOST_GAPS = 6  # that are listed
HIGHEST = 1e6  # largest H/h accepted; the chart has no limit
THICKNESSES = (0.5, 50.0)
RATIOS = (0.02, 0.1, 0.3, 1.0)  # range of b/t, and values of t/R, of the thickness review


class PlacedHinge(NamedTuple):
    """One of the nine hinges; `axis_deg` is the direction of the neck."""

    chain: int
    hinge: str
    centre_mm: tuple[float, float]
    axis_deg: float
    radius_mm: float
    neck_mm: float
    prismatic: bool


class PlacedActuator(NamedTuple):
    """An actuator and the chains with identical data, its contacts as on chain 1, and the ratings
    of its stacks.
    """

    name: str
    chains: list[int]
    between: tuple[str, str]
    stack: str | None
    contacts_mm: list[tuple[float, float]]
    directions_deg: list[float]
    stroke_um: float
    stiffness_n_per_um: float
    blocking_force_n: float
    stiffness_with_contact_n_per_um: float
    preload_n: float
    contact: str


class DriveReport(NamedTuple):
    """The drive of a stage; the hash, assumptions and sources are those of the stage and the drive
    together.
    """

    actuators: list[PlacedActuator]
    hash: str
    provenance: dict[str, str]
    assumed: list[str]
    not_stated: list[str]


@brief
class StageReport(NamedTuple):
    """A valid, feasible stage: `dimensions` by keys of the file, `provenance` by key path; `drive`
    if it has one.
    """

    file: str
    name: str
    mobility: int
    model: Plane
    chains_alike: bool
    hash: str
    dimensions: dict[str, Any]
    hinges: list[PlacedHinge]
    provenance: dict[str, str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]
    drive: DriveReport | None = None


class PlacedBody(NamedTuple):
    """A body of a mechanism without the boxes cut for its hinges; `held`: fixed, or its clamped
    edges by number.
    """

    body: str
    held: str
    mass_g: float
    holes: int


class PlacedProfile(NamedTuple):
    """A hinge of a mechanism; `other` dimensions than length and neck as a text."""

    hinge: str
    between: str
    shape: str
    length_mm: float
    neck_mm: float
    other: str
    centre_mm: tuple[float, float]
    direction_deg: float


class PlacedPoint(NamedTuple):
    """A point of a mechanism; `contact_mm`: radius of the area around it, None for the whole body."""

    point: str
    body: str
    at_mm: tuple[float, float]
    contact_mm: float | None


class LinearDrive(NamedTuple):
    """An actuator of a mechanism and its two contacts."""

    actuator: str
    between: str
    from_mm: tuple[float, float]
    to_mm: tuple[float, float]
    stroke_um: float
    stiffness_n_per_um: float
    blocking_force_n: float
    mass_g: float


class PlacedGap(NamedTuple):
    """A gap between two parts of a mechanism, bodies or hinges; `at_mm`: where it is narrowest."""

    between: str
    gap_mm: float
    at_mm: tuple[float, float]


@brief
class MechanismReport(NamedTuple):
    """A valid mechanism with all parameters and copies resolved, as far as it can be checked
    without a mesh.

    dimensions : thickness, material, payload and values of parameters.   size : in x and y.   mass
    : of the plate.
    gaps : the smallest between parts, one for every pair, the smallest first.
    """

    file: str
    name: str
    model: Reduction
    hash: str
    dimensions: dict[str, Any]
    size_mm: tuple[float, float]
    mass_g: float
    bodies: list[PlacedBody]
    hinges: list[PlacedProfile]
    points: list[PlacedPoint]
    actuators: list[LinearDrive]
    gaps: list[PlacedGap]
    provenance: dict[str, str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def check(stage: Mechanism) -> StageReport | MechanismReport:
    """Validate a stage or mechanism file; show its parts, drive and the sources of the numbers.

    Parameters
    ----------
    stage : Stage or Mechanism
        The stage or mechanism.

    Returns
    -------
    StageReport or MechanismReport

    Raises
    ------
    BadInput
        The stage or mechanism cannot be made.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    return _mechanism_report(stage) if isinstance(stage, MechanismFile) else _stage_report(stage)


def _mechanism_report(mechanism: Mechanism) -> MechanismReport:
    layout = mechanism.layout
    material = mechanism.material
    with located(mechanism):
        check_layout(layout)
    plate = [
        *(body_polygon(layout, k) for k in range(len(layout.bodies))),
        *map(joint_polygon, layout.joints),
    ]
    extent = np.ptp(np.reshape(shapely.total_bounds(plate), (2, 2)), axis=0)
    names = [*(body.name for body in layout.bodies), GROUND]  # body -1 is the ground outside
    densities = [material.density for material in layout.materials]
    areas = shapely.area(plate).tolist()
    masses = [
        _rounded(1e6 * rho * layout.thickness * area)
        for rho, area in zip(densities, areas, strict=True)
    ]
    stated = {
        "thickness_mm": layout.thickness,
        "material": material.model_dump(
            mode="json", by_alias=True, exclude={"expansion"}, exclude_none=True
        ),
        "parameters": {key: float(value) for key, value in mechanism.parameters.items()},
        "payload": [
            {"mass_g": 1e6 * load.mass, "inertia_kg_mm2": 1e3 * load.inertia}
            for load in layout.payloads
        ],
    }
    held = {key_path(("body", k), mechanism): _held(body) for k, body in enumerate(mechanism.body)}
    words = {
        key_path(("hinge", k), mechanism): hinge.shape for k, hinge in enumerate(mechanism.hinge)
    }  # copies have the key of their original, as bodies have
    sources = {key: text for key, text in mechanism.sources.items() if text}
    tables = {
        key: [key[:k] for k, character in enumerate(key) if character in ".["] for key in sources
    }
    return MechanismReport(
        **of_stage(mechanism),
        model=mechanism.model,
        hash=mechanism.hash,
        dimensions={key: value for key, value in stated.items() if value},
        size_mm=(_rounded(extent[0]), _rounded(extent[1])),
        mass_g=sum(masses),
        bodies=[
            PlacedBody(body.name, held[body.key], mass, len(body.holes))
            for body, mass in zip(layout.bodies, masses, strict=False)
        ],
        hinges=[_profile(joint, names, words[joint.key]) for joint in layout.joints],
        points=[
            PlacedPoint(name, names[at.body], _place(at.point), at.radius)
            for name, at in layout.points
        ],
        actuators=[
            LinearDrive(
                each.name,
                " - ".join(names[contact.body] for contact in each.contacts),
                _place(each.contacts[0].point),
                _place(each.contacts[1].point),
                _rounded(1e3 * each.stroke),
                _rounded(RATE.factor * each.stiffness),
                each.blocking_force,
                _rounded(1e6 * each.mass),
            )
            for each in layout.actuators
        ],
        gaps=_gaps(layout),
        provenance={
            key: text for key, text in sources.items() if text not in map(sources.get, tables[key])
        },
        warnings=[*warning.of_numbers(mechanism), *warning.of_parameters(mechanism)],
    )


def _gaps(layout: Layout) -> list[PlacedGap]:
    names = names_of_parts(layout)
    return [
        PlacedGap(
            " - ".join(names[part] for part in gap.parts), _rounded(gap.width), _place(gap.place)
        )
        for gap in smallest_gaps(layout, MOST_GAPS)
    ]


def _held(body: PlateBody) -> str:
    """Say how the ground holds a body: edges have the numbers that the file gives them, from 1."""
    if body.fixed:
        return "fixed"
    edges = ", ".join(map(str, sorted(body.clamped_edges)))
    if not edges:
        return ""
    return f"clamped at edge{'s' * (len(body.clamped_edges) > 1)} {edges}"


def _profile(joint: Joint, names: list[str], shape: str) -> PlacedProfile:
    profile = joint.profile
    own = {
        each.name: getattr(profile, each.name)
        for each in fields(profile)
        if each.name not in ("neck", "span")
    }
    texts = {key: f"{value:.6g} {LENGTH}" for key, value in own.items() if isinstance(value, float)}
    texts |= {"angle": f"{np.rad2deg(own['angle']):.6g} deg"} if "angle" in own else {}
    others = [f"{FILE_KEYS.get(key, key).replace('_', ' ')} {text}" for key, text in texts.items()]
    if "table" in own:
        others.append(
            f"{len(own['table'])} rows joined by "
            f"{'a smooth curve' if own['smooth'] else 'straight lines'}"
        )
    if profile.side:
        others.append(f"on the {profile.side} side")
    if own.get("flush"):
        others.append(f"flush {', '.join(own['flush'])}")
    between = " - ".join(names[body] for body in joint.bodies)
    direction = np.rad2deg(joint.heading) % 360.0
    size = (_rounded(profile.length), _rounded(profile.neck), ", ".join(others))
    return PlacedProfile(
        joint.name, between, shape, *size, _place(joint.place), _rounded(direction)
    )


def _place(z: complex) -> tuple[float, float]:
    return _rounded(z.real), _rounded(z.imag)


def _rounded(value: float) -> float:
    """Remove the round-off by which identical chains differ."""
    return round(float(value), 9) + 0.0


def _stage_report(stage: Stage) -> StageReport:
    check_feasible(stage)
    others = {
        "name",
        "units",
        "model",
        "hinges",
        "override",
        "actuator",
        "provenance",
        "frame",
    }  # reported elsewhere
    left_out: dict[str, Any] = dict.fromkeys(others, True) | {"material": {"expansion"}}
    frames = stage_frames(stage)
    hinges = list[PlacedHinge]()
    for (row, k), axis in np.ndenumerate(frames.axes):
        hinge = stage.hinge(row + 1, HINGE_NAMES[k])
        x, y = frames.centres[row, k].tolist()
        place = (row + 1, HINGE_NAMES[k], (x, y), float(np.rad2deg(axis) % 360.0))
        hinges.append(PlacedHinge(*place, hinge.radius, hinge.neck, hinge.prismatic))
    sources = {key: text for key, text in stage.sources.items() if text}
    return StageReport(
        **of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=stage.model_dump(
            mode="json", by_alias=True, exclude=left_out, exclude_none=True
        ),
        hinges=hinges,
        provenance={
            key: text for key, text in sources.items() if not (of_drive(key) or of_heat(key))
        },
        warnings=warning.of_stage(stage),
        drive=_drive(stage) if stage.actuator else None,
    )


def _drive(stage: Stage) -> DriveReport:
    """Return the drive; actuators of a file that are identical on several chains are listed once."""
    found = list[PlacedActuator]()
    for index, chain in np.ndindex(len(stage.actuator), len(CHAINS)):
        actuator = actuators_of(stage)[chain][index]
        drive = drive_of(stage)
        numbers = np.flatnonzero(
            drive.differential[:, drive.names.index(f"{actuator.name}, chain {CHAINS[chain]}")]
        )
        placed = [drive.stacks[k] for k in numbers]
        one = PlacedActuator(
            name=actuator.name,
            chains=[CHAINS[chain]],
            between=actuator.between,
            stack=actuator.stack,
            contacts_mm=[_place(contact.point) for contact in placed],
            directions_deg=[
                _rounded(np.angle(contact.direction, deg=True)) % 360.0 for contact in placed
            ],
            stroke_um=_rounded(1e3 * actuator.rating.stroke),
            stiffness_n_per_um=_rounded(RATE.factor * actuator.rating.stiffness),
            blocking_force_n=actuator.rating.blocking_force,
            stiffness_with_contact_n_per_um=RATE.factor * float(drive.stiffness[numbers[0]]),
            preload_n=actuator.preload,
            contact=actuator.contact,
        )
        same = [known for known in found if one._replace(chains=known.chains) == known]
        if same:
            same[0].chains.extend(one.chains)
        else:
            found.append(one)
    sources = {key: text for key, text in stage.sources.items() if text and of_drive(key)}
    return DriveReport(found, stage.drive_hash, sources, **stage.drive_assumptions._asdict())


class KnownFormula(NamedTuple):
    """A hinge formula: freedoms stated by its source, range of t/R, source, and how reliably its
    form is known.
    """

    freedoms: tuple[str, ...]
    t_over_R: Ends  # noqa: N815 as the equations call it
    source: str
    status: str


class KnownShape(NamedTuple):
    """Published closed form of a hinge shape; r in `t_over_r` is the notch depth, fillet radius or,
    of a leaf, length.

    The models integrate the profile of any shape numerically and use no closed form.
    """

    freedoms: tuple[str, ...]
    t_over_r: Ends
    source: str
    status: str


class FormulaCurve(NamedTuple):
    """Ratios (n,) of the compliances of a formula, valid for t/R in `valid`, to finite elements;
    None if not stated.
    """

    name: str
    valid: tuple[float, float]
    rotation: Array | None
    axial: Array | None
    shear: Array | None


@brief
class HingeReview(NamedTuple):
    """Ratios of all formulas to the finite elements of the hinge chart with H = h, at t/R `ratio`
    (n,).

    height : H/h of the higher blocks, whose finite elements are `higher`.   poissons_ratio : for
    the shear."""

    ratio: Array
    curves: Sequence[FormulaCurve]
    height: float
    higher: FormulaCurve
    poissons_ratio: float
    source: str


@brief
class ThicknessReview(NamedTuple):
    """Ratio (k, n) of three-dimensional to plane-stress compliance of a hinge, at t/R `ratio` and
    b/t `width`.
    """

    width: Array
    ratio: Array
    poissons_ratio: float
    rotation: Array
    axial: Array
    source: str


def known_formulas() -> dict[str, KnownFormula]:
    """Return freedoms, range of t/R and source of every hinge formula by name, including the user's
    own.
    """
    return {
        name: KnownFormula(f.freedoms, Ends(f.valid), f.source, f.status)
        for name, f in FORMULAS.items()
    }


def known_shapes() -> dict[str, KnownShape]:
    """Return freedoms, range and source of the closed form of every hinge shape that has one, by
    shape.
    """
    return {
        shape: KnownShape(f.freedoms, Ends(f.valid), f.source, f.status)
        for shape, f in SHAPE_FORMULAS.items()
    }


def hinge_review(height: float = 3.0, poissons_ratio: float = 0.3) -> HingeReview:
    """Compare every formula with the hinge chart of plane-stress finite elements. Raises BadInput.

    Parameters
    ----------
    height : block height over notch height, H/h, from 1 to 1e6.   poissons_ratio : from 0 to 0.5,
    for the shear only."""
    height = arguments.between("height", height, 1.0, HIGHEST)
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, 0.0, 0.5)
    ratio = np.geomspace(*FORMULAS["calibrated"].valid, POINTS)
    full = formula("calibrated").compliance(
        1.0, ratio, 1.0, 1.0, poissons_ratio
    )  # H = h; nan off the chart

    def curve(name: str) -> FormulaCurve:
        compliances = FORMULAS[name].compliance(
            1.0, ratio, 1.0, 1.0, poissons_ratio, height * (2.0 + ratio)
        )
        parts = zip(("rotation", "axial", "shear"), compliances, full, strict=True)
        values = (
            c / c_full if freedom in FORMULAS[name].freedoms else None
            for freedom, c, c_full in parts
        )
        return FormulaCurve(name, FORMULAS[name].valid, *values)

    published = [curve(name) for name in FORMULAS if name != "calibrated"]
    return HingeReview(
        ratio, published, height, curve("calibrated"), poissons_ratio, FORMULAS["calibrated"].source
    )


def thickness_review(poissons_ratio: float = 0.33) -> ThicknessReview:
    """Ratio of three-dimensional to plane-stress compliance of hinges over their thickness, for
    slender to stout necks.

    Parameters
    ----------
    poissons_ratio : on the thickness chart, from 0.1 to 0.45; BadInput for another.
    """
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, *thickness_chart().ends[2])
    width = np.geomspace(*THICKNESSES, POINTS)
    ratio = np.array(RATIOS)
    factors = thickness_factors(1.0 / ratio[:, None], 1.0, width, poissons_ratio)
    source = (
        "three-dimensional finite elements of one hinge, flexfem "
        "(flexfem/data/thickness_chart.json)"
    )
    return ThicknessReview(width, ratio, poissons_ratio, factors.rotation, factors.axial, source)
