"""Committed meshes: finite elements repeat on one to the digits of the solver, whatever gmsh is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexfem.arrays import AnyArray, Array, Index
from flexfem.commands.baseline.moves import Leaf
from flexfem.fem.mesh import StageMesh, build_mesh, check_mesh
from flexfem.files.writing import digest_of_arrays, read_arrays, write_atomically
from flexfem.mechanism.bodies import Segment, draw_sector, turn
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput, ComputationFailed

COARSE = 2  # triangles across the necks of a committed mesh
ON_OUTLINE = 1e-6  # mm
CHORDS = 2e-2  # relative: an arc is longer than the chords of its nodes


def mesh_name(path: Path, stage: Stage) -> str:
    """The file of the committed mesh of a stage file."""
    return f"{path.stem}-{stage.hash[:8]}.npz"


def committed_mesh(stage: Stage, path: Path) -> StageMesh:
    """The committed mesh of a feasible stage, made when it is missing.

    Raises BadInput when it is damaged or not of that stage.
    """
    if not path.exists():
        write_mesh(build_mesh(stage, COARSE), path)
    mesh = read_mesh(path)
    try:
        check_drawn(mesh, stage)
    except (ComputationFailed, IndexError, ValueError) as error:
        raise BadInput(f"{path}: not the mesh of the stage as drawn: {error}") from None
    return mesh


def mesh_keys(path: Path) -> dict[str, Leaf]:
    """Size and hash of a committed mesh. Raises BadInput when it is missing or damaged."""
    arrays = read_arrays(path, "a committed mesh")
    sizes: dict[str, Leaf] = {name: len(arrays[name]) for name in ("nodes", "triangles") if name in arrays}
    return {**sizes, "sha256": digest_of_arrays(arrays)}


def write_mesh(mesh: StageMesh, path: Path) -> None:
    """Store a mesh as arrays. Raises BadInput when the folder does not take it."""
    arrays: dict[str, AnyArray] = {f"edges.{name}": edge for name, edge in mesh.edges.items()} | {
        "nodes": mesh.nodes,
        "triangles": mesh.triangles.astype(np.int32),
        "bodies": mesh.bodies.astype(np.int8),
    }
    write_atomically(path, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))


def read_mesh(path: Path) -> StageMesh:
    """Read a stored mesh. Raises BadInput when it is missing or damaged."""
    arrays = read_arrays(path, "a committed mesh")
    try:
        edges = {name.removeprefix("edges."): arrays[name] for name in arrays if name.startswith("edges.")}
        triangles, bodies = (arrays[name].astype(np.int64) for name in ("triangles", "bodies"))
        return StageMesh(arrays["nodes"], triangles, bodies, edges)
    except KeyError as error:
        raise BadInput(f"{path}: expected a committed mesh: it has no {error}") from None


def check_drawn(mesh: StageMesh, stage: Stage) -> None:
    """Refuse a mesh whose boundary, necks, hub or ground are not those drawn. Raises ComputationFailed."""
    check_mesh(mesh, stage)
    drawn, points = _drawn(stage), mesh.nodes @ [1.0, 1j]
    outline = [one for label, segments in drawn.items() if not label.startswith("neck") for one in segments]
    starts = np.array([segment.start for segment in outline])
    _refuse("a corner of the outline has no node near", starts, np.min(np.abs(starts[:, None] - points), axis=1))
    boundary = points[np.unique(boundary_edges(mesh))]
    _refuse("a node of the boundary is off the outline", boundary, _distance(outline, boundary))
    for label, segments in drawn.items():
        if label != "free":
            _check_labelled(mesh, points, label, segments)


def _drawn(stage: Stage) -> dict[str, list[Segment]]:
    """Curves of the whole stage by the labels of the mesh's edges, `free` for the rest of the outline."""
    found: dict[str, list[Segment]] = {}
    for chain in (1, 2, 3):
        necks = set[str]()
        for face in draw_sector(stage, chain).values():
            for segment, label in zip(turn(face.loop, chain), face.labels, strict=True):
                if not label.startswith("cut") and label not in necks:
                    found.setdefault(label.replace("neck", f"neck {chain}"), []).append(segment)
                if label.startswith("neck"):  # two bodies share it
                    necks.add(label)
    return found


def _check_labelled(mesh: StageMesh, points: AnyArray, label: str, segments: list[Segment]) -> None:
    """Refuse edges that do not lie on the curves of their label, or do not cover them."""
    if label not in mesh.edges:
        raise ComputationFailed(f"it has no edges {label!r}")
    at = points[mesh.edges[label]]
    _refuse(f"a node of {label!r} is off what is drawn", at.ravel(), _distance(segments, at.ravel()))
    meshed = float(np.sum(np.abs(at[:, 0] - at[:, 2]) + np.abs(at[:, 2] - at[:, 1])))
    wanted = sum(segment.length for segment in segments)
    slack = CHORDS if any(segment.centre is not None for segment in segments) else ON_OUTLINE
    if abs(meshed / wanted - 1) > slack:
        raise ComputationFailed(f"edges {label!r} are {meshed:.6g} mm long, expected {wanted:.6g}")


def boundary_edges(mesh: StageMesh) -> Index:
    """Edges (k, 3) that belong to one triangle only: ends, then middle."""
    t = mesh.triangles
    sides = np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])
    _, first, count = np.unique(sides[:, 2], return_index=True, return_counts=True)
    return np.asarray(sides[first[count == 1]])


def _distance(segments: list[Segment], points: AnyArray) -> Array:
    """Distance (n,), mm, of points (n,), complex, from the nearest of some curves."""
    return np.asarray(np.min([_to_segment(segment, points) for segment in segments], axis=0))


def _to_segment(segment: Segment, points: AnyArray) -> Array:
    ends = np.minimum(np.abs(points - segment.start), np.abs(points - segment.end))
    if segment.centre is None:
        along = (points - segment.start) / (segment.end - segment.start)
        beside = np.where((along.real >= 0) & (along.real <= 1), np.abs(along.imag) * segment.length, np.inf)
    else:
        around = (points - segment.centre) / (segment.start - segment.centre)
        part = np.angle(around) / segment.turn
        off = np.abs(np.abs(around) - 1) * abs(segment.start - segment.centre)
        beside = np.where((part >= 0) & (part <= 1), off, np.inf)
    return np.asarray(np.minimum(ends, beside))


def _refuse(said: str, points: AnyArray, distance: Array) -> None:
    worst = int(np.argmax(distance))
    if not distance[worst] <= ON_OUTLINE:
        z = points[worst]
        raise ComputationFailed(f"{said}: ({z.real:.4f}, {z.imag:.4f}) mm, by {distance[worst]:.2g} mm")
