"""Meshes and fields for other programs: .msh through gmsh, .vtu through meshio, .inp for Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Plate
from flexfem.fem.gmsh_process import run_mesher
from flexfem.fem.mesh import StageMesh
from flexfem.fem.mesher import Export
from flexfem.files.writing import replacing, write_atomically
from flexfem.refused import BadInput

PER_LINE = 8  # members of a set; CalculiX takes at most 16 entries a line
UNIT_LOADS = np.eye(3)


def write_deck(
    mesh: StageMesh,
    plate: Plate,
    path: Path,
    loads: Array = UNIT_LOADS,
    thickness: float | None = None,
    uncoupled: bool = False,
) -> None:
    """Write the stage as an Abaqus/CalculiX input deck, in N, mm, MPa and rad.

    Parameters
    ----------
    loads : (k, 3), N, N and N mm, on the platform's centre; each is a linear static step of its own.
    thickness : mm, of the elements instead of the plate's own; loads are written as they are given.
    uncoupled : write a material whose thickness does not answer to stresses in the plane (see Notes).

    Raises BadInput when the file cannot be written.

    Notes
    -----
    Sets `stage` (elements), `all`, `ground`, `hub` and `platform` (nodes). Node k of the mesh is number k + 1; two
    more at the platform's centre carry the pose: the first has x and y in its degrees of freedom 1 and 2, the second
    has theta, in rad, in its degree of freedom 1, where a moment in N mm acts as a force.

    The hub follows them by `u = X - theta y`, `v = Y + theta x`, written as linear equations: that is the rigid hub
    of small rotations in any linear step. `*RIGID BODY` would be the shorter way to say it, but states a large
    rotation, which each program linearises by its own rules; in CalculiX 2.20 both give the same digits.

    In plane stress only E1, E2, nu12 and G12 of an orthotropic sheet matter. The uncoupled material keeps these and
    sets `nu13 = nu23 = 0`: the same sheet for a program that knows plane stress, and for one that makes wedges of the
    triangles, as CalculiX does, the way to plane stress at any thickness (see `tests/validation/calculix.py`).
    """
    model = _model(mesh, plate, plate.thickness if thickness is None else thickness, uncoupled)
    _write(path, (*model, *_static(len(mesh.nodes) + 1, loads)))


def _write(path: Path, lines: Iterable[str]) -> None:
    text = "\n".join(lines)
    write_atomically(path, lambda file: file.write(f"{text}\n".encode()))


def _model(mesh: StageMesh, plate: Plate, thickness: float, uncoupled: bool) -> Iterator[str]:
    centre, rotation = len(mesh.nodes) + 1, len(mesh.nodes) + 2
    hub = np.unique(mesh.edges["hub"])
    yield "*HEADING"
    yield "flexure-hinge stage by flexfem; N, mm, MPa, rad"
    yield "*NODE, NSET=all"
    yield from (f"{k}, {_field(x)}, {_field(y)}, 0" for k, (x, y) in enumerate(mesh.nodes, start=1))
    yield "*NODE, NSET=platform"
    yield from (f"{node}, 0, 0, 0" for node in (centre, rotation))
    yield "*ELEMENT, TYPE=CPS6, ELSET=stage"  # corners, then middles of the sides 12, 23, 31: the mesh's own order
    yield from (", ".join(map(str, (k, *row))) for k, row in enumerate((mesh.triangles + 1).tolist(), start=1))
    yield from _node_set("ground", np.unique(mesh.edges["ground"]))
    yield from _node_set("hub", hub)
    yield from _material(plate, uncoupled)
    yield "*SOLID SECTION, ELSET=stage, MATERIAL=sheet"
    yield _field(thickness)
    for node, (x, y) in zip((hub + 1).tolist(), mesh.nodes[hub], strict=True):
        yield from ("*EQUATION", "3", f"{node}, 1, 1, {centre}, 1, -1, {rotation}, 1, {_field(y)}")
        yield from ("*EQUATION", "3", f"{node}, 2, 1, {centre}, 2, -1, {rotation}, 1, {_field(-x)}")
    yield from ("*BOUNDARY", "ground, 1, 2")


def _static(centre: int, loads: Array) -> Iterator[str]:
    """A linear static step for each load (k, 3) on the node of the platform's centre and the next, its rotation."""
    for fx, fy, moment in loads:
        yield from ("*STEP", "*STATIC", "*CLOAD, OP=NEW")
        yield from (f"{centre}, 1, {_field(fx)}", f"{centre}, 2, {_field(fy)}", f"{centre + 1}, 1, {_field(moment)}")
        yield from ("*NODE PRINT, NSET=all", "U", "*NODE PRINT, NSET=platform", "U")
        yield from ("*NODE PRINT, NSET=ground, TOTALS=YES", "RF", "*EL FILE", "S", "*END STEP")


def _material(plate: Plate, uncoupled: bool) -> Iterator[str]:
    E, nu = _field(plate.youngs_modulus), _field(plate.poissons_ratio)
    G = _field(plate.youngs_modulus / (2 * (1 + plate.poissons_ratio)))
    yield "*MATERIAL, NAME=sheet"
    if uncoupled:
        yield from ("*ELASTIC, TYPE=ENGINEERING CONSTANTS", f"{E}, {E}, {E}, {nu}, 0, 0, {G}, {G}", G)
    else:
        yield from ("*ELASTIC", f"{E}, {nu}")


def _node_set(name: str, nodes: Index) -> Iterator[str]:
    yield f"*NSET, NSET={name}"
    numbers = (nodes + 1).tolist()
    for start in range(0, len(numbers), PER_LINE):
        yield ", ".join(map(str, numbers[start : start + PER_LINE])) + ","


def _field(value: float) -> str:
    """A number for CalculiX, which reads no more than 20 characters of a field."""
    return f"{value:.12g}"


FORMATS = (".msh", ".vtu", ".inp")


def write_mesh(mesh: StageMesh, plate: Plate, path: Path) -> None:
    """Write a mesh by its file's extension, with the groups `stage`, `ground` and `hub`.

    An Abaqus or CalculiX deck (.inp) also holds the plate, the clamps, the rigid hub and a step for each unit load.

    Raises BadInput for an extension that is not in `FORMATS`.
    """
    check_format(path)
    if path.suffix == ".vtu":
        write_vtu(mesh, path, {})
        return
    if path.suffix == ".inp":
        write_deck(mesh, plate, path)
        return
    groups = {"ground": mesh.edges["ground"], "hub": mesh.edges["hub"]}
    with replacing(path) as temporary:
        run_mesher(Export(str(temporary), mesh.nodes, mesh.triangles, groups), time_limit=600.0)
        if b"$EndElements" not in temporary.read_bytes()[-64:]:  # gmsh does not say when the disk is full
            raise BadInput(f"{path}: cannot be written whole, expected more room on the disk")


def check_format(path: Path) -> None:
    """Raise BadInput when no format is known by the file's extension."""
    if path.suffix not in FORMATS:
        found = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise BadInput(f"{path}: {found}, expected a file name that ends in one of {', '.join(FORMATS)}")


def write_vtu(mesh: StageMesh, path: Path, fields: dict[str, Array], heights: Array | None = None) -> None:
    """Write the mesh with nodal fields (n, ...) as VTK's unstructured grid; 1 marks the nodes of `ground` and `hub`.

    heights : (m,), mm, of the nodes of wedges of 18 nodes, ends and middles of the layers; fields are (n, m, ...).
    """
    import meshio

    m = 1 if heights is None else len(heights)
    own = 1 if heights is None else 2  # axes of a field that are nodes
    data = {name: field.reshape(-1, *field.shape[own:]) for name, field in fields.items()}
    for name, field in data.items():
        data[name] = np.pad(field, [(0, 0), (0, 1)]) if field.shape[1:] == (2,) else field
    for group in ("ground", "hub"):
        data[group] = np.repeat(np.isin(np.arange(len(mesh.nodes)), mesh.edges[group]).astype(float), m)
    z = np.zeros(1) if heights is None else heights
    points = np.column_stack([np.repeat(mesh.nodes, m, axis=0), np.tile(z, len(mesh.nodes))])
    corners, middles, kind = m * mesh.triangles[:, :3], m * mesh.triangles[:, 3:], "triangle6"
    cells, bodies = mesh.triangles, mesh.bodies
    if heights is not None:
        order = ((corners, 0), (corners, 2), (middles, 0), (middles, 2), (corners, 1), (middles, 1))
        layers = [np.hstack([nodes + k + level for nodes, level in order]) for k in range(0, m - 1, 2)]
        cells, bodies, kind = np.concatenate(layers), np.tile(mesh.bodies, len(layers)), "wedge18"
    grid = meshio.Mesh(points, [(kind, cells)], data, {"body": [bodies]})
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="vtu")
