"""Natural frequencies of a stage: plane finite elements with bands by mesh, and the pseudo-rigid model beside them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.analytic.dynamics import dynamics, engaged
from flexfem.analytic.model import DEFAULT_FORMULA, analyse
from flexfem.arrays import Array
from flexfem.fem.drive import stack_loads
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import Modes, Structure, fields_of, modes, structure, total_mass
from flexfem.fem.response import plate_of, tie_hub
from flexfem.fem.sectors import build_mesh
from flexfem.refused import BadInput
from flexfem.stage.drives import drive_of
from flexfem.stage.inertia import Payload, carried, drawn_inertia, hub_moments, mass_per_area, payload_matrix
from flexfem.stage.origin import located
from flexfem.stage.schema import Stage
from flexfem.units import DENSITY, UNITS
from flexfem.verify import warning
from flexfem.verify.driven_models import best_model
from flexfem.verify.errors import grid_convergence, levels
from flexfem.verify.result import OfStage, Record, Triple, Uncertainty, about

Drives: TypeAlias = Literal["disengaged", "engaged"]
DRIVES: tuple[Drives, ...] = get_args(Drives)
ROUND_OFF = 1e-9  # of a frequency
HERTZ, KILOGRAM = UNITS["hz"].factor, UNITS["kg"].factor
OUT_OF_PLANE = (
    "motion in the plane only: modes in which the platform leaves the plane are not found here, and the lowest of them "
    "can lie below these"
)
NO_STACKS = "engaged stacks are springs without mass, and hold their strokes: their own mass is left out"


class Mode(Record):
    """One natural frequency, Hz, and what its mode is like.

    band : Hz, of the mesh.   mesh : values on three meshes, Hz.
    share : effective modal mass, % of the whole mass (of its polar moment of inertia in theta), for base motion.
    analytic : Hz, by model; None where a model has no such freedom.
    """

    frequency: float
    band: float
    mesh: Uncertainty
    share: Triple
    analytic: dict[str, float | None]


class NaturalModes(OfStage):
    """What `flexfem modes` answers.

    mass, inertia : kg, kg mm^2 about the platform centre, of all that is drawn and of the payload, pads and hub too.
    meshed_mass : kg, by the finite elements.   hub_mass : kg, of the hub, a disc of the stage's metal.
    payload_mass, payload_inertia : kg, kg mm^2 about the platform centre.
    """

    name: str
    drives: Drives
    resolution: int
    triangles: int
    unknowns: int
    mass: float
    inertia: float
    meshed_mass: float
    hub_mass: float
    payload_mass: float
    payload_inertia: float
    modes: list[Mode]


class Vibration(NamedTuple):
    """Structure and modes on the finest mesh, and the record made of them."""

    structure: Structure
    modes: Modes
    record: NaturalModes

    @property
    def fields(self) -> Array:
        """Displacements (k, n, 2) of the mesh's nodes in every mode of unit modal mass."""
        return fields_of(self.structure.tied, self.modes.shapes)


def payload_of(mass: float, inertia: float) -> Payload:
    """A payload of so many kg and kg mm^2."""
    return Payload(mass / KILOGRAM, inertia / UNITS["kg_mm2"].factor)


def vibration(stage: Stage, mesh: StageMesh, payload: Payload, drives: Drives) -> Structure:
    """The stage as it vibrates, on one mesh. Raises BadInput, ComputationFailed as `flexfem.solve`."""
    plate = plate_of(stage)
    tied, pushes, rates = tie_hub(mesh), None, None
    if drives == "engaged":
        drive = drive_of(stage)
        pushes, rates = stack_loads(mesh, tied, drive.stacks)[:, 3:], drive.stiffness
    density = stage.material.density * DENSITY
    return structure(mesh, plate, density, tied, carried(stage, payload), pushes, rates)


def natural_modes(
    stage: Stage,
    count: int,
    payload: Payload,
    drives: Drives,
    resolution: int,
    progress: Callable[[str], object] | None = None,
) -> Vibration:
    """The lowest modes of a feasible stage on three meshes, the last of `resolution`; and by the analytic models.

    Raises BadInput for engaged drives of a stage without any, ComputationFailed as `modes`.
    """
    if drives == "engaged" and not stage.actuator:
        with located(stage):
            raise BadInput("no [[actuator]]: the stage has no drive to engage")
    frequencies = []
    for level in levels(resolution):
        found = vibration(stage, build_mesh(stage, level), payload, drives)
        solved = modes(found, count)
        frequencies.append(solved.frequencies * HERTZ)
        if progress is not None:
            progress(f"{found.mass.shape[0]} unknowns")
    warnings = list(warning.of_stage(stage))
    analytic = {name: values * HERTZ for name, values in analytic_frequencies(stage, payload, drives, warnings).items()}
    whole = total_mass(found)
    shares = 100 * solved.participation**2 / np.diag(whole)
    each = [
        Mode(
            frequency=float(frequencies[-1][k]),
            band=(mesh := _uncertainty(resolution, [values[k] for values in frequencies])).band,
            mesh=mesh,
            share=Triple.of(shares[k]),
            analytic={name: _finite(values, k) for name, values in analytic.items()},
        )
        for k in range(count)
    ]
    drawn = drawn_inertia(stage).matrix + payload_matrix(payload)
    warnings += [OUT_OF_PLANE, *([NO_STACKS] if drives == "engaged" else [])]
    driven = {"hash": stage.drive_hash} | stage.drive_doubts._asdict() if drives == "engaged" else {}
    record = NaturalModes(
        **about(stage) | driven,
        name=stage.name,
        drives=drives,
        resolution=resolution,
        triangles=len(found.mesh.triangles),
        unknowns=found.mass.shape[0],
        mass=float(drawn[0, 0] * KILOGRAM),
        inertia=float(drawn[2, 2] * KILOGRAM),
        meshed_mass=float(whole[0, 0] * KILOGRAM),
        hub_mass=float(hub_moments(stage)[0] * mass_per_area(stage) * KILOGRAM),
        payload_mass=payload.mass * KILOGRAM,
        payload_inertia=payload.inertia * KILOGRAM,
        modes=each,
        warnings=list(dict.fromkeys(warnings)),
    )
    return Vibration(found, solved, record)


def _uncertainty(resolution: int, values: list[float]) -> Uncertainty:
    return Uncertainty.of(grid_convergence(np.array(levels(resolution)), np.array(values), round_off=ROUND_OFF))


def _finite(values: Array, k: int) -> float | None:
    return float(values[k]) if k < len(values) and np.isfinite(values[k]) else None


def analytic_frequencies(stage: Stage, payload: Payload, drives: Drives, warnings: list[str]) -> dict[str, Array]:
    """Natural frequencies (21,), rad/s, by the stage's own rigid model and by the best one, of name and value.

    inf for freedoms that a model does not have; why a model is replaced is added to `warnings`.
    """
    own = (None, DEFAULT_FORMULA, False)
    found = {}
    for mobility, formula, links in (own, best_model(stage, warnings)):
        result = analyse(stage, mobility, formula, links)
        name = f"{formula}, elastic links" if links else f"{formula}, mobility {result.mobility}"
        if drives == "engaged":
            drive = drive_of(stage)
            found[name] = engaged(dynamics(stage, result, payload, drive.stacks), drive.stiffness).frequencies
        else:
            found[name] = dynamics(stage, result, payload).frequencies
    return found
