"""What is answered of one stage where nothing is stored: records of the table, the JSON and the Python API alike.

Every record has the file of the stage ("" for one made in Python) and its name, the `warnings` that the answer earns,
one plain sentence each, and key paths of numbers that are `assumed` or `not_stated`. Arrays are in N, mm and rad; order
x, y, theta.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexfem.analytic.formulas import FORMULAS
from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array
from flexfem.files.provenance import key_paths, provenance_of
from flexfem.stage.designs import stage_frames
from flexfem.stage.drives import contacts
from flexfem.stage.overrides import actuators_of
from flexfem.stage.schema import CHAINS, HINGE_NAMES, Stage, of_drive, of_heat
from flexfem.verify import warning

if TYPE_CHECKING:
    from flexfem.fem.mesh import StageMesh
    from flexfem.fem.response import LoadCase
    from flexfem.verify.protocol import OnMesh, Solved

RIGID = (
    "with rigid links the stress is too high, by 14 to 34 % with paros-weisbord where it was compared with finite "
    "elements; `summary` takes calibrated hinges and elastic links"
)
UNITS = "N, mm, rad; order x, y, theta"


class PlacedHinge(NamedTuple):
    """One of the nine hinges: chain 1 to 3, name, centre (x, y), direction of the neck, radius and neck."""

    chain: int
    hinge: str
    centre_mm: tuple[float, float]
    axis_deg: float
    radius_mm: float
    neck_mm: float
    prismatic: bool


class PlacedActuator(NamedTuple):
    """An actuator, and what each of its stacks can do.

    chains : 1 to 3, those where it is the same.   contacts_mm, directions_deg : x, y, in the frame of chain 1.
    stroke : mm.   stiffness, stiffness_with_contact : N/mm.   blocking_force, preload : N.
    """

    name: str
    chains: list[int]
    between: tuple[str, str]
    stack: str | None
    contacts_mm: list[tuple[float, float]]
    directions_deg: list[float]
    stroke: float
    stiffness: float
    blocking_force: float
    stiffness_with_contact: float
    preload: float


class DriveReport(NamedTuple):
    """The drive of a stage: its hash is that of stage and drive; doubts and sources of all numbers of both."""

    actuators: list[PlacedActuator]
    hash: str
    provenance: dict[str, str]
    assumed: list[str]
    not_stated: list[str]


class StageReport(NamedTuple):
    """A valid, feasible stage as it was read: `dimensions` in inside units, `provenance` by key path of the file.

    drive : None without actuators; nothing else says anything of it.
    """

    file: str
    name: str
    mobility: int
    model: str
    chains_alike: bool
    hash: str
    dimensions: dict[str, Any]
    hinges: list[PlacedHinge]
    provenance: dict[str, str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]
    drive: DriveReport | None = None


class StiffnessReport(NamedTuple):
    """The analytic model at rest: stiffness and compliance (3, 3) of the platform, compliances of the hinges (3, 3).

    neck_stress : (3 chains, 3 hinges, 3 directions), largest von Mises stress per displacement, the others held: MPa
        per mm, mm, rad.   stress_accuracy : how far that is from finite elements, in words.
    """

    file: str
    name: str
    units: str
    model: str
    mobility: int
    formula: str
    formula_source: str
    formula_in_range: bool
    stiffness: Array
    compliance: Array
    hinge_compliance: Compliance
    neck_stress: Array
    stress_accuracy: str
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class MeshReport(NamedTuple):
    """A mesh and the file it was written to."""

    file: str
    name: str
    written: str
    resolution: int
    nodes: int
    triangles: int
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class LoadReport(NamedTuple):
    """Finite elements at rest and under one load (3,).

    stiffness, compliance : (3, 3), of the platform.   displacement : (3,), of the platform.   reaction : (3,), of the
    ground.   energy : N mm.   neck_stress : (3 chains, 3 hinges), largest von Mises stress, MPa.
    """

    file: str
    name: str
    units: str
    model: str
    resolution: int
    triangles: int
    unknowns: int
    stiffness: Array
    compliance: Array
    force: Array
    displacement: Array
    reaction: Array
    energy: float
    neck_stress: Array
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def report_stage(stage: Stage) -> StageReport:
    """What a file says of a stage, and where its numbers come from."""
    sources = {key: provenance_of(stage, key) for key in key_paths(stage) if not (of_drive(key) or of_heat(key))}
    return StageReport(
        **of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=_dimensions(stage),
        hinges=[_hinge(stage, chain, position) for chain, position in np.ndindex(3, 3)],
        provenance={key: source for key, source in sources.items() if source},
        warnings=warning.of_stage(stage),
        drive=_drive(stage) if stage.actuator else None,
    )


def _dimensions(stage: Stage) -> dict[str, Any]:
    """What a file says, less hinges, drive and expansion, of which other answers are made, and what it leaves open."""
    others = {"name", "hinges", "override", "actuator", "provenance", "frame"}
    left_out: dict[str, Any] = dict.fromkeys(others, True) | {"material": {"expansion"}}
    return stage.model_dump(mode="json", exclude=left_out, exclude_none=True)


def _drive(stage: Stage) -> DriveReport:
    sources = {key: provenance_of(stage, key) for key in key_paths(stage) if of_drive(key)}
    return DriveReport(
        actuators=[each for index in range(len(stage.actuator)) for each in _actuators(stage, index)],
        hash=stage.drive_hash,
        provenance={key: source for key, source in sources.items() if source},
        **stage.drive_doubts._asdict(),
    )


def _actuators(stage: Stage, index: int) -> list[PlacedActuator]:
    """An actuator of the file, once for all chains on which it is the same."""
    found = list[PlacedActuator]()
    for one in (_actuator(stage, chain, index) for chain in CHAINS):
        alike = next((each for each in found if one._replace(chains=each.chains) == each), None)
        if alike is None:
            found.append(one)
        else:
            alike.chains.extend(one.chains)
    return found


def _actuator(stage: Stage, chain: int, index: int) -> PlacedActuator:
    one, placed = actuators_of(stage)[chain - 1][index], contacts(stage, chain, index)
    return PlacedActuator(
        name=one.name,
        chains=[chain],
        between=one.between,
        stack=one.stack,
        contacts_mm=[(_rounded(each.point.real), _rounded(each.point.imag)) for each in placed],
        directions_deg=[_rounded(np.rad2deg(each.direction)) % 360.0 for each in placed],
        **one.rating._asdict(),
        stiffness_with_contact=one.stiffness_with(stage.material),
        preload=one.preload,
    )


def _rounded(value: float) -> float:
    """Without what chains that are alike differ by in round-off."""
    return round(float(value), 9) + 0.0


def report_stiffness(stage: Stage, result: AnalyticResult) -> StiffnessReport:
    """The analytic model of a stage with what is to be known of it."""
    return StiffnessReport(
        **of_stage(stage),
        units=UNITS,
        model=stage.model,
        mobility=result.mobility,
        formula=result.formula,
        formula_source=FORMULAS[result.formula].source,
        formula_in_range=bool(np.all(result.in_range)),
        stiffness=result.stiffness,
        compliance=result.compliance,
        hinge_compliance=result.hinges,
        neck_stress=result.stress,
        stress_accuracy=warning.stress_accuracy(result.formula) if result.links else RIGID,
        warnings=[*warning.of_formula(stage, result.formula), *warning.of_model(stage, result)],
    )


def report_mesh(stage: Stage, mesh: StageMesh, resolution: int, written: str) -> MeshReport:
    """A mesh of a stage, and where it was written."""
    return MeshReport(
        **of_stage(stage),
        written=written,
        resolution=resolution,
        nodes=len(mesh.nodes),
        triangles=len(mesh.triangles),
        warnings=[],
    )


def report_load(stage: Stage, solved: Solved | OnMesh, case: LoadCase, resolution: int) -> LoadReport:
    """Finite elements of a stage under one load, with what is to be known of that."""
    highest, where = float(np.max(case.neck_stress)), "under this load"
    doubts = warning.of_yield(highest, stage.material.yield_strength, where)
    return LoadReport(
        **of_stage(stage),
        units=f"{UNITS}; stress MPa",
        model=stage.model,
        resolution=resolution,
        triangles=solved.triangles,
        unknowns=solved.response.unknowns,
        stiffness=np.asarray(np.linalg.inv(solved.response.compliance)),
        compliance=solved.response.compliance,
        force=case.force,
        displacement=case.pose,
        reaction=case.reaction,
        energy=case.energy,
        neck_stress=case.neck_stress,
        warnings=[*doubts, *warning.of_motion(stage, case.pose, where)],
    )


def of_stage(stage: Stage) -> dict[str, Any]:
    """Which stage it is, and which of its numbers are in doubt."""
    doubts = {"assumed": list(stage.assumed), "not_stated": list(stage.not_stated)}
    return {"file": str(stage.origin), "name": stage.name, **doubts}


def _hinge(stage: Stage, chain: int, position: int) -> PlacedHinge:
    name, placed = HINGE_NAMES[position], stage_frames(stage)
    hinge = stage.hinge(chain + 1, name)
    x, y = placed.centres[chain, position].tolist()
    axis = float(np.rad2deg(placed.axes[chain, position]) % 360.0)
    return PlacedHinge(chain + 1, name, (x, y), axis, hinge.radius, hinge.neck, hinge.prismatic)
