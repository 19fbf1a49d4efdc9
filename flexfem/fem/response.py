"""How the stage answers loads on its rigid hub: one factorisation, any number of load cases, checked balances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from flexfem.arrays import Array
from flexfem.design import HINGE_NAMES, Stage
from flexfem.errors import ComputationFailed
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate, integration, internal_forces, nodal_stress, stiffness_matrix, von_mises
from flexfem.layout.frames import stage_frames

BALANCE = 1e-9  # of the load: reactions, and energy against work
MOST_SOLVES = 12  # with iterative refinement; three do for necks of some um and more
ROUND_OFF = 1e-13  # of the displacement: a step of refinement that changes nothing
SYMMETRIC = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}


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
    """The stage's sheet."""
    return Plate(stage.material.youngs_modulus, stage.material.poissons_ratio, stage.thickness)


def platform_response(mesh: StageMesh, plate: Plate) -> Response:
    """Solve for unit loads on the rigid hub with the ground clamped.

    Raises ComputationFailed when reactions do not balance the loads, or energy and work differ, beyond `BALANCE`.

    Notes
    -----
    The hub's nodes follow the platform, `u = U + theta x r`, so `u = T q` with the pose as the last three of `q`; the
    compliance is the pose block of `(T' K T)^-1`, which makes it symmetric and conjugate to the load.
    """
    strips, rigid = integration(mesh), rigid_hub(mesh)
    reduced = (rigid.T @ stiffness_matrix(strips, plate, len(mesh.nodes)) @ rigid).tocsc()
    factor = splu(reduced, **SYMMETRIC)
    loads = np.zeros((reduced.shape[0], 3))
    loads[-3:] = np.eye(3)
    motion = np.zeros_like(loads)
    residual = loads
    for _ in range(MOST_SOLVES):
        step = factor.solve(residual)
        motion = motion + step
        fields = np.ascontiguousarray((rigid @ motion).T.reshape(3, -1, 2))
        forces = internal_forces(strips, plate, fields)
        residual = loads - rigid.T @ forces.reshape(3, -1).T
        if np.all(np.linalg.norm(step, axis=0) <= ROUND_OFF * np.linalg.norm(motion, axis=0)):
            break
    response = Response(
        compliance=motion[-3:],
        fields=fields,
        reactions=_resultants(mesh, forces),
        energy=np.einsum("ind,jnd->ij", fields, forces),
        unknowns=reduced.shape[0],
    )
    check_balance(response, float(np.max(np.abs(mesh.nodes))))
    return response


def rigid_hub(mesh: StageMesh) -> sp.csc_array:
    """The matrix T (2n, free + 3) from free degrees of freedom and the pose (x, y, theta) to all nodes."""
    n = len(mesh.nodes)
    hub, ground = np.unique(mesh.edges["hub"]), np.unique(mesh.edges["ground"])
    free = np.setdiff1d(np.arange(n), np.union1d(hub, ground))
    free = (2 * free[:, None] + np.arange(2)).ravel()
    x, y = mesh.nodes[hub].T
    last = len(free) + np.arange(3)
    one = np.ones(len(hub))
    rows = [free, 2 * hub, 2 * hub, 2 * hub + 1, 2 * hub + 1]
    columns = [np.arange(len(free)), last[0] * one, last[2] * one, last[1] * one, last[2] * one]
    values = [np.ones(len(free)), one, -y, one, x]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns).astype(int))
    return sp.coo_array(entries, shape=(2 * n, len(free) + 3)).tocsc()


def check_balance(response: Response, size: float) -> None:
    """Refuse a response whose reactions or energies do not match its loads; `size` mm makes moments comparable."""
    scale = np.array([1.0, 1.0, 1.0 / size])
    unbalanced = np.max(np.abs((response.reactions + np.eye(3)) * scale), axis=1) / scale
    work = np.abs(response.energy - response.compliance) / np.sqrt(
        np.abs(np.outer(np.diag(response.compliance), np.diag(response.compliance)))
    )
    for name, worst in (("reactions and load", np.max(unbalanced)), ("strain energy and work", np.max(work))):
        if not worst <= BALANCE:
            raise ComputationFailed(f"solution refused: {name} differ by {worst:.2g}, expected at most {BALANCE:g}")


def load_case(stage: Stage, mesh: StageMesh, response: Response, force: Array) -> LoadCase:
    """Combine the unit responses to one load (3,), N, N and N mm, at the platform centre."""
    force = np.asarray(force, dtype=float)
    field = np.tensordot(force, response.fields, axes=1)
    stress = von_mises(nodal_stress(mesh, plate_of(stage), field))
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


def _resultants(mesh: StageMesh, forces: Array) -> Array:
    """Force and moment about the origin (3 loads, 3) of nodal forces (3 loads, n, 2) on the clamped edges."""
    ground = np.unique(mesh.edges["ground"])
    x, y = mesh.nodes[ground].T
    fx, fy = np.moveaxis(forces[:, ground], -1, 0)
    return np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ x - fx @ y], axis=1)
