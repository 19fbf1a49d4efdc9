"""How the stage answers loads on its rigid hub: one factorisation, any number of load cases, checked balances."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import (
    QUADRATURE,
    Plate,
    integration,
    internal_forces,
    matrices_of,
    nodal_stress,
    tied_lower,
    von_mises,
)
from flexfem.mechanism.designs import out_of_plane, stage_frames
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import located
from flexfem.refused import BadInput, ComputationFailed

BALANCE = 1e-9  # of the load: reactions, and energy against work
MOST_SOLVES = 12  # with iterative refinement; three do for necks of some um and more
SETTLED = 0.1 * BALANCE  # refined no further: energy and work differ by the error of the compliance


class Response(NamedTuple):
    """Answer of the stage to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    compliance : (3, 3), mm and rad per N and N mm; column j is the pose under unit load j.
    fields : (3, n, 2), mm, displacement of every node.
    reactions : (3, 3), row j the resultant of the clamped edges about the origin under unit load j, N and N mm.
    energy : (3, 3), N mm, `u_i' K u_j`; half its diagonal is the strain energy under each unit load.
    unknowns : number of equations solved.
    """

    compliance: Array
    fields: Array
    reactions: Array
    energy: Array
    unknowns: int


class UnitResponse(Protocol):
    """What `Response` holds, however it was computed."""

    @property
    def compliance(self) -> Array: ...
    @property
    def fields(self) -> Array: ...
    @property
    def reactions(self) -> Array: ...
    @property
    def energy(self) -> Array: ...
    @property
    def unknowns(self) -> int: ...


class LoadCase(NamedTuple):
    """One load on the platform: force (3,) N, N, N mm; pose (3,) mm, mm, rad; field (n, 2) mm; energy N mm;
    stress (n,) von Mises, MPa; neck_stress (3 chains, 3 hinges), the largest in each notch, MPa."""

    force: Array
    pose: Array
    field: Array
    reaction: Array
    energy: float
    stress: Array
    neck_stress: Array


def plate_of(stage: Stage) -> Plate:
    """The stage's sheet. Raises BadInput for a model that finite elements in the plane cannot have."""
    with located(stage):
        if stage.model == "corrected":
            raise BadInput(
                'model = "corrected", which has hinges of three dimensions, expected "plane_stress" or "plane_strain": '
                "the finite elements are plane"
            )
    E, nu = stage.elastic
    return Plate(float(E), float(nu), stage.thickness)


def out_of_plane_ratio_of(stage: Stage) -> float:
    """The stress out of the plane over the sum of those in it: `pull` of `plane_stress.von_mises`."""
    return float(out_of_plane(stage.model, stage.material.poissons_ratio))


def platform_response(mesh: StageMesh, plate: Plate, degree: int = QUADRATURE) -> Response:
    """Solve for unit loads on the rigid hub with the ground clamped; `degree` is that of the quadrature.

    Raises ComputationFailed when reactions do not balance the loads, or energy and work differ, beyond `BALANCE`.

    Notes
    -----
    The hub's nodes follow the platform, `u = U + theta x r`, so `u = T q` with the pose as the last three of `q`; the
    compliance is the pose block of `(T' K T)^-1`, which makes it symmetric and conjugate to the load.
    """
    batches, tied = integration(mesh, degree), tie_hub(mesh)
    solve = factorise(tied_lower(mesh.triangles, matrices_of(batches, plate), tied.number, tied.rigid))
    loads = np.zeros((2 * len(tied.free) + 3, 3))
    loads[-3:] = np.eye(3)
    motion, residual, size = np.zeros_like(loads), loads, float(np.max(np.abs(mesh.nodes)))
    for _ in range(MOST_SOLVES):
        motion = motion + solve(residual)
        fields = tied.fields(motion)
        forces = internal_forces(batches, plate, fields)
        residual = loads - tied.loads(forces)
        energy = np.einsum("ind,jnd->ij", fields, forces)
        response = Response(motion[-3:], fields, resultants(mesh, forces), energy, len(loads))
        if max(imbalance(response, size).values()) <= SETTLED:
            break
    check_balance(response, size)
    return response


class Tied(NamedTuple):
    """Unknowns of the stage: free nodes (f,), then the pose of the hub, whose nodes (h,) follow it.

    number : (n,), free nodes counted first, then hub nodes; -1 where clamped.
    rigid : (2h, 3), displacement of the hub's nodes per pose, `u = U + theta x r`.
    """

    number: Index
    free: Index
    hub: Index
    rigid: Array

    def fields(self, motion: Array) -> Array:
        """Displacements (k, n, 2) of all nodes from unknowns (2f + 3, k)."""
        fields = np.zeros((motion.shape[1], len(self.number), 2))
        fields[:, self.free] = motion[:-3].T.reshape(-1, len(self.free), 2)
        fields[:, self.hub] = (self.rigid @ motion[-3:]).T.reshape(-1, len(self.hub), 2)
        return fields

    def loads(self, forces: Array) -> Array:
        """Loads (2f + 3, k) on the unknowns from nodal forces (k, n, 2)."""
        free = forces[:, self.free].reshape(len(forces), -1)
        hub = forces[:, self.hub].reshape(len(forces), -1) @ self.rigid
        return np.concatenate([free, hub], axis=1).T


def tie_hub(mesh: StageMesh) -> Tied:
    """Number the unknowns: ground clamped, hub rigid."""
    hub = np.unique(mesh.edges["hub"])
    number = np.zeros(len(mesh.nodes), dtype=np.int64)
    number[mesh.edges["ground"]] = -1
    number[hub] = -1
    free = np.flatnonzero(number == 0)
    number[free] = np.arange(len(free))
    number[hub] = len(free) + np.arange(len(hub))
    return Tied(number, free, hub, rigid_motion(mesh.nodes[hub]))


def rigid_motion(nodes: Array) -> Array:
    """Displacements (2h, 3) of nodes (h, 2) per pose, `u = U + theta x r`."""
    x, y = nodes.T
    one, zero = np.ones(len(nodes)), np.zeros(len(nodes))
    return np.stack([one, zero, -y, zero, one, x], axis=-1).reshape(-1, 3)


def check_balance(response: UnitResponse, size: float) -> None:
    """Refuse a response whose reactions or energies do not match its loads; `size` mm makes moments comparable."""
    for name, worst in imbalance(response, size).items():
        if not worst <= BALANCE:
            raise ComputationFailed(f"solution refused: {name} differ by {worst:.2g}, expected at most {BALANCE:g}")


def imbalance(response: UnitResponse, size: float) -> dict[str, float]:
    """What reactions and loads, and energy and work, differ by relative to the loads; arguments as `check_balance`."""
    scale = np.array([1.0, 1.0, 1.0 / size])
    unbalanced = np.max(np.abs((response.reactions + np.eye(3)) * scale), axis=1) / scale
    work = np.abs(response.energy - response.compliance) / np.sqrt(
        np.abs(np.outer(np.diag(response.compliance), np.diag(response.compliance)))
    )
    return {"reactions and load": float(np.max(unbalanced)), "strain energy and work": float(np.max(work))}


def load_case(stage: Stage, mesh: StageMesh, response: UnitResponse, force: Array) -> LoadCase:
    """Combine the unit responses to one load (3,), N, N and N mm, at the platform centre."""
    force = np.asarray(force, dtype=float)
    field = np.tensordot(force, response.fields, axes=1)
    stress = von_mises(nodal_stress(mesh, plate_of(stage), field), out_of_plane_ratio_of(stage))
    return LoadCase(
        force=force,
        pose=response.compliance @ force,
        field=field,
        reaction=force @ response.reactions,
        energy=float(force @ response.energy @ force / 2),
        stress=stress,
        neck_stress=neck_maxima(stage, mesh, stress),
    )


def neck_maxima(stage: Stage, mesh: StageMesh, values: Array) -> Array:
    """Largest nodal value (3 chains, 3 hinges) within a notch radius of each neck's centre."""
    centres = stage_frames(stage).centres
    found = np.empty((3, 3))
    for chain, position in np.ndindex(3, 3):
        near = np.hypot(*(mesh.nodes - centres[chain, position]).T)
        found[chain, position] = np.max(values[near <= stage.hinge(chain + 1, HINGE_NAMES[position]).radius])
    return found


def resultants(mesh: StageMesh, forces: Array) -> Array:
    """Force and moment about the origin (3 loads, 3) of nodal forces (3 loads, n, 2) on the clamped edges."""
    ground = np.unique(mesh.edges["ground"])
    x, y = mesh.nodes[ground].T
    fx, fy = np.moveaxis(forces[:, ground], -1, 0)
    return np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y], axis=1)
