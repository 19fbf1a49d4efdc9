"""Motion of a mechanism by its actuators: transmission, losses, coupling, and the ends of the motion of the output."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.drives import StageDrive
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.driven import Driven
from flexfem.questions.plates import ON_MESHES, PEAK, ROUND_OFF, Responses, meshed, of_models, over_yield, solved
from flexfem.questions.setup import Mesh, MeshFields, Models, answer
from flexfem.refused import BadInput
from flexfem.results import UNEVEN, Quantity, Result


class MechanismDrive(Result):
    """Motion of a mechanism by its actuators, with all of them in place: transmission, range, losses, coupling."""

    title = "drive"
    main = ("motion", {})
    reading = ("all actuators are in place with their stiffness; a motion is that for the free stroke of one actuator",)
    motion = Quantity(
        "motion for the full free stroke", "motion", ("actuator", "point", "model", "direction"), ON_MESHES, "all",
        prefixed=True,
    )  # fmt: skip
    transmission = Quantity(
        "output motion per free stroke", ("", "", "rad_per_mm"), ("actuator", "model", "direction"), ON_MESHES, "all"
    )
    used = Quantity(
        "opening of the actuator over its free stroke", "percent", ("actuator", "model"), ON_MESHES,
        note="the rest of the stroke is lost to the elasticity of the actuator",
    )  # fmt: skip
    coupling = Quantity(
        "opening of the other actuators over the free stroke", "percent", ("actuator", "other", "model"),
        ON_MESHES, "all",
    )  # fmt: skip
    cross = Quantity(
        "cross motion of the output over its main translation", "percent", ("actuator", "model"),
        ON_MESHES._replace(absolute=5e-3), "all",
    )  # fmt: skip
    rotation = Quantity(
        "parasitic rotation of the output over its main translation", "rad_per_mm", ("actuator", "model"),
        ON_MESHES._replace(absolute=1e-6), "all",
    )  # fmt: skip
    force = Quantity("force of the actuator at full stroke", "n", ("actuator", "model"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress at full stroke", "mpa", ("actuator", "model", "hinge"), PEAK, "all", largest=("hinge",)
    )
    engaged = Quantity(
        "stiffness of the output with all actuators", "stiffness", ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),  # it has that of bodies at small contacts
    )  # fmt: skip


def driven(mechanism: Mechanism, C: Array) -> Driven:
    """Return the output with all actuators in place, by their free strokes, for a compliance (k, k) of the ports."""
    ports, actuators = [0, 1, 2, *mechanism.layout.drive_ports], mechanism.layout.actuators
    if not actuators:
        raise BadInput(f"{mechanism.origin}: no actuator, expected at least one [[actuator]]")
    names = tuple(actuator.name for actuator in actuators)
    ratings = [(one.stiffness, 0.0, one.blocking_force, 0.0, one.stroke) for one in actuators]
    stiffness, preload, blocking_force, lowest, highest = np.array(ratings).T
    each = StageDrive((), names, stiffness, preload, blocking_force, np.eye(len(names)), lowest, highest)
    return Driven.of(C[np.ix_(ports, ports)], each)


def drive(mechanism: Mechanism, mesh: Mesh | None, models: Models) -> MechanismDrive:
    """Return the motion of a mechanism by the full free stroke of each of its actuators."""
    actuators, drives = mechanism.layout.actuators, mechanism.layout.drive_ports
    strokes, numbers = np.array([actuator.stroke for actuator in actuators]), np.arange(len(actuators))

    def values(response: Responses) -> dict[str, Any]:
        C, found = response.compliance, driven(mechanism, response.compliance)
        motion = (C[: 3 * len(mechanism.layout.points), drives] @ found.Y).reshape(-1, 3, len(drives))
        output, opening = motion[0].T, C[np.ix_(drives, drives)] @ found.Y  # (a, 3), (a, a)
        main = np.argmax(np.abs(output[:, :2]), axis=1)
        along = np.where(np.abs(one := output[numbers, main]) > ROUND_OFF * np.max(np.abs(motion)), one, np.nan)
        cross, rotation = output[numbers, 1 - main] / along, output[:, 2] / along
        coupled = np.where(numbers == numbers[:, None], np.nan, opening.T)
        return {
            "motion": np.moveaxis(motion * strokes, -1, 0),
            "transmission": output,
            "used": 100 * np.diag(opening),
            "coupling": 100 * np.where(np.abs(coupled) < ROUND_OFF, 0.0, coupled),
            "cross": 100 * np.where(np.abs(cross) < UNEVEN, 0.0, cross),
            "rotation": np.where(np.abs(rotation) * mechanism.layout.lever < UNEVEN, 0.0, rotation),
            "force": np.diag(found.Y) * strokes,
            "stress": response.stress((found.Y * strokes).T @ np.eye(len(C))[drives]),
            "engaged": found.stiffness,
        }

    def made() -> dict[str, Array]:
        assert mesh is not None
        response = solved(mechanism, mesh.resolution)
        loads = driven(mechanism, response.compliance).Y * strokes
        return {a.name: np.tensordot(loads[:, k], response.fields[drives], 1) for k, a in enumerate(actuators)}

    found = of_models(mechanism, mesh, models, values)
    fields = MeshFields(meshed(mechanism, mesh.resolution), made) if mesh is not None and not mesh.layers else None
    labels = {"other": [actuator.name for actuator in actuators]}
    warnings = over_yield(mechanism, found, "stress", "full stroke")
    return answer(MechanismDrive, mechanism, found, mesh, axes=labels, warnings=warnings, fields=fields)


class MechanismReach(Result):
    """Ends of the motion of the output by the strokes of all actuators, by direction."""

    title = "reach of the drive"
    main = ("ends", {"others": "free"})
    labels: ClassVar = {"others": ("free", "zero"), "end": ("low", "high")}
    reading = (
        "motion relative to zero strokes; others: the other two directions, free, or held at zero by at least three "
        "actuators",
    )
    ends = Quantity(
        "ends of the motion of the output", "motion", ("others", "end", "model", "direction"), ON_MESHES, "all",
        prefixed=True,
    )  # fmt: skip


def reach(mechanism: Mechanism, mesh: Mesh | None, models: Models) -> MechanismReach:
    """Return the ends of the motion of the output of a mechanism by the strokes of all actuators."""
    from scipy.optimize import linprog  # takes longer to import than all modules of questions

    strokes = np.array([actuator.stroke for actuator in mechanism.layout.actuators])

    def values(response: Responses) -> dict[str, Any]:
        motion = driven(mechanism, response.compliance).poses * strokes  # (3, a), for full strokes
        ends = np.array([np.minimum(motion, 0).sum(axis=1), np.maximum(motion, 0).sum(axis=1)])
        scale, held = np.max(np.abs(motion), axis=1), np.zeros((2, 3))
        if len(strokes) < 3:
            return {"ends": np.stack([ends, np.full((2, 3), np.nan)])}
        for direction, end in np.ndindex(3, 2):
            others = [k for k in range(3) if k != direction and scale[k] > ROUND_OFF * np.max(scale)]
            fixed = {"A_eq": motion[others] / scale[others, None], "b_eq": np.zeros(len(others))} if others else {}
            size, sign = max(scale[direction], 1e-300), 1 - 2 * end
            held[end, direction] = sign * size * linprog(sign * motion[direction] / size, **fixed, bounds=(0, 1)).fun
        return {"ends": np.stack([ends, held])}

    found = of_models(mechanism, mesh, models, values)
    return answer(MechanismReach, mechanism, found, mesh)
