"""What a study asks of the fields of a ring of thirds: neck stresses, rotations of the base hinges, the envelope."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.plane_stress import Plate, stress_tensor, von_mises
from flexfem.fem.response import out_of_plane_ratio_of, plate_of
from flexfem.fem.sector import Ring, rotation, under_loads
from flexfem.fem.thirds import Third
from flexfem.fem.triangle import NODES, gradients
from flexfem.stage.bodies import BODIES, necks
from flexfem.stage.schema import HINGE_NAMES, Stage

BESIDE = (1.0, 2.0)  # distances from a base hinge, per radius, between which its two bodies are taken for rigid


def neck_stresses(stage: Stage, ring: Ring, loads: Array) -> Array:
    """Largest von Mises stress (k, 3 chains, 3 hinges), MPa, in each notch under loads (k, 3), N, N, N mm.

    Notes
    -----
    As `response.load_case`: averaged over the triangles around a node, the largest within a notch radius of the neck.
    """
    found, plate, pull = np.empty((len(loads), 3, 3)), plate_of(stage), out_of_plane_ratio_of(stage)
    for third, field, chains in _thirds(ring):
        near = _near(stage, third, chains[0])
        chosen = np.flatnonzero(np.any(near, axis=0))
        near, stress = near[:, chosen], _stress_at(third, plate, field, chosen)
        for chain in chains:
            turned_back = loads @ rotation(chain - chains[0])
            values = von_mises(np.tensordot(turned_back, stress, axes=1), pull)
            for hinge, close in enumerate(near):
                found[:, chain, hinge] = np.max(values[:, close], axis=1)
    return found


def base_rotations(stage: Stage, ring: Ring) -> Array:
    """Rotation (3 loads, 3 chains), rad, of link 1 against the pad, of every base hinge under unit loads.

    Notes
    -----
    The rotation of a body is that of the rigid motion that fits the displacements of its nodes between one and two
    notch radii from the neck's centre best, by least squares: beside the notch and not in it.
    """
    rows = [_base_rotation(stage, third, field, chains[0])[:, None] for third, field, chains in _thirds(ring)]
    return np.concatenate(under_loads(rows), axis=1)


def envelope(ring: Ring) -> float:
    """Diameter, mm, of the circle about the platform's centre that holds the stage."""
    return 2 * max(float(np.max(np.hypot(*third.mesh.nodes.T))) for third in ring.thirds)


def _thirds(ring: Ring) -> Iterator[tuple[Third, Array, tuple[int, ...]]]:
    """Every third with its fields and the chains, from 0, that it stands for."""
    if len(ring.thirds) == 1:
        yield ring.thirds[0], ring.fields[0], (0, 1, 2)
        return
    for chain, (third, field) in enumerate(zip(ring.thirds, ring.fields, strict=True)):
        yield third, field, (chain,)


def _near(stage: Stage, third: Third, chain: int) -> AnyArray:
    """Which nodes are within a notch radius of each neck's centre, bool (3 hinges, n)."""
    x, y = third.mesh.nodes.T
    places = zip(necks(stage, chain + 1), HINGE_NAMES, strict=True)
    return np.array(
        [np.hypot(x - p.point.real, y - p.point.imag) <= stage.hinge(chain + 1, name).radius for p, name in places]
    )


def _stress_at(third: Third, plate: Plate, fields: Array, chosen: Index) -> Array:
    """Stress (3 loads, c, 3), MPa, as xx, yy, xy at chosen nodes (c,), averaged over the triangles around each."""
    mesh, n = third.mesh, len(third.mesh.nodes)
    triangles = mesh.triangles[np.isin(mesh.triangles, chosen).any(axis=1)]
    gradient, _ = gradients(mesh.nodes[triangles], NODES)
    relative = fields[:, triangles] - fields[:, triangles[:, :1]]
    slopes = relative.transpose(0, 1, 3, 2) @ gradient.reshape(1, len(triangles), 6, 12)
    stress = stress_tensor(plate, slopes.reshape(*slopes.shape[:3], 2, 6))
    around, found = np.bincount(triangles.ravel(), minlength=n)[chosen], np.empty((len(fields), len(chosen), 3))
    for place, (row, column) in enumerate([(0, 0), (1, 1), (0, 1)]):
        for load, part in enumerate(stress[:, :, row, column]):
            found[load, :, place] = np.bincount(triangles.ravel(), part.ravel(), n)[chosen] / around
    return found


def _base_rotation(stage: Stage, third: Third, fields: Array, chain: int) -> Array:
    """Rotation (3 loads,) at the base hinge of one third."""
    mesh, place, hinge = third.mesh, necks(stage, chain + 1)[0].point, stage.hinge(chain + 1, "base")
    distance = np.hypot(*(mesh.nodes - [place.real, place.imag]).T) / hinge.radius
    beside = (distance >= BESIDE[0]) & (distance <= BESIDE[1])
    turns = []
    for body in ("pad", "link 1"):
        of_body = np.unique(mesh.triangles[mesh.bodies == BODIES.index(body)])
        chosen = of_body[beside[of_body]]
        arm = mesh.nodes[chosen] - mesh.nodes[chosen].mean(axis=0)
        turns.append((fields[:, chosen, 1] @ arm[:, 0] - fields[:, chosen, 0] @ arm[:, 1]) / np.sum(arm**2))
    return np.asarray(turns[1] - turns[0])
