"""Reports without a solution: the content of a mechanism file, and a comparison of hinge formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem import arguments
from flexfem.arrays import Array, short_repr
from flexfem.hinges.chart import thickness_chart, thickness_factors
from flexfem.hinges.formulas import FORMULAS, formula
from flexfem.hinges.shapes import SHAPE_FORMULAS
from flexfem.mechanism.assembly import GROUND
from flexfem.mechanism.gaps import names_of_parts, smallest_gaps
from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.mechanism.parts import PlateBody
from flexfem.mechanism.plate import body_polygon
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_shape import FILE_KEYS
from flexfem.questions import warnings as warning
from flexfem.questions.setup import question
from flexfem.results import Ends
from flexfem.units import LENGTH, RATE

POINTS = 121  # of a curve
MOST_GAPS = 6  # that are listed
HIGHEST = 1e6  # largest H/h accepted; the chart has no limit
THICKNESSES = (0.5, 50.0)
RATIOS = (0.02, 0.1, 0.3, 1.0)  # range of b/t, and values of t/R, of the thickness review


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


@short_repr
class MechanismReport(NamedTuple):
    """A valid mechanism with all parameters and copies resolved, as far as it can be checked
    without a mesh.

    dimensions : thickness, material, payload and values of parameters.   size : in x and y.   mass
    : of the plate.
    gaps : the smallest between parts, one for every pair, the smallest first.
    """

    file: str
    name: str
    model: str
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


@question
def check(mechanism: Mechanism) -> MechanismReport:
    """Validate a file; show its parts, drive and the sources of the numbers.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.

    Returns
    -------
    MechanismReport
        Of a stage file `StageReport`.

    Raises
    ------
    BadInput
        The mechanism cannot be made.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    layout = mechanism.layout
    plate = [body_polygon(layout, index) for index in range(len(layout.bodies))]
    plate += [joint_polygon(joint) for joint in layout.joints]
    extent = np.ptp(np.reshape(shapely.total_bounds(plate), (2, 2)), axis=0)
    masses = _masses(layout, shapely.area(plate))
    return MechanismReport(
        **of_stage(mechanism),
        model=mechanism.model,
        hash=mechanism.hash,
        dimensions=_dimensions(mechanism),
        size_mm=(rounded(extent[0]), rounded(extent[1])),
        mass_g=sum(masses),
        bodies=_bodies(mechanism, masses),
        hinges=_hinges(mechanism),
        points=_points(layout),
        actuators=_actuators(layout),
        gaps=_gaps(layout),
        provenance=_provenance(mechanism),
        warnings=[*warning.of_numbers(mechanism), *warning.of_parameters(mechanism)],
    )


def _masses(layout: Layout, areas: Array) -> list[float]:
    """Return the masses, g, of bodies and hinges of these areas, mm^2."""
    masses = list[float]()
    for material, area in zip(layout.materials, areas.tolist(), strict=True):
        masses.append(rounded(1e6 * material.density * layout.thickness * area))
    return masses


def _dimensions(mechanism: Mechanism) -> dict[str, Any]:
    """Return thickness, material, parameters and payload, those that are stated."""
    stated = {
        "thickness_mm": mechanism.layout.thickness,
        "material": mechanism.material.model_dump(
            mode="json", by_alias=True, exclude={"expansion"}, exclude_none=True
        ),
        "parameters": {key: float(value) for key, value in mechanism.numbers_by_parameter.items()},
        "payload": [
            {"mass_g": 1e6 * load.mass, "inertia_kg_mm2": 1e3 * load.inertia}
            for load in mechanism.layout.payloads
        ],
    }
    return {key: value for key, value in stated.items() if value}


def _names(layout: Layout) -> list[str]:
    """Return the names of the bodies, then that of the ground outside, which is body -1."""
    return [*(body.name for body in layout.bodies), GROUND]


def _bodies(mechanism: Mechanism, masses: Sequence[float]) -> list[PlacedBody]:
    placed = list[PlacedBody]()
    for body, mass in zip(mechanism.layout.bodies, masses, strict=False):
        held = _held(mechanism.entries[body.key])
        placed.append(PlacedBody(body.name, held, mass, len(body.holes)))
    return placed


def _hinges(mechanism: Mechanism) -> list[PlacedProfile]:
    """Return the hinges; copies have the key of their original, as bodies have."""
    layout = mechanism.layout
    names = _names(layout)
    return [_profile(joint, names, mechanism.entries[joint.key].shape) for joint in layout.joints]


def _points(layout: Layout) -> list[PlacedPoint]:
    names = _names(layout)
    return [
        PlacedPoint(name, names[at.body], placed(at.point), at.radius) for name, at in layout.points
    ]


def _actuators(layout: Layout) -> list[LinearDrive]:
    names = _names(layout)
    return [
        LinearDrive(
            each.name,
            " - ".join(names[contact.body] for contact in each.contacts),
            placed(each.contacts[0].point),
            placed(each.contacts[1].point),
            rounded(1e3 * each.stroke),
            rounded(RATE.factor * each.stiffness),
            each.blocking_force,
            rounded(1e6 * each.mass),
        )
        for each in layout.actuators
    ]


def _provenance(mechanism: Mechanism) -> dict[str, str]:
    """Return the sources by key path, without those that equal the source of a table above."""
    sources = {key: text for key, text in mechanism.sources.items() if text}
    found = dict[str, str]()
    for key, text in sources.items():
        tables = [key[:k] for k, character in enumerate(key) if character in ".["]
        if text not in [sources.get(table) for table in tables]:
            found[key] = text
    return found


def _gaps(layout: Layout) -> list[PlacedGap]:
    names = names_of_parts(layout)
    gaps = list[PlacedGap]()
    for gap in smallest_gaps(layout, MOST_GAPS):
        between = " - ".join(names[part] for part in gap.parts)
        gaps.append(PlacedGap(between, rounded(gap.width), placed(gap.place)))
    return gaps


def _held(body: PlateBody) -> str:
    """Say how the ground holds a body: edges have the numbers that the file gives them, from 1."""
    if body.fixed:
        return "fixed"
    numbers = sorted(body.clamped_edges)
    if not numbers:
        return ""
    edges = "edges" if len(numbers) > 1 else "edge"
    return f"clamped at {edges} {', '.join(map(str, numbers))}"


def _profile(
    joint: Joint,
    names: list[str],
    shape: str,
) -> PlacedProfile:
    profile = joint.profile
    return PlacedProfile(
        hinge=joint.name,
        between=" - ".join(names[body] for body in joint.bodies),
        shape=shape,
        length_mm=rounded(profile.length),
        neck_mm=rounded(profile.neck),
        other=", ".join(_other_dimensions(profile)),
        centre_mm=placed(joint.place),
        direction_deg=rounded(np.rad2deg(joint.heading) % 360.0) % 360.0,  # not 360 by round-off
    )


def _other_dimensions(profile: Profile) -> list[str]:
    """Return the dimensions of a profile besides length and neck."""
    own = {each.name: getattr(profile, each.name) for each in fields(profile)}
    texts = list[str]()
    for key, value in own.items():
        if isinstance(value, float) and key not in ("neck", "span"):
            size = f"{value:.6g} {LENGTH}"
            if key == "angle":
                size = f"{np.rad2deg(value):.6g} deg"
            texts.append(f"{FILE_KEYS.get(key, key).replace('_', ' ')} {size}")
    if "table" in own:
        line = "a smooth curve" if own["smooth"] else "straight lines"
        texts.append(f"{len(own['table'])} rows joined by {line}")
    if profile.side:
        texts.append(f"on the {profile.side} side")
    if own.get("flush"):
        texts.append(f"flush {', '.join(own['flush'])}")
    return texts


def placed(point: complex) -> tuple[float, float]:
    """Return a point as x and y, rounded."""
    return rounded(point.real), rounded(point.imag)


def rounded(value: float) -> float:
    """Remove the round-off by which identical chains differ."""
    return round(float(value), 9) + 0.0


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


@short_repr
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


@short_repr
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
