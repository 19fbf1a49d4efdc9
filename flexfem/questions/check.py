"""What is known without an answer: a stage as it was read, and the hinge formulas and charts beside one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.hinges.chart import thickness_chart, thickness_factors
from flexfem.hinges.formulas import FORMULAS, formula
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.drives import contacts
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import Plane, actuators_of, of_drive, of_heat, of_stage
from flexfem.questions import warnings as warning
from flexfem.units import RATE

POINTS = 121  # of a curve
HIGHEST = 1e6  # H/h that is asked for; the chart has no largest
THICKNESSES, RATIOS = (0.5, 50.0), (0.02, 0.1, 0.3, 1.0)  # b/t from and to, and t/R, of the review of the thickness


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
    """An actuator on the chains where it is the same, and what each of its stacks can do; places as on chain 1."""

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
    """The drive of a stage: its hash is that of stage and drive; assumptions and sources of all numbers of both."""

    actuators: list[PlacedActuator]
    hash: str
    provenance: dict[str, str]
    assumed: list[str]
    not_stated: list[str]


class StageReport(NamedTuple):
    """A valid, feasible stage as it was read: `dimensions` by keys of the file, `provenance` by key path.

    drive : None without actuators; nothing else says anything of it.
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


def check(stage: Stage) -> StageReport:
    """Validate a stage file; show hinges, drive, mobility and where the numbers come from.

    Parameters
    ----------
    stage : Stage
        The stage.

    Returns
    -------
    StageReport

    Raises
    ------
    BadInput
        The stage cannot be made.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    check_feasible(stage)
    others = {"name", "model", "hinges", "override", "actuator", "provenance", "frame"}  # said elsewhere
    left_out: dict[str, Any] = dict.fromkeys(others, True) | {"material": {"expansion"}}
    return StageReport(
        **of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=stage.model_dump(mode="json", by_alias=True, exclude=left_out, exclude_none=True),
        hinges=[_hinge(stage, chain, position) for chain, position in np.ndindex(3, 3)],
        provenance={key: text for key, text in stage.sources.items() if text and not (of_drive(key) or of_heat(key))},
        warnings=warning.of_stage(stage),
        drive=_drive(stage) if stage.actuator else None,
    )


def _drive(stage: Stage) -> DriveReport:
    """The drive; an actuator of the file stands once for all chains on which it is the same."""
    found = list[PlacedActuator]()
    for index, chain in np.ndindex(len(stage.actuator), len(CHAINS)):
        one = _actuator(stage, CHAINS[chain], index)
        alike = next((each for each in found if one._replace(chains=each.chains) == each), None)
        if alike is None:
            found.append(one)
        else:
            alike.chains.extend(one.chains)
    sources = {key: text for key, text in stage.sources.items() if text and of_drive(key)}
    return DriveReport(found, stage.drive_hash, sources, **stage.drive_assumptions._asdict())


def _actuator(stage: Stage, chain: int, index: int) -> PlacedActuator:
    one, placed = actuators_of(stage)[chain - 1][index], contacts(stage, chain, index)
    return PlacedActuator(
        name=one.name,
        chains=[chain],
        between=one.between,
        stack=one.stack,
        contacts_mm=[(_rounded(each.point.real), _rounded(each.point.imag)) for each in placed],
        directions_deg=[_rounded(np.rad2deg(each.direction)) % 360.0 for each in placed],
        stroke_um=_rounded(1e3 * one.rating.stroke),
        stiffness_n_per_um=_rounded(RATE.factor * one.rating.stiffness),
        blocking_force_n=one.rating.blocking_force,
        stiffness_with_contact_n_per_um=RATE.factor * one.stiffness_with(stage.material),
        preload_n=one.preload,
        contact=one.contact,
    )


def _rounded(value: float) -> float:
    """Without what chains that are alike differ by in round-off."""
    return round(float(value), 9) + 0.0


def _hinge(stage: Stage, chain: int, position: int) -> PlacedHinge:
    name, placed = HINGE_NAMES[position], stage_frames(stage)
    hinge = stage.hinge(chain + 1, name)
    x, y = placed.centres[chain, position].tolist()
    axis = float(np.rad2deg(placed.axes[chain, position]) % 360.0)
    return PlacedHinge(chain + 1, name, (x, y), axis, hinge.radius, hinge.neck, hinge.prismatic)


class KnownFormula(NamedTuple):
    """What is known of a hinge formula: freedoms that its source states, range of t/R, source, how sure its form is."""

    freedoms: tuple[str, ...]
    t_over_R: tuple[float, float]  # noqa: N815 as the equations call it
    source: str
    status: str


class FormulaCurve(NamedTuple):
    """Compliances (n,) of a formula, for t/R within `valid`, over finite elements of a full notch; None: not stated."""

    name: str
    valid: tuple[float, float]
    rotation: Array | None
    axial: Array | None
    shear: Array | None


class HingeReview(NamedTuple):
    """Every formula over the finite elements of the hinge chart with H = h, at t/R `ratio` (n,).

    height : H/h of the higher blocks, whose finite elements are `higher`.   poissons_ratio : for the shear.
    """

    ratio: Array
    curves: Sequence[FormulaCurve]
    height: float
    higher: FormulaCurve
    poissons_ratio: float
    source: str


class ThicknessReview(NamedTuple):
    """Compliance (k, n) of the hinge in three dimensions over that in plane stress, at t/R `ratio` and b/t `width`."""

    width: Array
    ratio: Array
    poissons_ratio: float
    rotation: Array
    axial: Array
    source: str


def known_formulas() -> dict[str, KnownFormula]:
    """What is known of every hinge formula, by name: freedoms, range of t/R, source; the user's own are among them."""
    return {name: KnownFormula(f.freedoms, f.valid, f.source, f.status) for name, f in FORMULAS.items()}


def hinge_review(height: float = 3.0, poissons_ratio: float = 0.3) -> HingeReview:
    """Every formula over the calibrated hinge, the hinge chart: plane-stress finite elements. Raises BadInput.

    Parameters
    ----------
    height : H/h, of the blocks over the notch, from 1 to 1e6.   poissons_ratio : from 0 to 0.5, acts on shear alone.
    """
    height = arguments.between("height", height, 1.0, HIGHEST)
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, 0.0, 0.5)
    ratio = np.geomspace(*FORMULAS["calibrated"].valid, POINTS)
    full = formula("calibrated").compliance(1.0, ratio, 1.0, 1.0, poissons_ratio)  # H = h; nan off the chart

    def curve(name: str) -> FormulaCurve:
        own = FORMULAS[name].compliance(1.0, ratio, 1.0, 1.0, poissons_ratio, height * (2.0 + ratio))
        parts = zip(("rotation", "axial", "shear"), own, full, strict=True)
        values = (one / other if freedom in FORMULAS[name].freedoms else None for freedom, one, other in parts)
        return FormulaCurve(name, FORMULAS[name].valid, *values)

    published = [curve(name) for name in FORMULAS if name != "calibrated"]
    return HingeReview(ratio, published, height, curve("calibrated"), poissons_ratio, FORMULAS["calibrated"].source)


def thickness_review(poissons_ratio: float = 0.33) -> ThicknessReview:
    """Three-dimensional over plane-stress compliance of the hinge, over its thickness, for necks slender to stout.

    Parameters
    ----------
    poissons_ratio : on the thickness chart, from 0.1 to 0.45; BadInput for another.
    """
    poissons_ratio = arguments.between("poissons_ratio", poissons_ratio, *thickness_chart().ends[2])
    width, ratio = np.geomspace(*THICKNESSES, POINTS), np.array(RATIOS)
    found = thickness_factors(1.0 / ratio[:, None], 1.0, width, poissons_ratio)
    source = "three-dimensional finite elements of one hinge, our own (flexfem/data/thickness_chart.json)"
    return ThicknessReview(width, ratio, poissons_ratio, found.rotation, found.axial, source)
