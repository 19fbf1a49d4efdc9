"""A mechanism under growing dead loads, with finite rotations: analytic network and plane finite elements."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import displaced
from flexfem.analytic.plates import respond
from flexfem.arrays import Array
from flexfem.fem.nonlinear import equilibria
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import corner_bands, levels
from flexfem.questions.plates import ON_MESHES, PEAK, model_of
from flexfem.questions.setup import Mesh, answer, on_meshes
from flexfem.results import SOLVED, Progress, Quantity, Result

STEPS = (0.25, 0.5, 0.75, 1.0)
THEORIES = ("linear", "beams", "finite elements")


class MechanismLarge(Result):
    """Displacement of the output under growing dead loads: linear, and with finite rotations by both models."""

    title = "large displacements"
    main = ("pose", {"load": "100 %"})
    labels: ClassVar = {"load": tuple(f"{100 * share:g} %" for share in STEPS)}
    reading = (
        "linear: the analytic network with rigid bodies; beams: the same with hinges as co-rotational beams; finite "
        "elements: plane, with finite rotations and elastic bodies",
        "the rotation is that of the rigid motion nearest to the motion of the contact",
    )
    force = Quantity("load on the output", "wrench", ("load", "direction"), SOLVED, "wrench")
    pose = Quantity(
        "displacement of the output", "motion", ("load", "theory", "direction"), ON_MESHES, "pose", prefixed=True
    )
    stiffness = Quantity(
        "tangent stiffness, other directions free", "stiffness", ("load", "theory", "direction"), ON_MESHES
    )
    strain = Quantity("largest strain of finite elements", "", ("load",), PEAK, "all", shown=False)


def large(
    mechanism: Mechanism,
    force: tuple[float, float, float] | None,
    amplitude: float,
    mesh: Mesh | None,
    progress: Progress | None,
) -> MechanismLarge:
    """Return the displacements under a load, or under one along the softest translation that moves by an amplitude."""
    layout = mechanism.layout
    C = respond(layout).compliance
    if force is None:
        size = arguments.between("amplitude", amplitude, 1e-6, 1e4, " mm")
        softest = int(np.argmax(np.diag(C)[:2]))
        load = np.zeros(3)
        load[softest] = size / C[softest, softest]
    else:
        load = arguments.forces("force", force, 1)
    loads = np.zeros((len(STEPS), len(C)))
    loads[:, :3] = np.outer(STEPS, load)
    found = displaced(layout, loads)
    poses = [loads @ C[:, :3], found.motions[:, :3]]
    tangents = [np.broadcast_to(C, found.compliance.shape), found.compliance]
    values, bands = {"force": loads[:, :3]}, dict[str, Array]()
    if mesh is not None:
        steps = levels(mesh.resolution)
        each = on_meshes(steps, lambda level: equilibria(model_of(mechanism, level), loads), progress)
        poses.append(each[-1].pose[:, :3])
        tangents.append(each[-1].compliance)
        values["strain"] = each[-1].strain
        sizes = np.array(steps, dtype=float)
        alike = {"pose": [one.pose[:, :3] for one in each], "stiffness": [_along(one.compliance) for one in each]}
        for name, parts in alike.items():
            bands[name] = np.full((len(STEPS), len(THEORIES), 3), np.nan)
            bands[name][:, -1] = corner_bands(sizes, np.array(parts))
    values |= {"pose": np.stack(poses, axis=1), "stiffness": np.stack([_along(one) for one in tangents], axis=1)}
    stable = np.all(found.stable) and np.linalg.eigvalsh(tangents[-1])[:, 0].min() > 0
    warnings = [] if stable else ["an equilibrium is not stable under dead loads"]
    labels = {"theory": THEORIES[: len(poses)]}
    return answer(MechanismLarge, mechanism, {}, mesh, {}, values, labels, bands, warnings=warnings)


def _along(compliance: Array) -> Array:
    """Stiffness (s, 3) along every direction of the output, the others free."""
    return np.asarray(1 / np.diagonal(compliance, axis1=1, axis2=2)[:, :3])
