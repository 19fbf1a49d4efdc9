"""Other finite elements of a stage than those of the verification, and what they make of its model's error."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.cyclic import cyclic_response
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import RESOLUTION, StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import plate_of, tie_hub
from flexfem.fem.sectors import uneven_sectors, welded
from flexfem.mechanism.stage import Stage
from flexfem.verify.protocol import Solve

ACROSS = (1, 2, 4, 8)  # linear triangles across every neck
UNEVEN = ((1, 2, 2), (3, 4, 4))  # triangles across the necks of the three sectors; their cuts have the same nodes


def other_elements(stage: Stage, solve: Solve) -> dict[str, Array]:
    """Platform compliances (3, 3) of a stage by the finite elements as verified, the first, and by others."""
    fine, plate = solve(stage, RESOLUTION), plate_of(stage)
    held = plate_of(stage.model_copy(update={"model": "plane_strain"}))
    found = {"none: curved quadratic triangles, as verified": fine.response.compliance}
    for n in ACROSS:
        found[f"linear triangles, {n} across every neck"] = linear_compliance(solve(stage, n).mesh, plate)
    for across in UNEVEN:
        sectors, said = uneven_sectors(stage, across), ", ".join(map(str, across))
        found[f"asymmetric mesh, {said} linear triangles"] = linear_compliance(welded(sectors)[0], plate)
        found[f"asymmetric mesh, {said} quadratic triangles"] = cyclic_response(sectors, plate).compliance
    strain = cyclic_response(fine.response.sectors, held).compliance
    return found | {"finite elements in plane strain, the limit of wide necks": strain}


def linear_compliance(mesh: StageMesh, plate: Plate) -> Array:
    """Platform compliance (3, 3) with straight linear triangles on the corners of a mesh, in x, y, theta.

    Notes
    -----
    `K = b A B^T D B` with constant strain; the hub is tied as in `response.platform_response`.
    """
    corners = int(mesh.triangles[:, :3].max()) + 1  # the first nodes, see `mesh.ordered`
    edges = {name: edge[:, :2] for name, edge in mesh.edges.items()}
    straight = StageMesh(mesh.nodes[:corners], mesh.triangles[:, :3], mesh.bodies, edges)
    tied = tie_hub(straight)
    free = 2 * len(tied.free)
    T = sp.block_diag([sp.eye_array(free), tied.rigid], format="csr")
    kept = (2 * np.concatenate([tied.free, tied.hub])[:, None] + np.arange(2)).ravel()
    K = _linear_stiffness(straight, plate)[kept][:, kept]
    loads = np.zeros((free + 3, 3))
    loads[free:] = np.eye(3)
    return np.asarray(factorise(sp.tril(T.T @ K @ T).tocoo())(loads)[free:])


def _linear_stiffness(mesh: StageMesh, plate: Plate) -> sp.csr_array:
    """Stiffness matrix (2n, 2n) of linear triangles (m, 3), N/mm."""
    at = mesh.nodes[mesh.triangles]
    sides = np.roll(at, -2, axis=1) - np.roll(at, -1, axis=1)  # opposite to each corner
    area = 0.5 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    gradient = np.stack([-sides[..., 1], sides[..., 0]], axis=-1) / (2 * area)[:, None, None]
    B = np.zeros((len(at), 3, 6))
    B[:, 0, 0::2], B[:, 1, 1::2] = gradient[..., 0], gradient[..., 1]
    B[:, 2, 0::2], B[:, 2, 1::2] = gradient[..., 1], gradient[..., 0]
    lame, mu = plate.lame
    D = np.array([[lame + 2 * mu, lame, 0.0], [lame, lame + 2 * mu, 0.0], [0.0, 0.0, mu]])
    K = (plate.thickness * area)[:, None, None] * (B.transpose(0, 2, 1) @ D @ B)
    place = (2 * mesh.triangles[..., None] + np.arange(2)).reshape(len(at), 6)
    rows, columns = np.repeat(place, 6, axis=1).ravel(), np.tile(place, 6).ravel()
    size = 2 * len(mesh.nodes)
    return sp.coo_array((K.ravel(), (rows, columns)), shape=(size, size)).tocsr()
