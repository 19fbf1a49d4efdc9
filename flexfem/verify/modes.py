"""Natural frequencies of a stage: plane finite elements with bands by mesh, and the pseudo-rigid model beside them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.analytic.model import DEFAULT_FORMULA, ModelChoice, analyse, best_model
from flexfem.analytic.responses import dynamics, engaged
from flexfem.arrays import Array
from flexfem.fem.drive import stack_loads
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import Modes, Structure, fields_of, modes, structure, total_mass
from flexfem.fem.response import plate_of, tie_hub
from flexfem.fem.sectors import build_mesh
from flexfem.mechanism.bodies import Payload, carried, drawn_inertia, hub_moments, mass_per_area, payload_matrix
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import located
from flexfem.questions import warnings as warning
from flexfem.questions.bands import (
    CAUTIOUS,
    ORDER,
    SAFETY,
    Convergence,
    grid_convergence,
    levels,
)
from flexfem.refused import BadInput
from flexfem.units import DENSITY, UNITS
from flexfem.verify.result import OfStage, Record, Triple, Uncertainty, about

Drives: TypeAlias = Literal["disengaged", "engaged"]
DRIVES: tuple[Drives, ...] = get_args(Drives)
ROUND_OFF = 1e-9  # of a frequency
AGREED = 0.1  # relative, of the observed and the theoretical order
RIGID_MODES = 3  # the platform on its hinges; above them links swing and bend
ABOVE_THIRD = (
    "analytic frequencies above the third are not to be trusted: links swing and bend there. On 40 random stages, "
    "drives disengaged, those of elastic links were 0.8 to 28 % too low (half by more than 10 %), those of rigid links "
    "with calibrated hinges 5 to 163 % too high; the first three, by calibrated hinges, were within 0.11 % and 3.4 %"
)
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


def payload_of(mass: float, inertia: float, tilting: float = 0.0) -> Payload:
    """A payload of so many kg and kg mm^2."""
    return Payload(mass / KILOGRAM, *(each / UNITS["kg_mm2"].factor for each in (inertia, tilting)))


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
    warnings, whole = list(warning.of_stage(stage)), total_mass(found)
    analytic = {name: values * HERTZ for name, values in analytic_frequencies(stage, payload, drives, warnings).items()}
    warnings += [*warning.of_thickness(stage), OUT_OF_PLANE]
    warnings += [*[ABOVE_THIRD] * (count > RIGID_MODES), *[NO_STACKS] * (drives == "engaged")]
    driven = {"hash": stage.drive_hash} | stage.drive_doubts._asdict() if drives == "engaged" else {}
    record = NaturalModes(
        **about(stage) | driven,
        name=stage.name,
        drives=drives,
        resolution=resolution,
        triangles=len(found.mesh.triangles),
        unknowns=found.mass.shape[0],
        **masses(stage, payload, whole),
        modes=_modes(resolution, np.array(frequencies), 100 * solved.participation**2 / np.diag(whole), analytic),
        warnings=list(dict.fromkeys(warnings)),
    )
    return Vibration(found, solved, record)


def _modes(resolution: int, frequencies: Array, shares: Array, analytic: dict[str, Array]) -> list[Mode]:
    """By frequencies (3 meshes, k), Hz, shares (k, 3), %, on the finest, and analytic ones by model, Hz."""
    meshed = [uncertainty(resolution, each.tolist()) for each in frequencies.T]
    return [
        Mode(
            frequency=float(frequencies[-1, k]),
            band=mesh.band,
            mesh=mesh,
            share=Triple.of(shares[k]),
            analytic={name: _finite(values, k) for name, values in analytic.items()},
        )
        for k, mesh in enumerate(meshed)
    ]


def masses(stage: Stage, payload: Payload, meshed: Array) -> dict[str, Any]:
    """What records say of masses, kg, and moments of inertia, kg mm^2; `meshed` is the mass matrix of the elements."""
    drawn = drawn_inertia(stage).matrix + payload_matrix(payload)
    return {
        "mass": float(drawn[0, 0] * KILOGRAM),
        "inertia": float(drawn[2, 2] * KILOGRAM),
        "meshed_mass": float(meshed[0, 0] * KILOGRAM),
        "hub_mass": float(hub_moments(stage)[0] * mass_per_area(stage) * KILOGRAM),
        "payload_mass": payload.mass * KILOGRAM,
        "payload_inertia": payload.inertia * KILOGRAM,
    }


def uncertainty(resolution: int, values: list[float]) -> Uncertainty:
    return Uncertainty.of(frequency_convergence(np.array(levels(resolution)), np.array(values)))


def frequency_convergence(resolutions: Array, values: Array) -> Convergence:
    """Grid convergence of a frequency, with a wider band unless the observed order is the theoretical one.

    Notes
    -----
    Necks converge by order four, free re-entrant corners of links by little more than one (1.09 at a right angle, twice
    the exponent of the displacement: M. L. Williams, J. Appl. Mech. 19 (1952) 526, recalled). Where links bend, above
    the third mode, corners take over as meshes get finer, and the order observed on coarse meshes is too high. The band
    is therefore at least `1.25 |e21| / (r21 - 1)`, by the order of a crack, one, which no corner falls below; and at
    least `3 |e21| / (r21^p - 1)` with the lesser p of the orders, W. L. Oberkampf, C. J. Roy, Verification and
    Validation in Scientific Computing (2010), section 8.6 (recalled). Where steps do not converge the larger counts.
    """
    found = grid_convergence(resolutions, values, round_off=ROUND_OFF)
    converging = found.verdict == "converging"
    if found.verdict == "round-off" or (converging and abs(found.observed / ORDER - 1) <= AGREED):
        return found
    steps = np.abs(np.diff(values[-3:]))
    step = steps[-1] if converging else steps.max()
    ratio, order = resolutions[-1] / resolutions[-2], min(found.order, ORDER)
    factor = max(CAUTIOUS / (ratio**order - 1), SAFETY / (ratio - 1))
    return found._replace(band=max(found.band, factor * float(step)))


def _finite(values: Array, k: int) -> float | None:
    return float(values[k]) if k < len(values) and np.isfinite(values[k]) else None


def analytic_frequencies(stage: Stage, payload: Payload, drives: Drives, warnings: list[str]) -> dict[str, Array]:
    """Natural frequencies (21,), rad/s, by the stage's own rigid model, the best of the same plane, and the best.

    inf for freedoms that a model does not have; why a model is replaced is added to `warnings`.
    """
    best, found = best_model(stage, warnings), {}
    for one in (ModelChoice(stage, None, DEFAULT_FORMULA, False), best._replace(stage=stage), best):
        result = analyse(*one)
        if drives == "engaged":
            drive = drive_of(stage)
            found[one.name] = engaged(dynamics(one.stage, result, payload, drive.stacks), drive.stiffness).frequencies
        else:
            found[one.name] = dynamics(one.stage, result, payload).frequencies
    return found
